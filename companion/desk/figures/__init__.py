"""Pictures of maps and flights, as PNG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from companion.desk.figures.layer_figures import draw_numbers, draw_safe, draw_slope, draw_surface
from companion.desk.figures.map_furniture import NO_MARKS, Marks, draw_frame, draw_marks
from companion.desk.figures.picture import Picture
from params import Parameters
from slz import TerrainMaps, Zone

__all__ = ["LAYERS", "Layer", "Marks", "save_flight", "save_maps", "save_terrain"]

Layer = Literal["dsm", "slope", "safe"]
Floats = NDArray[np.float64]
LAYERS: dict[Layer, str] = {"dsm": "Surface", "slope": "Slope", "safe": "Safe landing zones"}


def save_terrain(
    path: Path,
    maps: TerrainMaps,
    layer: Layer,
    title: str,
    zones: Iterable[Zone] = (),
    *,
    parameters: Parameters | None = None,
    marks: Marks = NO_MARKS,
) -> None:
    """Draw one map with its zones.

    Parameters
    ----------
    path
        PNG file to write.
    layer
        `dsm`: shaded height. `slope`: degrees, blue below the safe limit and orange above. `safe`: zones by
        certainty over shaded ground.
    zones
        Best first; the largest are numbered.
    parameters
        Thresholds of certainty and slope; defaults where None.
    """
    _save(path, Picture(maps, tuple(zones), parameters or Parameters()), layer, title, marks)


def save_maps(
    folder: Path,
    maps: TerrainMaps,
    zones: Iterable[Zone] = (),
    parameters: Parameters | None = None,
    marks: Marks = NO_MARKS,
) -> list[Path]:
    """Write dsm.png, slope.png and safe.png into a folder and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    picture = Picture(maps, tuple(zones), parameters or Parameters())
    paths = []
    for layer, title in LAYERS.items():
        paths.append(folder / f"{layer}.png")
        _save(paths[-1], picture, layer, title, marks)
    return paths


def save_flight(
    out_dir: Path,
    maps: TerrainMaps,
    zones: Iterable[Zone],
    path_enu_m: Floats | None,
    chosen_enu_m: Floats | None,
    touchdown_enu_m: Floats | None,
    parameters: Parameters | None = None,
) -> list[Path]:
    """Write dsm.png, slope.png and safe.png of a flight and return their paths.

    path_enu_m: (n, 3), from the take-off. The points are (3,). All in the map frame; None is not drawn.
    """
    path = path_enu_m if path_enu_m is not None and len(path_enu_m) else None
    marks = Marks(path, None if path is None else path[0], chosen_enu_m, touchdown_enu_m)
    return save_maps(out_dir, maps, zones, parameters, marks)


def _save(path: Path, picture: Picture, layer: Layer, title: str, marks: Marks) -> None:
    from matplotlib.figure import Figure  # not pyplot: no global state, any thread

    width, height = picture.extent_m
    tall = min(max(8.6 * height / width, 3.0), 12.0) + 1.6
    figure = Figure(figsize=(10.0, tall), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    {"dsm": draw_surface, "slope": draw_slope, "safe": draw_safe}[layer](axes, picture)
    if layer != "slope":
        draw_numbers(axes, picture, marks)
    draw_marks(axes, marks)
    draw_frame(axes, picture, title)
    figure.savefig(path, bbox_inches="tight", pad_inches=0.15)
