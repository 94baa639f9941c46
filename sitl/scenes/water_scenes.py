"""Scenes of water: a flooded field, lakes, ponds and a river."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Polygon, Scene, ellipse, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.surface_layers import MEADOW, REED
from sitl.world.water_waves import WaterState

FIELD = (-90.0, -90.0, 90.0, 90.0)
TRACK_HALF_M, TRACK_M = 6.0, 0.45
FIELD_LEVEL_M = 0.0
FIELD_WATER = WaterState(wind_ms=2.0, fetch_m=40.0, turbid=0.01)


def build_flooded_field(seed: int) -> Scene:
    """Return the field; the seed sets its relief, and so where water stands."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(120.0, 0.5, terrain_rng)
    field = terrain.rectangle(*FIELD)
    terrain.swell(0.14, 36.0)
    terrain.swell(0.03, 6.0)
    terrain.z -= 0.17
    terrain.cover(field, Kind.SOIL)
    away = np.maximum(np.abs(terrain.x), np.abs(terrain.y)) - FIELD[2]
    terrain.z += 0.8 * np.clip(away / 8.0, 0.0, 1.0)
    track = terrain.rectangle(-120.0, -TRACK_HALF_M, 120.0, TRACK_HALF_M)
    terrain.level(track, TRACK_M, 2.5)
    terrain.cover(track, Kind.SOIL)
    terrain.stand_water(terrain.rectangle(-98.0, -98.0, 98.0, 98.0), FIELD_LEVEL_M)
    solids: list[Solid] = []
    for k, x in enumerate(np.arange(-110.0, 111.0, 18.0)):
        px, py = float(x), 105.0 + rng.uniform(-6.0, 6.0)
        solids += scene_objects.tree(f"tree-{k}", px, py, terrain.at(px, py), rng.uniform(5.0, 9.0), rng)
    return Scene(
        name="flooded_field",
        seed=seed,
        world=terrain.world(solids, water=FIELD_WATER),
        home_enu=(0.0, 0.0, 0.0),
        description="Soil under a few decimetres of murky water with dry islands, a raised track across it",
        regions={
            "field_south": rectangle(FIELD[0], FIELD[1], FIELD[2], -TRACK_HALF_M - 3.0),
            "field_north": rectangle(FIELD[0], TRACK_HALF_M + 3.0, FIELD[2], FIELD[3]),
            "track": rectangle(-110.0, -TRACK_HALF_M + 0.5, 110.0, TRACK_HALF_M - 0.5),
        },
    )


LAKES = ((55.0, 10.0, 38.0, 25.0), (-75.0, -60.0, 20.0, 13.0))
"""East, north and radii of the level bottoms; the shores are about 9 m farther out."""
LAKE_LEVEL_M, BOTTOM_M, SHORE_M = -1.0, -3.5, 14.0
WIND_MS, LAKE_TURBIDITY = (1.0, 12.0), (0.0, 0.03)
"""Ranges from which a seed draws; turbidity up to that of muddy water, see ``WaterState.turbid``."""


def build_lakes(seed: int) -> Scene:
    """Return the lakes; the seed sets relief, trees, wind and turbidity."""
    terrain_rng, rng, water_rng = np.random.default_rng(seed).spawn(3)
    wind_ms, turbid = water_rng.uniform(*WIND_MS), water_rng.uniform(*LAKE_TURBIDITY)
    water = WaterState(wind_ms=float(wind_ms), fetch_m=90.0, turbid=float(turbid))
    terrain = Terrain(150.0, 0.5, terrain_rng)
    terrain.swell(0.25, 80.0)
    terrain.level(terrain.rectangle(-10.0, 0.0, 3.0, 20.0), 0.0, 10.0)
    terrain.grow(terrain.rectangle(-120.0, 20.0, -30.0, 120.0), MEADOW)
    for x, y, a, b in LAKES:
        terrain.level(terrain.ellipse(x, y, a, b), BOTTOM_M, SHORE_M)
        around = terrain.ellipse(x, y, a + SHORE_M, b + SHORE_M)
        terrain.cover(around & (terrain.z < -0.5), Kind.SAND)
        terrain.stand_water(around, LAKE_LEVEL_M)
    x, y, _, _ = LAKES[0]
    belt = (terrain.z < LAKE_LEVEL_M + 0.1) & (terrain.z > LAKE_LEVEL_M - 0.6)
    terrain.grow(belt & (np.arctan2(terrain.y - y, terrain.x - x) > 0.6) & (terrain.x > x - 30.0), REED)
    solids: list[Solid] = []
    for k in range(60):
        px, py = rng.uniform(-140.0, 140.0, 2)
        if terrain.at(px, py) > -0.6 and math.hypot(px, py - 10.0) > 25.0:
            solids += scene_objects.tree(f"tree-{k}", px, py, terrain.at(px, py), rng.uniform(4.0, 10.0), rng)
    return Scene(
        name="lakes",
        seed=seed,
        world=terrain.world(solids, water=water),
        home_enu=(0.0, 10.0, 0.0),
        description=f"Two lakes with sandy shores, reed, meadows and trees, in a wind of {wind_ms:.0f} m/s",
        regions={
            **{f"lake-{k}": ellipse(x, y, a + 7.0, b + 7.0) for k, (x, y, a, b) in enumerate(LAKES, 1)},
            "meadow": rectangle(-120.0, 20.0, -30.0, 120.0),
        },
    )


