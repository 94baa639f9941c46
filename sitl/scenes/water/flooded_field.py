"""Field flooded by rain: murky water up to a few decimetres deep over uneven soil, and a dry track."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.water_waves import WaterState

FIELD = (-90.0, -90.0, 90.0, 90.0)
TRACK_HALF_M, TRACK_M = 6.0, 0.45
LEVEL_M = 0.0
WATER = WaterState(wind_ms=2.0, fetch_m=40.0, turbid=0.01)


def build(seed: int) -> Scene:
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
    terrain.stand_water(terrain.rectangle(-98.0, -98.0, 98.0, 98.0), LEVEL_M)
    solids: list[Solid] = []
    for k, x in enumerate(np.arange(-110.0, 111.0, 18.0)):
        px, py = float(x), 105.0 + rng.uniform(-6.0, 6.0)
        solids += scene_objects.tree(f"tree-{k}", px, py, terrain.at(px, py), rng.uniform(5.0, 9.0), rng)
    return Scene(
        name="flooded_field",
        seed=seed,
        world=terrain.world(solids, water=WATER),
        home_enu=(0.0, 0.0, 0.0),
        description="Soil under a few decimetres of murky water with dry islands, a raised track across it",
        regions={
            "field_south": rectangle(FIELD[0], FIELD[1], FIELD[2], -TRACK_HALF_M - 3.0),
            "field_north": rectangle(FIELD[0], TRACK_HALF_M + 3.0, FIELD[2], FIELD[3]),
            "track": rectangle(-110.0, -TRACK_HALF_M + 0.5, 110.0, TRACK_HALF_M - 0.5),
        },
    )
