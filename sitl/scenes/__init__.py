"""Scenes by name."""

from __future__ import annotations

from sitl.scenes import (
    borrow_pit,
    buildings,
    car_park,
    dense,
    dust_out,
    flat_roofs,
    hill,
    landing_site,
    long_walls,
    maize,
    mountains,
    plain,
    snowfield,
    stadium,
    streets,
    swaying_trees,
)
from sitl.scenes.lines import power_line
from sitl.scenes.scene import Polygon, Scene
from sitl.scenes.water import flooded_field, lakes, ponds, river

__all__ = ["NAMES", "Polygon", "Scene", "build"]

_BUILDERS = {
    "stadium": stadium.build,
    "plain": plain.build,
    "hill": hill.build,
    "streets": streets.build,
    "mountains": mountains.build,
    "dense": dense.build,
    "buildings": buildings.build,
    "borrow_pit": borrow_pit.build,
    "landing_site": landing_site.build,
    "dust_out": dust_out.build,
    "lakes": lakes.build,
    "ponds": ponds.build,
    "river": river.build,
    "flooded_field": flooded_field.build,
    "car_park_wet": car_park.build_wet,
    "car_park_dry": car_park.build_dry,
    "flat_roofs": flat_roofs.build,
    "maize": maize.build,
    "snowfield": snowfield.build,
    "power_line": power_line.build,
    "swaying_trees": swaying_trees.build,
    "corridor": long_walls.build_corridor,
    "wall": long_walls.build_wall,
}
NAMES: tuple[str, ...] = tuple(_BUILDERS)


def build(name: str, seed: int = 0) -> Scene:
    """Build a scene; the same name and seed give an identical world.

    Raises
    ------
    ValueError
        If there is no scene of that name.
    """
    if name not in _BUILDERS:
        raise ValueError(f"scene {name!r} is unknown; choose one of {', '.join(NAMES)}")
    return _BUILDERS[name](seed)
