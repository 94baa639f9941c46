"""Near and far mode in one flight, window by window (SLZ thesis, Section 4.4.4, Figure 4-14)."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.figures.picture import Picture, draw_frame
from companion.desk.reproduce.reproduction_page import Pictures, Section, Table
from companion.desk.reproduce.scenarios import MODES
from companion.desk.reproduce.source_scenes import Case, pipeline_for
from companion.desk.reproduce.survey_recording import SurveyFlight, fly
from params import Parameters
from slz import Box, Grid, Report, TerrainMaps, Zone, zone_mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AROUND_M = 30.0
NEAR, FAR = "#1b7837", "#2166ac"
TEXT = (
    "Figure 4-14 of the SLZ thesis: zones of the near and of the far map after a flight that climbs. Far "
    "mode begins at 40 m over ground or 12 m/s, and ends below nine tenths of both. In default mode both "
    "maps are fed throughout, the far one reaches farther, and its cells and the length of the windows to "
    "come follow density, height and speed (windows here last 1 s all the same). By the source's rules only "
    "the map of the present mode is fed, with cells of 1 m or 10 m, and far slopes are those over 20 m."
)
COLUMNS = (
    "scene, mode",
    "chosen",
    "windows",
    "height, m",
    "returns per m²",
    "far cells, m",
    "window length, s",
    "near zones at the end",
    "far zones at the end",
)


@dataclass(frozen=True, slots=True)
class Climb:
    """A flight that climbs over a scene, and the settings of each mode."""

    name: str
    survey: SurveyFlight
    default: tuple[str, ...] = ("cell_m=0.5",)
    source: tuple[str, ...] = ("cell_m=1", "far_cell_m=10")

    def case(self, mode: str) -> Case:
        own = self.source if mode == "source" else self.default
        return Case(f"{self.name}, {mode} mode", self.survey, 1.0, settings=(f"mode={mode}", *own))


def _climb(scene: str, height_m: float) -> SurveyFlight:
    return SurveyFlight(
        scene,
        (-80.0, -80.0, 80.0, 80.0),
        height_m=height_m,
        spacing_m=27.0,
        speed_ms=11.0,
        point_rate_hz=50_000,
        cell_m=1.0,
        footprint_m=3.0,
        climb_m=40.0,
    )


CLIMBS = (
    Climb("climb over dense buildings", _climb("dense", 12.0)),
    Climb("climb over the plain", _climb("plain", 15.0)),
)


@dataclass(frozen=True, slots=True)
class Flown:
    """Reports of a flight, window by window, and both maps at its end."""

    reports: tuple[Report, ...]
    path_enu_m: NDArray[np.float64]
    near: TerrainMaps
    far: TerrainMaps
    parameters: Parameters


def section(climbs: Sequence[Climb], out: Path, surveys: Path, progress: Callable[[str], None]) -> Section:
    """Fly every climb in both modes, list the chosen modes, and draw both maps' zones as one picture."""
    rows: list[tuple[str, ...]] = []
    pictures: list[Pictures] = []
    figures: dict[str, Any] = {}
    for climb in climbs:
        for mode in MODES:
            case = climb.case(mode)
            progress(case.name)
            flown = _run(case, surveys)
            rows += _rows(case.name, flown.reports)
            folder = out / case.folder
            folder.mkdir(parents=True, exist_ok=True)
            files = [folder / "near_and_far.png", folder / "choice.png"]
            _draw_map(flown, files[0])
            _draw_choice(flown, files[1])
            pictures.append((f"{case.name}: near and far zones, and what was chosen", files))
            last = flown.reports[-1]
            figures[case.name] = {
                "windows_far": sum(report.choice.far for report in flown.reports),
                "windows": len(flown.reports),
                "changes": _changes(flown.reports),
                "near_zones": len(last.near.zones),
                "far_zones": len(last.far.zones),
            }
    return Section([Table("Near and far", TEXT, COLUMNS, rows)], pictures, {"near_and_far": figures})


def _run(case: Case, surveys: Path) -> Flown:
    recording = fly(case.survey, surveys)
    pipeline, parameters = pipeline_for(case)
    reports, path = [], []
    for window in recording.windows():
        reports.append(pipeline.process(window))
        path.append(window.sensor_enu_m)
    flown, near, far = np.array(path), None, None
    if reports:
        near = pipeline.maps(_about(flown, reports[-1].near.grid), "near")
        far = pipeline.maps(_about(flown, reports[-1].far.grid), "far")
    if near is None or far is None:
        raise RuntimeError(f"{case.name}: nothing was seen")
    return Flown(tuple(reports), flown, near, far, parameters)


def _about(path_enu_m: NDArray[np.float64], grid: Grid) -> Box:
    """Return the cells of a grid within a box around a path."""
    west, south = (path_enu_m[:, :2].min(axis=0) - AROUND_M).tolist()
    east, north = (path_enu_m[:, :2].max(axis=0) + AROUND_M).tolist()
    (row0, col0), (row1, col1) = grid.index(west, south), grid.index(east, north)
    return Box(row0, row1 + 1, col0, col1 + 1).grown(0, grid)


def _changes(reports: Sequence[Report]) -> int:
    """Return the number of changes between near and far mode."""
    far = [report.choice.far for report in reports]
    return sum(a != b for a, b in itertools.pairwise(far))


