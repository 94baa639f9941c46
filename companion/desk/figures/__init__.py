"""Pictures of maps and flights, as PNG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from companion.desk.figures.layer_figures import draw_numbers, draw_ramp, draw_safe, draw_surface
from companion.desk.figures.picture import NO_MARKS, Marks, Picture, draw_frame, draw_marks
from companion.flight.landing.situation import Phase
from params import Parameters
from slz import TerrainMaps, Zone
from slz.terrain.layers import Output, reaching

if TYPE_CHECKING:
    from companion.flight.app import Companion

__all__ = ["Marks", "draw_flight", "save_flight", "save_maps", "save_terrain"]

Floats = NDArray[np.float64]
RAMPS = {layer.file: layer for layer in reaching(Output.PICTURE) if not layer.is_height}


def save_terrain(
    path: Path,
    maps: TerrainMaps,
    name: str,
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
    name
        `dsm`: shaded height. `safe`: zones by certainty over shaded ground. Or the file of a layer that
        reaches pictures, see `slz.terrain.layers`, such as `slope`: blue below the safe limit and orange
        above.
    zones
        Best first; the largest are numbered.
    parameters
        Thresholds of certainty and slope; defaults where None.
    """
    _save(path, Picture(maps, tuple(zones), parameters or Parameters()), name, title, marks)


def save_maps(
    folder: Path,
    maps: TerrainMaps,
    zones: Iterable[Zone] = (),
    parameters: Parameters | None = None,
    marks: Marks = NO_MARKS,
) -> list[Path]:
    """Write dsm.png, slope.png and all others into a folder, safe.png last, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    own = parameters or Parameters()
    picture = Picture(maps, tuple(zones), own)
    ramps = {name: layer.title for name, layer in RAMPS.items() if layer.unit_in(own.mode)}
    paths = []
    for name, title in {"dsm": "Surface", **ramps, "safe": "Safe landing zones"}.items():
        paths.append(folder / f"{name}.png")
        _save(paths[-1], picture, name, title, marks)
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
    """Write the pictures of a flight, see `save_maps`, and return their paths.

    path_enu_m: (n, 3), from the take-off. The points are (3,). All in the map frame; None is not drawn.
    """
    path = path_enu_m if path_enu_m is not None and len(path_enu_m) else None
    marks = Marks(path, None if path is None else path[0], chosen_enu_m, touchdown_enu_m)
    return save_maps(out_dir, maps, zones, parameters, marks)


def _save(path: Path, picture: Picture, name: str, title: str, marks: Marks) -> None:
    from matplotlib.figure import Figure  # not pyplot: no global state, any thread

    width, height = picture.extent_m
    tall = min(max(8.6 * height / width, 3.0), 12.0) + 1.6
    figure = Figure(figsize=(10.0, tall), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    if name in RAMPS:
        draw_ramp(axes, picture, RAMPS[name])
    else:
        {"dsm": draw_surface, "safe": draw_safe}[name](axes, picture)
        draw_numbers(axes, picture, marks)
    draw_marks(axes, marks)
    draw_frame(axes, picture, title)
    figure.savefig(path, bbox_inches="tight", pad_inches=0.15)


def draw_flight(companion: Companion, out: Path) -> dict[str, str]:
    """Draw a flight's maps into a folder; return the files by name."""
    maps = companion.maps
    if maps is None:
        return {}
    zones = companion.mapping.latest.newest.zones if companion.mapping.latest.newest else ()
    chosen = companion.executive.tally.chosen_enu_m
    path = companion.deciding.path.enu_m.array()
    landed = companion.executive.phase is Phase.LANDED
    touchdown = path[-1] if landed and len(path) else None
    files = save_flight(out, maps, zones, path, chosen, touchdown, companion.parameters)
    return {file.stem: str(file) for file in files}
