"""Steep hill with landable ground around it and none on it (scene 5)."""

from __future__ import annotations

import math

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, ellipse, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.world import World

RADIUS_M = 70.0


def build(seed: int) -> Scene:
    """Return the hill scene; the top is a ridge of rock, too rough and too steep to land on."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(200.0, 0.5, terrain_rng)
    terrain.swell(0.35, 80.0)
    distance = np.hypot(terrain.x, terrain.y)
    terrain.z += 0.42 * np.maximum(RADIUS_M - distance, 0.0)
    terrain.cover(distance < 30.0, Kind.ROCK, 0.10)
    terrain.level(terrain.rectangle(-12.0, -132.0, 12.0, -108.0), 0.0, 12.0)
    solids: list[Solid] = []
    for k in range(45):
        turn, reach = rng.uniform(0.0, 2 * math.pi), rng.uniform(20.0, 78.0)
        x, y = reach * math.cos(turn), reach * math.sin(turn)
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 9.0), rng)
    for k in range(50):
        x, y = rng.normal(0.0, 9.0, 2).clip(-25.0, 25.0)
        solids += scene_objects.boulder(f"stone-{k}", x, y, terrain.at(x, y), rng.uniform(0.3, 0.9), rng)
    return Scene(
        name="hill",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(0.0, -120.0, 0.0),
        description="A wooded hill of 23 deg with a rocky top, meadows all around",
        regions={
            "hill": ellipse(0.0, 0.0, RADIUS_M, RADIUS_M),
            "meadow_south": rectangle(-190.0, -190.0, 190.0, -85.0),
            "meadow_north": rectangle(-190.0, 85.0, 190.0, 190.0),
        },
    )
