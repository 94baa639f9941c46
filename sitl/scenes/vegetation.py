"""Scenes of vegetation: fields of maize and wheat, and trees that sway in the wind."""

from __future__ import annotations

import math

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.scene import Scene, ellipse, rectangle
from sitl.world.plant_motion import Sway
from sitl.world.primitives import Ellipsoid, Kind, Solid
from sitl.world.surface_layers import MAIZE, MEADOW, WHEAT

TRACK_HALF_M = 6.5
MAIZE_FIELD = (-80.0, TRACK_HALF_M, 60.0, 80.0)
WHEAT_FIELD = (-80.0, -80.0, -5.0, -TRACK_HALF_M)
MEADOW_FIELD = (10.0, -80.0, 60.0, -TRACK_HALF_M)
BARE_FIELD = (65.0, -80.0, 110.0, 80.0)


def build_maize(seed: int) -> Scene:
    """Return the fields; the seed sets relief and trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(120.0, 0.5, terrain_rng)
    terrain.swell(0.5, 70.0)
    terrain.swell(0.05, 10.0)
    for field, plants in ((MAIZE_FIELD, MAIZE), (WHEAT_FIELD, WHEAT), (MEADOW_FIELD, MEADOW)):
        terrain.cover(terrain.rectangle(*field), Kind.SOIL)
        terrain.grow(terrain.rectangle(*field), plants)
    terrain.cover(terrain.rectangle(*BARE_FIELD), Kind.SOIL)
    solids: list[Solid] = []
    for k in range(16):
        x, y = float(rng.uniform(-115.0, -90.0)), float(rng.uniform(-110.0, 110.0))
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 10.0), rng)
    return Scene(
        name="maize",
        seed=seed,
        world=terrain.world(solids),
        home_enu=(0.0, 0.0, 0.5 * np.pi),
        description="Fields of maize 2 m and wheat 0.7 m high, a meadow and bare soil, a grass track between",
        regions={
            "maize": rectangle(*MAIZE_FIELD),
            "wheat": rectangle(*WHEAT_FIELD),
            "meadow": rectangle(*MEADOW_FIELD),
            "bare": rectangle(*BARE_FIELD),
            "track": rectangle(-80.0, -TRACK_HALF_M + 0.5, 60.0, TRACK_HALF_M - 0.5),
        },
    )


CLEARING_M = 26.0
GLADE = (-18.0, 2.0, 18.0, 18.0)
LAWN = (-14.0, -18.0, 14.0, 0.0)
TREES = 46


def build_swaying_trees(seed: int) -> Scene:
    """Return the clearing; the seed sets relief, and each tree's place, height and swing."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(90.0, 0.5, terrain_rng)
    terrain.swell(0.4, 60.0)
    terrain.level(terrain.rectangle(*LAWN), 0.0, 10.0)
    terrain.cover(terrain.rectangle(*LAWN), Kind.GRASS, LAWN_RELIEF_M)
    terrain.grow(terrain.rectangle(*GLADE), MEADOW)
    solids: list[Solid] = []
    sways: dict[int, Sway] = {}
    wind_rad = float(rng.uniform(-math.pi, math.pi))
    for k in range(TREES):
        turn, reach = float(rng.uniform(0.0, 2 * math.pi)), float(rng.uniform(CLEARING_M + 8.0, 78.0))
        x, y, height = reach * math.cos(turn), reach * math.sin(turn), float(rng.uniform(6.0, 14.0))
        # One swing for all parts of a crown; most trees swing along the wind.
        sway = Sway(
            amplitude_m=float(rng.uniform(0.02, 0.04)) * height,
            bearing_rad=wind_rad + float(rng.normal(0.0, 0.3)),
            hz=float(rng.uniform(2.5, 4.0)) / height,
            phase_rad=float(rng.uniform(0.0, 2 * math.pi)),
        )
        for part in scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), height, rng):
            if isinstance(part, Ellipsoid):
                sways[len(solids)] = sway
            solids.append(part)
    return Scene(
        name="swaying_trees",
        seed=seed,
        world=terrain.world(solids, sways=sways),
        home_enu=(0.0, -8.0, 0.0),
        description="Clearing among trees that sway, a lawn, and a meadow that moves under the rotors",
        regions={
            "lawn": rectangle(*LAWN),
            "meadow": rectangle(*GLADE),
            "clearing": ellipse(0.0, 0.0, CLEARING_M, CLEARING_M),
        },
        wash=True,
    )
