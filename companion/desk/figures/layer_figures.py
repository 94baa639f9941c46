"""Drawings of the map layers: surface, safe ground, and any layer by a ramp."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.figures.picture import Marks, Picture
from params import Parameters
from slz import SAFE, UNKNOWN, Zone
from slz.terrain.layers import Layer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# The sources use dark green, light green and red (SLZ thesis, Section 4.3). These also differ in lightness,
# so that colour-blind readers can distinguish red zones from green ones.
CERTAIN, LESS_CERTAIN, UNCERTAIN = "#1b7837", "#a6d96a", "#d7301f"
SAFE_ELSEWHERE, NO_DATA = "#d9e8d3", "#ffffff"
MOST_LABELS = 40
COVERED = 0.02  # of the map's length: a mark nearer to a number than this hides it
MAP_PT = 620.0, 860.0  # greatest width and height of the map in a picture
DIGIT_EM = 0.7  # width of a bold digit with its halo
BESIDE_PT = (9, 7)  # offset right of a mark and above it


def draw_surface(axes: Axes, picture: Picture) -> None:
    from matplotlib import colormaps
    from matplotlib.colors import Normalize

    altitude_m = picture.height_m + picture.maps.frame.alt_m
    known = altitude_m[np.isfinite(altitude_m)]
    low, high = np.percentile(known, [0.5, 99.5]) if len(known) else (0.0, 1.0)
    norm = Normalize(float(low), max(float(high), float(low) + 0.5), clip=True)
    colour = np.asarray(colormaps["viridis"](norm(np.nan_to_num(altitude_m))))
    colour[..., :3] *= (0.45 + 0.55 * picture.shade)[..., None]
    _show(axes, picture, colour, np.isnan(altitude_m))
    _outline(axes, picture, "white")
    _colour_bar(axes, colormaps["viridis"], norm, "altitude, m")


def draw_ramp(axes: Axes, picture: Picture, layer: Layer) -> None:
    """Draw a layer: where it has a limit, blue below and orange above, else dark to light."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap, Normalize, TwoSlopeNorm

    limit = getattr(picture.parameters, layer.limit) if layer.limit else None
    label = layer.meaning.format(unit=layer.unit_in(picture.parameters.mode))
    if limit is None:
        top = layer.full
        shades, norm = colormaps["cividis"], Normalize(0.0, top)
    else:
        top = max(2 * layer.full, 2 * limit)
        gentle, steep = (
            colormaps["Blues"](np.linspace(0.02, 0.6, 128)),
            colormaps["YlOrBr"](np.linspace(0.4, 1, 128)),
        )
        shades, norm = ListedColormap(np.vstack([gentle, steep])), TwoSlopeNorm(limit, 0.0, top)
        label = f"{label} (safe below {limit:g})"
    values = picture.maps.layers[layer.name][:: picture.step, :: picture.step]
    colour = np.asarray(shades(norm(np.clip(np.nan_to_num(values), 0, top))))
    colour[..., :3] *= (0.72 + 0.4 * picture.shade).clip(0, 1)[..., None]
    _show(axes, picture, colour, np.isnan(values))
    _outline(axes, picture, "black")
    bar = _colour_bar(axes, shades, norm, label)
    if limit is not None:
        bar.set_ticks([0, limit / 2, limit, (limit + top) / 2, top])


def draw_safe(axes: Axes, picture: Picture) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    grey = 0.35 + 0.45 * picture.shade
    colour = np.stack([grey, grey, grey, np.ones_like(grey)], axis=-1)
    colour[picture.state == SAFE, :3] = to_rgb(SAFE_ELSEWHERE)
    for zone in picture.zones:
        cells, where = picture.zone_cells(zone)
        colour[where][cells, :3] = to_rgb(certainty_colour(zone, picture.parameters))
    colour[..., :3] *= (0.75 + 0.25 * picture.shade)[..., None]
    _show(axes, picture, colour, picture.state == UNKNOWN)
    own = picture.parameters
    patches = [
        (CERTAIN, f"certain zone (≥ {own.confidence_factor:g})"),
        (LESS_CERTAIN, "less certain zone"),
        (UNCERTAIN, f"uncertain zone (< {own.uncertain_below:g})"),
        (SAFE_ELSEWHERE, "safe, but too small to land in"),
        ("#8c8c8c", "unsafe"),
        (NO_DATA, "unknown"),
    ]
    axes.figure.legend(
        handles=[Patch(facecolor=face, edgecolor="#444444", label=label) for face, label in patches],
        loc="outside lower center",
        ncols=6,
        fontsize=8,
        frameon=False,
        handlelength=1.4,
        columnspacing=1.4,
    )


