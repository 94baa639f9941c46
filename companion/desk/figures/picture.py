"""Maps at screen resolution with hillshade."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from params import Parameters
from slz import TerrainMaps, Zone, zone_mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
PATH, CHOSEN, TAKE_OFF, TOUCHDOWN = "#2166ac", "#ffd92f", "#ffffff", "#e7298a"

MOST_PIXELS = 2400  # on a side; larger maps are subsampled before drawing
FILL_CELLS = 2  # gaps up to this distance from a return take its height, in pictures only
FLAT = 0.7  # light on flat ground


@dataclass(frozen=True, slots=True)
class Marks:
    """Marks drawn over a map: points (3,) and a path (n, 3) in the map frame."""

    path_enu_m: Floats | None = None
    take_off_enu_m: Floats | None = None
    chosen_enu_m: Floats | None = None
    touchdown_enu_m: Floats | None = None


NO_MARKS = Marks()


class Picture:
    """Maps subsampled to screen resolution, with the values that all pictures share."""

    def __init__(self, maps: TerrainMaps, zones: tuple[Zone, ...], parameters: Parameters) -> None:
        self.maps, self.zones, self.parameters = maps, zones, parameters
        rows, cols = maps.box.shape
        step = self.step = max(1, math.ceil(max(rows, cols) / MOST_PIXELS))
        self.cell_m = maps.grid.cell_m * step
        rows, cols = math.ceil(rows / step), math.ceil(cols / step)
        self.extent_m = cols * self.cell_m, rows * self.cell_m
        west, south = maps.west_m, maps.south_m
        self.bounds = west, west + self.extent_m[0], south, south + self.extent_m[1]
        self.state = maps.state[::step, ::step]
        self.height_m = filled(maps.height_m[::step, ::step])
        self.shade = shade(self.height_m, self.cell_m)

    def zone_cells(self, zone: Zone) -> tuple[NDArray[np.bool_], tuple[slice, slice]]:
        """Return the subsampled cells of a zone, cropped, and their slices in the picture."""
        whole = zone_mask((zone,), self.maps.box)[:: self.step, :: self.step]
        rows, cols = np.flatnonzero(whole.any(axis=1)), np.flatnonzero(whole.any(axis=0))
        if not len(rows):
            return whole[:0, :0], (slice(0, 0), slice(0, 0))
        where = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(cols[0]), int(cols[-1]) + 1)
        return whole[where], where

    def all_zones(self) -> NDArray[np.bool_]:
        mask = np.zeros(self.state.shape, bool)
        for zone in self.zones:
            cells, where = self.zone_cells(zone)
            mask[where] |= cells
        return mask


def filled(height_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return heights with small gaps filled from the nearest cell, for display."""
    unknown = np.isnan(height_m)
    if unknown.all() or not unknown.any():
        return height_m
    distance, where = ndimage.distance_transform_edt(unknown, return_indices=True)
    filled: NDArray[np.float32] = height_m[tuple(where)]
    filled[distance > FILL_CELLS] = np.nan
    return filled


def shade(height_m: NDArray[np.float32], cell_m: float) -> NDArray[np.float64]:
    """Return the hillshade, light from the north-west at 45 degrees, 0 to 1; flat and unknown ground: 0.7."""
    level = np.nanmedian(height_m) if np.isfinite(height_m).any() else 0.0
    known = np.where(np.isnan(height_m), level, height_m)
    if min(known.shape) < 2:
        return np.full(known.shape, FLAT)
    north, east = np.gradient(known.astype(np.float64), cell_m)
    light = (1 + (east - north) / math.sqrt(2)) / np.sqrt(2 * (1 + east**2 + north**2))
    shade = np.clip(light, 0, 1)
    return np.where(np.isnan(height_m), FLAT, shade)


def draw_marks(axes: Axes, marks: Marks) -> None:
    if marks.path_enu_m is not None:
        path = marks.path_enu_m
        axes.plot(path[:, 0], path[:, 1], color="white", linewidth=3.2, alpha=0.8, zorder=4)
        axes.plot(path[:, 0], path[:, 1], color=PATH, linewidth=1.6, label="flown path", zorder=5)
    for point, marker, size, colour, label in (
        (marks.take_off_enu_m, "^", 80, TAKE_OFF, "take-off"),
        (marks.chosen_enu_m, "*", 420, CHOSEN, "chosen point"),
        (marks.touchdown_enu_m, "X", 45, TOUCHDOWN, "touchdown"),
    ):
        if point is not None:
            axes.scatter(
                [point[0]],
                [point[1]],
                s=size,
                c=colour,
                marker=marker,
                edgecolors="black",
                linewidths=1.0,
                label=label,
                zorder=7,
            )


def draw_frame(axes: Axes, picture: Picture, title: str) -> None:
    west, east, south, north = picture.bounds
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_aspect("equal")
    axes.set_title(title, loc="left", fontsize=13, fontweight="bold")
    axes.set_xlabel("east, m", fontsize=9)
    axes.set_ylabel("north, m", fontsize=9)
    axes.tick_params(labelsize=8)
    _scale_bar(axes, picture)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=4,
            fontsize=8,
            frameon=False,
            markerscale=0.7,
            columnspacing=1.4,
        )


def _scale_bar(axes: Axes, picture: Picture) -> None:
    """Draw a bar of a round length, at most a sixth of the width, in the lower left corner."""
    width = picture.extent_m[0]
    power = 10.0 ** math.floor(math.log10(width / 6))
    length = max(f * power for f in (1, 2, 5) if f * power <= width / 6)
    transform = axes.transAxes
    left, bottom = 0.02, 0.03
    end = left + length / width
    axes.plot([left, end], [bottom, bottom], color="white", linewidth=5, transform=transform, zorder=8)
    axes.plot([left, end], [bottom, bottom], color="black", linewidth=2.5, transform=transform, zorder=8)
    axes.text(
        (left + end) / 2,
        bottom + 0.012,
        f"{length:g} m",
        transform=transform,
        ha="center",
        va="bottom",
        fontsize=8,
        zorder=8,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1.0},
    )
