"""Obstacles around a landing point in three scenarios (SLZ thesis, Section 4.4.5, Figures 4-16 to 4-19)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from companion.desk.figures.layer_figures import draw_surface
from companion.desk.figures.picture import Marks, Picture, draw_frame, draw_marks
from companion.desk.reproduce.places import ABOVE_DEG, BELOW_DEG, ObservedPoint, Place, watch
from companion.desk.reproduce.reproduction_page import Pictures, Section, Table
from companion.desk.reproduce.scenarios import MODES
from companion.desk.reproduce.survey_recording import fly
from slz import Obstacle, TerrainMaps

TEXT = (
    "Figures 4-16 to 4-19 of the SLZ thesis: a landing point on an open plain, between two buildings and "
    "inside a stadium. Edges: west to east, south to north, in metres from the point; heights over the "
    "ground at the point. True ones are those of the exact world. Obstacles that touch are one, as high as "
    "the highest. Source mode has cells of 1 m (in the stadium 0.5 m), a mean height for each, and writes no "
    "slope of 40° or more: it hides parapets and loses the outermost cells of roofs."
)
COLUMNS = ("scenario, mode", "obstacle", "edges found", "edges true", "height found", "height true")
HORIZON_TEXT = (
    "Elevation of the horizon in 36 sectors against the exact world, within the distance around the point in "
    f"which obstacles are listed. Too low: by more than {BELOW_DEG:g}°, an obstacle is missing. Too high: by "
    f"more than {ABOVE_DEG:g}°. Noise of the ground at the footprint's edge, 1 m away, shows as up to 6°. "
    "Phantoms: obstacles listed where nothing stands."
)
HORIZON_COLUMNS = (
    "scenario, mode",
    "state",
    "obstacles",
    "phantoms",
    "horizon, median error °",
    "sectors too low",
    "sectors too high",
)


def section(places: Sequence[Place], out: Path, surveys: Path, progress: Callable[[str], None]) -> Section:
    """Select the point of every place in both modes, and compare its obstacles and horizon with the truth."""
    rows: list[tuple[str, ...]] = []
    horizons: list[tuple[str, ...]] = []
    pictures: list[Pictures] = []
    figures: dict[str, Any] = {}
    for place in places:
        recording = fly(place.survey, surveys)
        for mode in MODES:
            name = f"{place.name}, {mode} mode"
            progress(name)
            watched = watch(place, mode, surveys, recording)
            rows += _rows(name, watched)
            horizons.append(_horizon_row(name, watched))
            figures[name] = _figures(watched)
            folder = out / place.case(mode).folder
            pictures.append((f"{name}: what stands around the landing point", _draw(watched, folder)))
    tables = [
        Table("Obstacles around landing points", TEXT, COLUMNS, rows),
        Table("Horizon of landing points", HORIZON_TEXT, HORIZON_COLUMNS, horizons),
    ]
    return Section(tables, pictures, {"landing_points": figures})


def _rows(name: str, watched: ObservedPoint) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (
            name,
            pair.true.where,
            "not found" if pair.found is None else _edges(pair.found[0], watched),
            _edges(pair.true.extent_m, watched),
            "" if pair.found is None else f"{pair.found[1]:.2f}",
            f"{pair.true.height_m:.2f}",
        )
        for pair in watched.pairs
    ]
    return rows or [(name, "none", "", "", "", "")]


def _edges(extent_m: tuple[float, float, float, float], watched: ObservedPoint) -> str:
    east, north = watched.place.east_north_m
    west_m, south_m, east_m, north_m = extent_m
    across = f"{west_m - east:.1f} to {east_m - east:.1f}"
    return f"{across}, {south_m - north:.1f} to {north_m - north:.1f}"


def _horizon_row(name: str, watched: ObservedPoint) -> tuple[str, ...]:
    return (
        name,
        watched.selected.state.value,
        f"{len(watched.surroundings.obstacles)}",
        f"{watched.phantoms}",
        f"{watched.horizon_error_deg:.2f}",
        f"{watched.too_low}",
        f"{watched.too_high}",
    )


def _figures(watched: ObservedPoint) -> dict[str, Any]:
    found = [pair for pair in watched.pairs if pair.found is not None]
    return {
        "state": watched.selected.state.value,
        "obstacles": len(watched.surroundings.obstacles),
        "phantoms": watched.phantoms,
        "missed": len(watched.pairs) - len(found),
        "worst_edge_m": round(max((pair.edge_error_m for pair in found), default=0.0), 2),
        "worst_height_m": round(max((abs(pair.height_error_m) for pair in found), default=0.0), 2),
        "horizon_error_deg": round(watched.horizon_error_deg, 2),
        "too_low": watched.too_low,
        "too_high": watched.too_high,
    }


def _draw(watched: ObservedPoint, folder: Path) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / "around.png", folder / "horizon.png"]
    _draw_map(watched, files[0])
    _draw_horizon(watched, files[1])
    return files


def _draw_map(watched: ObservedPoint, file: Path) -> None:
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Rectangle
    from matplotlib.patheffects import withStroke

    picture = Picture(watched.maps, (), watched.parameters)
    figure = Figure(figsize=(8.0, 8.0), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    draw_surface(axes, picture)
    halo = [withStroke(linewidth=2.5, foreground="white")]
    for obstacle in watched.surroundings.obstacles:
        west, south, east, north = obstacle.extent_m
        axes.add_patch(
            Rectangle(
                (west, south), east - west, north - south, fill=False, edgecolor="#d7301f", linewidth=1.6
            )
        )
        if obstacle.width_m > 1.5:
            axes.annotate(
                f"{obstacle.height_m:.1f} m",
                _middle(obstacle, watched.maps),
                color="#7f0000",
                fontsize=9,
                fontweight="bold",
                ha="center",
                va="center",
                path_effects=halo,
                zorder=8,
            )
    point = watched.selected.enu_m
    radius = watched.surroundings.radius_m
    axes.add_patch(
        Circle((float(point[0]), float(point[1])), radius, fill=False, edgecolor="#444444", linestyle="--")
    )
    marks = Marks(chosen_enu_m=point)
    draw_marks(axes, marks)
    draw_frame(axes, picture, f"Obstacles within {radius:g} m, height over the ground")
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)


def _middle(obstacle: Obstacle, maps: TerrainMaps) -> tuple[float, float]:
    """Return the middle of an obstacle's box if the ground there is high, else its highest place."""
    west, south, east, north = obstacle.extent_m
    middle = (west + east) / 2, (south + north) / 2
    row, col = maps.grid.index(*middle)
    row, col = row - maps.box.row0, col - maps.box.col0
    held = 0 <= row < maps.height_m.shape[0] and 0 <= col < maps.height_m.shape[1]
    high = held and maps.height_m[row, col] > obstacle.top_m - 0.75 * obstacle.height_m
    return middle if high else (obstacle.east_m, obstacle.north_m)