def certainty_colour(zone: Zone, parameters: Parameters) -> str:
    """Return the colour of a zone by its certainty."""
    if zone.certainty >= parameters.confidence_factor:
        return CERTAIN
    return LESS_CERTAIN if zone.certainty >= parameters.uncertain_below else UNCERTAIN


def _show(axes: Axes, picture: Picture, colour: NDArray[Any], unknown: NDArray[np.bool_]) -> None:
    from matplotlib.colors import to_rgba

    colour[unknown] = to_rgba(NO_DATA)
    axes.imshow(colour, origin="lower", extent=picture.bounds, interpolation="nearest")


def _outline(axes: Axes, picture: Picture, colour: str) -> None:
    """Draw the edges of all zones."""
    mask = np.pad(picture.all_zones(), 1)
    if not mask.any():
        return
    west, _, south, _ = picture.bounds
    rows, cols = mask.shape
    x = west + (np.arange(cols) - 0.5) * picture.cell_m
    y = south + (np.arange(rows) - 0.5) * picture.cell_m
    axes.contour(x, y, mask.astype(np.float32), [0.5], colors=colour, linewidths=0.9)


def draw_numbers(axes: Axes, picture: Picture, marks: Marks) -> None:
    """Write the ID of every zone at its landing point, or beside a mark that would cover it.

    Only the `MOST_LABELS` largest zones are numbered, and none whose number would cover that of a better one.
    """
    from matplotlib.patheffects import withStroke

    points = (marks.take_off_enu_m, marks.chosen_enu_m, marks.touchdown_enu_m)
    covering = [point for point in points if point is not None]
    halo = [withStroke(linewidth=2.5, foreground="black")]
    largest = {zone.id for zone in sorted(picture.zones, key=lambda zone: -zone.area_m2)[:MOST_LABELS]}
    west, _, south, _ = picture.bounds
    pt_per_m = np.divide(MAP_PT, picture.extent_m).min()
    taken: list[NDArray[np.float64]] = []  # west, south, east, north of numbers, points
    for zone in (zone for zone in picture.zones if zone.id in largest):
        share = math.sqrt(zone.area_m2 / (picture.extent_m[0] * picture.extent_m[1]))
        point = zone.best.enu_m[:2].astype(float)
        beside = any(np.hypot(*(mark[:2] - point)) < COVERED * max(picture.extent_m) for mark in covering)
        size = min(15.0, max(7.5, 40 * share))
        place = (point - (west, south)) * pt_per_m + (BESIDE_PT if beside else 0)
        half = np.array([DIGIT_EM * len(str(zone.id)), 1.0]) * size / 2
        low, high = (place, place + 2 * half) if beside else (place - half, place + half)
        if any((low < other[2:]).all() and (other[:2] < high).all() for other in taken):
            continue
        taken.append(np.concatenate([low, high]))
        axes.annotate(
            str(zone.id),
            (point[0], point[1]),
            xytext=BESIDE_PT if beside else (0, 0),
            textcoords="offset points",
            color="white",
            fontsize=size,
            fontweight="bold",
            ha="left" if beside else "center",
            va="bottom" if beside else "center",
            path_effects=halo,
            zorder=8,
        )


def _colour_bar(axes: Axes, shades: Any, norm: Any, label: str) -> Any:
    from matplotlib.cm import ScalarMappable

    place = axes.inset_axes((1.012, 0.0, 0.018, 1.0))
    bar = axes.figure.colorbar(ScalarMappable(norm, shades), cax=place)
    bar.set_label(label, fontsize=9)
    place.tick_params(labelsize=8)
    return bar
