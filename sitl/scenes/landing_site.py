"""Landing site of five surfaces with objects and a slope, after the radar letter's example (section 3.2)."""

from __future__ import annotations

import numpy as np

from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Polygon, Scene, ellipse, rectangle
from sitl.world.primitives import Box, Ellipsoid, Kind, Solid
from sitl.world.world import World

HALF_M = 50.0
"""Half side of the surveyed area."""
POND = (-30.0, -32.0, 10.0, 7.0)
RIDGE = (30.0, 22.0, 9.0)
"""East, north and half width of a ridge with flanks of 22 degrees."""


def build(seed: int) -> Scene:
    """Return 100 m x 100 m of water, sand, soil, grass and snow; the seed moves its objects."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(100.0, 0.5, terrain_rng)
    terrain.swell(0.25, 60.0)
    terrain.cover(terrain.rectangle(-100, 10, -10, 100), Kind.SOIL)
    terrain.cover(terrain.rectangle(-100, -100, -5, -12), Kind.SAND)
    terrain.cover(terrain.rectangle(8, -100, 100, -15), Kind.SNOW)
    _ridge(terrain)
    terrain.flood(terrain.ellipse(*POND), terrain.at(POND[0], POND[1]), 4.0)
    return Scene(
        name="landing_site",
        seed=seed,
        world=World(terrain.ground(), _things(terrain, rng)),
        home_enu=(0.0, 0.0, 0.0),
        description="Water, sand, soil, grass and snow with boulders, crates and a ridge",
        regions={
            "site": rectangle(-HALF_M, -HALF_M, HALF_M, HALF_M),
            "pond": ellipse(*POND),
            "ridge": _flanks(),
        },
    )


def _ridge(terrain: Terrain) -> None:
    x, y, half = RIDGE
    away = np.abs(terrain.x - x)
    length = np.clip((14.0 - np.abs(terrain.y - y)) / 4.0, 0.0, 1.0)
    terrain.z += np.tan(np.radians(22.0)) * np.maximum(half - away, 0.0) * length


def _flanks() -> Polygon:
    x, y, half = RIDGE
    return rectangle(x - half + 1, y - 9.0, x + half - 1, y + 9.0)


def _things(terrain: Terrain, rng: np.random.Generator) -> list[Solid]:
    """Scatter boulders and crates from 0.5 m to 1.6 m high, 1.5 m to 3 m wide, on a jittered lattice."""
    solids: list[Solid] = []
    for y in np.arange(-42.0, 43.0, 12.0):
        for x in np.arange(-42.0, 43.0, 12.0):
            px, py = float(x + rng.uniform(-2, 2)), float(y + rng.uniform(-2, 2))
            size, height = rng.uniform(1.5, 3.0), rng.uniform(0.5, 1.6)
            wet = ((px - POND[0]) / (POND[2] + 4)) ** 2 + ((py - POND[1]) / (POND[3] + 4)) ** 2 < 1
            steep = abs(px - RIDGE[0]) < RIDGE[2] + 3 and abs(py - RIDGE[1]) < 17
            if rng.random() < 0.45 or wet or steep:
                continue
            z = terrain.at(px, py)
            name = f"{len(solids)}-{height:.2f}"
            if rng.random() < 0.5:
                yaw = rng.uniform(0, np.pi)
                crate = Box(px, py, z - 0.3, size, size, height + 0.3, yaw, Kind.WOOD, f"crate-{name}")
                solids.append(crate)
            else:
                r = size / 2
                solids.append(Ellipsoid(px, py, z, r, r, height, Kind.ROCK, f"boulder-{name}"))
    return solids
