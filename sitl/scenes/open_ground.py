"""Scenes of open ground: a plain, a dusty plain and a snowfield."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, ellipse, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.surface_layers import SNOW
from sitl.world.world import World

PAD = (-20.0, -20.0, 20.0, 20.0)
LAKE = (70.0, -60.0, 30.0, 20.0)


def build_plain(seed: int) -> Scene:
    """Return the plain; the seed moves everything except the flat middle and the lake."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(150.0, 0.5, terrain_rng)
    terrain.swell(0.5, 60.0)
    terrain.z += 22.0 / (1.0 + np.exp(-(terrain.y - 125.0) / 7.0))
    terrain.hill(-110.0, -120.0, 12.0, 22.0)
    terrain.level(terrain.rectangle(*PAD), 0.0, 15.0)
    terrain.cover(terrain.rectangle(40.0, 40.0, 90.0, 80.0), Kind.SOIL)
    terrain.cover(terrain.ellipse(-80.0, 60.0, 25.0, 15.0), Kind.ROCK)
    terrain.flood(terrain.ellipse(*LAKE), terrain.at(LAKE[0], LAKE[1]) - 0.5, 5.0)
    return Scene(
        name="plain",
        seed=seed,
        world=World(terrain.ground(), _solids(terrain, rng)),
        home_enu=(0.0, 0.0, 0.0),
        description="Open grassland with a lake, stones, a fence, scattered trees, rising in the north",
        regions={
            "middle": rectangle(*PAD),
            "field": rectangle(40.0, 40.0, 90.0, 80.0),
            "stones": ellipse(-80.0, 60.0, 25.0, 15.0),
            "lake": ellipse(*LAKE),
            "rise": rectangle(-150.0, 110.0, 150.0, 140.0),
        },
    )


def _solids(terrain: Terrain, rng: np.random.Generator) -> list[Solid]:
    solids: list[Solid] = []
    for k in range(28):
        x, y = rng.uniform(-140.0, 140.0, 2)
        on_lake = math.hypot((x - LAKE[0]) / (LAKE[2] + 6), (y - LAKE[1]) / (LAKE[3] + 6)) < 1.0
        if not on_lake and math.hypot(x, y) > 35.0:
            solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 10.0), rng)
    for k in range(60):
        turn, reach = rng.uniform(0.0, 2 * math.pi), math.sqrt(rng.random())
        x, y = -80.0 + 24.0 * reach * math.cos(turn), 60.0 + 14.0 * reach * math.sin(turn)
        solids += scene_objects.boulder(f"stone-{k}", x, y, terrain.at(x, y), rng.uniform(0.15, 0.6), rng)
    for k, y in enumerate(np.arange(30.0, 90.0, 15.0)):
        z = min(terrain.at(30.0, float(y)), terrain.at(30.0, float(y) + 15.0))
        solids += scene_objects.fence(f"fence-{k}", (30.0, float(y)), (30.0, float(y) + 15.0), z)
    return solids


DUST_BELOW_M = 30.0


def build_dust_out(seed: int) -> Scene:
    """Return the plain of this seed, with dust."""
    return replace(
        build_plain(seed),
        name="dust_out",
        description="Open grassland so dry that the rotors' dust hides it from LiDARs below 30 m",
        dust_below_m=DUST_BELOW_M,
    )


YARD = (-10.0, -10.0, 10.0, 10.0)


def build_snowfield(seed: int) -> Scene:
    """Return the snowfield; the seed sets drifts, stones and trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(100.0, 0.5, terrain_rng)
    terrain.swell(0.6, 60.0)
    terrain.swell(0.06, 12.0)
    terrain.level(terrain.rectangle(*YARD), 0.0, 8.0)
    terrain.cover(np.ones_like(terrain.z, dtype=bool), Kind.SNOW)
    terrain.cover(terrain.rectangle(*YARD), Kind.ASPHALT)
    terrain.grow(~terrain.rectangle(*YARD), SNOW)
    solids: list[Solid] = list(
        scene_objects.flat_roof("hut", 24.0, 16.0, terrain.at(24.0, 16.0), (8.0, 6.0, 3.0), 0.0, Kind.SNOW)
    )
    for k in range(25):
        x, y = rng.uniform(-90.0, 90.0), rng.uniform(-45.0, -25.0)
        solids += scene_objects.boulder(f"stone-{k}", x, y, terrain.at(x, y), rng.uniform(0.4, 1.2), rng)
    for k in range(30):
        x, y = rng.uniform(-90.0, 90.0), rng.uniform(35.0, 95.0)
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 9.0), rng)
    return Scene(
        name="snowfield",
        seed=seed,
        world=terrain.world(solids),
        home_enu=(0.0, 0.0, 0.0),
        description="Snow with drifts, stones, trees, a hut, and a cleared yard of asphalt",
        regions={"yard": rectangle(*YARD), "snow": rectangle(-90.0, -20.0, 90.0, -12.0)},
    )