def _rows(name: str, reports: Sequence[Report]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for far in (False, True):
        some = [report for report in reports if report.choice.far == far]
        if not some:
            continue
        cells = sorted({report.far.grid.cell_m for report in some})
        rows.append(
            (
                name,
                "far" if far else "near",
                f"{len(some)}",
                _span([report.choice.height_m for report in some], 0),
                _span([report.choice.density_per_m2 for report in some], 1),
                ", ".join(f"{cell:g}" for cell in cells),
                _span([report.choice.window_s for report in some], 2),
                f"{len(reports[-1].near.zones)}",
                f"{len(reports[-1].far.zones)}",
            )
        )
    return rows


def _span(values: Sequence[float], digits: int) -> str:
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return low if low == high else f"{low} to {high}"


def _draw_map(flown: Flown, file: Path) -> None:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    whole = flown.near if flown.parameters.mode == "source" else flown.far  # the one that reaches farther
    picture = Picture(whole, (), flown.parameters)
    figure = Figure(figsize=(9.0, 9.5), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    grey = np.where(np.isnan(picture.height_m), 1.0, 0.3 + 0.5 * picture.shade)
    axes.imshow(grey, origin="lower", extent=picture.bounds, cmap="gray", vmin=0.0, vmax=1.0)
    last = flown.reports[-1]
    _draw_zones(axes, last.far.zones, flown.far, FAR, 0.35)
    _draw_zones(axes, last.near.zones, flown.near, NEAR, 0.55)
    far = np.array([report.choice.far for report in flown.reports])
    east, north = flown.path_enu_m[:, 0], flown.path_enu_m[:, 1]
    axes.scatter(east[~far], north[~far], s=9, color="#fee08b", edgecolors="black", linewidths=0.4, zorder=6)
    axes.scatter(east[far], north[far], s=9, color="#e7298a", edgecolors="black", linewidths=0.4, zorder=6)
    draw_frame(axes, picture, "Zones of the near and of the far map")
    cell = flown.reports[-1].far.grid.cell_m
    point = {"marker": "o", "linestyle": "", "markeredgecolor": "black", "markersize": 5}
    handles: list[Any] = [
        Patch(facecolor=NEAR, alpha=0.55, label=f"near zones, cells of {flown.near.grid.cell_m:g} m"),
        Patch(facecolor=FAR, alpha=0.35, label=f"far zones, cells of {cell:g} m"),
        Line2D([], [], color="#fee08b", label="vehicle, near mode", **point),  # type: ignore[arg-type]
        Line2D([], [], color="#e7298a", label="vehicle, far mode", **point),  # type: ignore[arg-type]
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)


def _draw_zones(axes: Axes, zones: tuple[Zone, ...], maps: TerrainMaps, colour: str, alpha: float) -> None:
    from matplotlib.colors import to_rgba

    mask = zone_mask(zones, maps.box)
    if not mask.any():
        return
    cell = maps.grid.cell_m
    rows, cols = mask.shape
    bounds = maps.west_m, maps.west_m + cols * cell, maps.south_m, maps.south_m + rows * cell
    layer = np.zeros((rows, cols, 4))
    layer[mask] = to_rgba(colour, alpha)
    axes.imshow(layer, origin="lower", extent=bounds, interpolation="nearest")
    fine = max(1, min(10, 2000 // max(rows, cols)))  # so that the contour of large cells keeps their corners
    padded = np.pad(mask.repeat(fine, axis=0).repeat(fine, axis=1), 1).astype(np.float32)
    x = maps.west_m + (np.arange(fine * cols + 2) - 0.5) * cell / fine
    y = maps.south_m + (np.arange(fine * rows + 2) - 0.5) * cell / fine
    axes.contour(x, y, padded, [0.5], colors=colour, linewidths=1.4)


def _draw_choice(flown: Flown, file: Path) -> None:
    from matplotlib.figure import Figure

    choices = [report.choice for report in flown.reports]
    windows = np.arange(1, len(choices) + 1)
    far = np.array([choice.far for choice in choices])
    figure = Figure(figsize=(9.0, 9.5), dpi=130, layout="constrained")
    drawn = figure.subplots(4, 1, sharex=True, squeeze=False)[:, 0]
    series: tuple[tuple[str, list[float]], ...] = (
        ("height over ground, m", [choice.height_m for choice in choices]),
        ("returns per m²", [choice.density_per_m2 for choice in choices]),
        ("far cells, m", [report.far.grid.cell_m for report in flown.reports]),
        ("window length chosen, s", [choice.window_s for choice in choices]),
    )
    for axes, (label, values) in zip(drawn, series, strict=True):
        axes.fill_between(
            windows, 0, 1, where=far, step="mid", transform=axes.get_xaxis_transform(), color=FAR, alpha=0.15
        )
        axes.step(windows, values, where="mid", color="#333333", linewidth=1.3)
        axes.set_ylim(0.0, 1.15 * max(values))
        axes.set_ylabel(label, fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3, linewidth=0.5)
    drawn[0].axhline(flown.parameters.far_height_m, color="#d7301f", linestyle="--", linewidth=1.0)
    drawn[0].set_title("Chosen window by window; blue: far mode", loc="left", fontsize=13, fontweight="bold")
    drawn[-1].set_xlabel("window", fontsize=9)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)
