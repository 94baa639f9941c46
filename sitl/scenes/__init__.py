"""Scenes by name."""

from __future__ import annotations

from sitl.scenes import (
    buildings,
    hills,
    landing_sites,
    open_ground,
    power_lines,
    stadium,
    streets,
    vegetation,
    water_scenes,
)
from sitl.scenes.scene import Polygon, Scene

__all__ = ["NAMES", "Polygon", "Scene", "build"]

_BUILDERS = {
    "stadium": stadium.build,
    "plain": open_ground.build_plain,
    "hill": hills.build_hill,
    "streets": streets.build,
    "mountains": hills.build_mountains,
    "dense": buildings.build_dense,
    "buildings": buildings.build_buildings,
    "borrow_pit": hills.build_borrow_pit,
    "landing_site": landing_sites.build_landing_site,
    "dust_out": open_ground.build_dust_out,
    "lakes": water_scenes.build_lakes,
    "ponds": water_scenes.build_ponds,
    "river": water_scenes.build_river,
    "flooded_field": water_scenes.build_flooded_field,
    "car_park_wet": landing_sites.build_wet,
    "car_park_dry": landing_sites.build_dry,
    "flat_roofs": buildings.build_flat_roofs,
    "maize": vegetation.build_maize,
    "snowfield": open_ground.build_snowfield,
    "power_line": power_lines.build_power_line,
    "swaying_trees": vegetation.build_swaying_trees,
    "corridor": buildings.build_corridor,
    "wall": buildings.build_wall,
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