def _draw_horizon(watched: ObservedPoint, file: Path) -> None:
    from matplotlib.figure import Figure

    found, true = watched.surroundings.horizon_deg, watched.true_horizon_deg()
    figure = Figure(figsize=(8.0, 8.0), dpi=130, layout="constrained")
    axes: Any = figure.add_subplot(projection="polar")
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    width = 2 * np.pi / len(found)
    middles = np.arange(len(found)) * width
    heights = np.nan_to_num(found, nan=0.0).clip(min=0.0)
    axes.bar(
        middles, heights, width=width, color="#fdae6b", edgecolor="#e6550d", linewidth=0.6, label="found"
    )
    edges = np.append(middles, 2 * np.pi) - width / 2
    steps = np.repeat(np.nan_to_num(true, nan=0.0).clip(min=0.0), 2)
    axes.plot(np.repeat(edges, 2)[1:-1], steps, color="#08519c", linewidth=1.8, label="true")
    axes.set_thetagrids(
        np.arange(0, 360, 45), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"], fontsize=10, fontweight="bold"
    )
    top = max(20.0, 1.1 * float(np.nanmax([found, true])))
    axes.set_ylim(0.0, top)
    step = 5 if top <= 30 else 10
    axes.set_yticks(np.arange(step, top, step), [f"{tick:g}°" for tick in np.arange(step, top, step)])
    axes.tick_params(labelsize=9)
    axes.set_title("Horizon seen from the landing point", loc="left", fontsize=13, fontweight="bold")
    axes.legend(loc="lower right", bbox_to_anchor=(1.05, -0.05), fontsize=9, frameon=False)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)