PONDS = (
    (-52.0, -20.0, -10.0, 20.0, -0.6, 1.6),
    (10.0, -20.0, 52.0, 20.0, -0.9, 0.9),
    (-30.0, 36.0, 30.0, 62.0, -0.4, 0.25),
)
"""West, south, east and north of each level bottom; level of its water, and greatest depth."""
POND_BANK_M = 3.0
POND_WATER = WaterState(wind_ms=0.0)


def build_ponds(seed: int) -> Scene:
    """Return the ponds; the seed sets relief and trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(100.0, 0.5, terrain_rng)
    terrain.swell(0.12, 50.0)
    terrain.level(terrain.rectangle(-5.5, -30.0, 5.5, 30.0), 0.0, 4.0)
    regions = {"dam": rectangle(-5.5, -25.0, 5.5, 25.0)}
    for k, (x0, y0, x1, y1, level, deep) in enumerate(PONDS, 1):
        terrain.level(terrain.rectangle(x0, y0, x1, y1), level - deep, POND_BANK_M)
        around = terrain.rectangle(x0 - POND_BANK_M, y0 - POND_BANK_M, x1 + POND_BANK_M, y1 + POND_BANK_M)
        terrain.cover(around & (terrain.z < level + 0.1), Kind.SOIL, 0.01)
        terrain.stand_water(around, level)
        regions[f"pond-{k}"] = rectangle(x0, y0, x1, y1)
    terrain.grow(terrain.rectangle(-52.0, 12.0, -30.0, 20.0), REED)
    solids: list[Solid] = []
    for k in range(40):
        turn, away = rng.uniform(0.0, 2 * np.pi), rng.uniform(76.0, 95.0)
        x, y = float(away * np.cos(turn)), float(away * np.sin(turn))
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 12.0), rng)
    return Scene(
        name="ponds",
        seed=seed,
        world=terrain.world(solids, water=POND_WATER),
        home_enu=(0.0, 0.0, 0.0),
        description="Three calm ponds 0.25 m to 1.6 m deep, a dam between two, reed, trees around",
        regions=regions,
    )


RIVER_LEVEL_M, BED_M, BANK_M = -1.2, -2.9, 9.0
HALF_BED_M = 9.0
BAR = (45.0, 16.0)
"""Gravel bar: east, half length."""
TURBIDITY = (0.0, 0.03)
"""Range from which a seed draws: a clear to a muddy river, see ``WaterState.turbid``."""
FALL = (0.0, 0.003)
"""Range from which a seed draws: rivers of the plains, and of the hills before them."""


def build_river(seed: int) -> Scene:
    """Return the river; the seed sets relief, trees, turbidity and fall."""
    terrain_rng, rng, water_rng = np.random.default_rng(seed).spawn(3)
    turbid, fall = (float(water_rng.uniform(*drawn)) for drawn in (TURBIDITY, FALL))
    water = WaterState(wind_ms=8.0, fetch_m=600.0, towards_rad=0.2, turbid=turbid)
    terrain = Terrain(150.0, 0.5, terrain_rng)
    terrain.swell(0.3, 70.0)
    terrain.level(terrain.rectangle(-8.0, -6.0, 8.0, 10.0), 0.0, 10.0)
    terrain.grow(terrain.rectangle(-140.0, 20.0, 140.0, 120.0), MEADOW)
    off = np.abs(terrain.y - _middle(terrain.x))
    terrain.level(off < HALF_BED_M, BED_M, BANK_M)
    terrain.cover(off < HALF_BED_M + 5.0, Kind.GRAVEL)
    along = np.clip(1.0 - ((terrain.x - BAR[0]) / BAR[1]) ** 2, 0.0, 1.0)
    across = np.clip(1.0 - ((terrain.y - _middle(terrain.x) - 7.0) / 6.0) ** 2, 0.0, 1.0)
    terrain.z += (RIVER_LEVEL_M - BED_M + 0.3) * along * across * (off < HALF_BED_M + 4.0)
    falling = -fall * terrain.x
    terrain.z += falling
    terrain.stand_water(off < HALF_BED_M + BANK_M, RIVER_LEVEL_M + falling)
    solids: list[Solid] = []
    for k in range(50):
        x, y = rng.uniform(-145.0, 145.0), rng.uniform(-145.0, 145.0)
        if abs(y - float(_middle(np.array(x)))) > 24.0 and np.hypot(x, y) > 25.0:
            solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 12.0), rng)
    return Scene(
        name="river",
        seed=seed,
        world=terrain.world(solids, water=water),
        home_enu=(0.0, 2.0, 0.0),
        description="River 28 m wide with waves in a wind of 8 m/s, a gravel bar, meadows and trees",
        regions={"river": _course(), "meadow": rectangle(-140.0, 20.0, 140.0, 120.0)},
    )


def _middle(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the north of the river's middle."""
    return np.asarray(-22.0 + 6.0 * np.sin(x / 40.0))


def _course() -> Polygon:
    """Return the polygon of the deep water."""
    xs = np.linspace(-148.0, 148.0, 60)
    south = [(float(x), float(y) - HALF_BED_M) for x, y in zip(xs, _middle(xs), strict=True)]
    north = [(float(x), float(y) + HALF_BED_M) for x, y in zip(xs, _middle(xs), strict=True)]
    return (*south, *north[::-1])
