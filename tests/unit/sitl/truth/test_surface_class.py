"""True surface classes, and what truth says about water, puddles and crops."""

from __future__ import annotations

import numpy as np
import pytest

from sitl import scenes
from sitl.truth import truth
from sitl.truth.surface_class import SurfaceClass, surface_map
from sitl.world.primitives import Box, Ellipsoid, Ground, Kind
from sitl.world.surface_layers import MAIZE, MEADOW, WHEAT, Plants, SurfaceLayers
from sitl.world.world import World

ON_REQUEST = pytest.mark.bench  # for their time
EXTENT = (-5.0, -5.0, 5.0, 5.0)


def level(
    plants: Plants | None = None, depth_m: float = -1.0, solids: tuple[Box | Ellipsoid, ...] = ()
) -> World:
    ground = Ground(-20.0, -20.0, 2.0, np.zeros((21, 21)), np.full((20, 20), Kind.ASPHALT, np.uint8))
    layers = SurfaceLayers(
        np.full((20, 20), depth_m),
        np.full((20, 20), int(plants is not None), np.uint8),
        () if plants is None else (plants,),
    )
    return World(ground, solids, layers=layers)


@pytest.mark.parametrize(
    ("world", "safe", "surface"),
    [
        (level(depth_m=0.03), True, SurfaceClass.BARE),
        (level(depth_m=0.07), False, SurfaceClass.WATER),
        (level(MEADOW), True, SurfaceClass.BARE),
        (level(WHEAT), False, SurfaceClass.LOW_VEGETATION),
        (level(MAIZE), False, SurfaceClass.LOW_VEGETATION),
    ],
)
def test_one_can_stand_in_puddles_and_grass_but_not_in_water_and_crops(
    world: World, safe: bool, surface: SurfaceClass
) -> None:
    assert bool(truth.safe_map(world, EXTENT).safe.all()) is safe
    assert bool(truth.safe_map(world, EXTENT).safe.any()) is safe
    assert (surface_map(world, EXTENT).surface == surface).all()


def test_a_roof_has_its_height_over_the_ground_around_it() -> None:
    slope = np.tile(0.05 * np.arange(-20.0, 21.0, 2.0), (21, 1))
    ground = Ground(-20.0, -20.0, 2.0, slope, np.full((20, 20), Kind.GRASS, np.uint8))
    house = Box(0.0, 0.0, -1.0, 8.0, 6.0, 6.0, 0.4, Kind.GRAVEL, "house")
    shelf = Box(0.0, 0.0, -1.0, 30.0, 30.0, 1.5, 0.0, Kind.ROOF, "terrace")
    crown = Ellipsoid(9.0, 9.0, 3.0, 2.0, 2.0, 2.0, name="crown")
    found = surface_map(World(ground, [house, shelf, crown]), (-18.0, -18.0, 18.0, 18.0), 0.5)
    roof = found.surface == SurfaceClass.ROOF
    assert roof.sum() * 0.25 == pytest.approx(8.0 * 6.0, rel=0.05)
    np.testing.assert_allclose(found.roof_height_m[roof], 5.0, atol=0.02)
    assert np.isnan(found.roof_height_m[~roof]).all()
    assert (found.surface == SurfaceClass.CANOPY).sum() * 0.25 == pytest.approx(np.pi * 4, rel=0.1)
    assert found.surface[36 + 20, 36] == SurfaceClass.OBJECT  # of the terrace, which is no roof


def test_outside_the_world_is_no_class() -> None:
    found = surface_map(level(), (15.0, 15.0, 25.0, 25.0), 0.5)
    assert found.surface[0, 0] == SurfaceClass.BARE
    assert found.surface[-1, -1] == SurfaceClass.OUTSIDE


def share(name: str, region: str, surface: SurfaceClass, seed: int = 1, inner: float = 1.0) -> float:
    """Return the share of a surface in the rectangle about a region, or in its inner part."""
    scene = scenes.build(name, seed)
    corners = np.array(scene.regions[region])
    corners = corners.mean(axis=0) + inner * (corners - corners.mean(axis=0))
    box = (*corners.min(axis=0), *corners.max(axis=0))
    found = surface_map(scene.world, tuple(float(v) for v in box), 0.5)
    return float((found.surface == surface).mean())


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=ON_REQUEST) for seed in (2, 3))])
def test_scenes_hold_the_surfaces_that_their_regions_say(seed: int) -> None:
    assert share("ponds", "pond-2", SurfaceClass.WATER, seed) == 1.0
    assert share("ponds", "dam", SurfaceClass.BARE, seed) == 1.0
    assert share("lakes", "lake-1", SurfaceClass.WATER, seed, inner=0.6) == 1.0
    assert share("lakes", "lake-2", SurfaceClass.WATER, seed, inner=0.6) == 1.0
    assert 0.003 < share("lakes", "lake-1", SurfaceClass.LOW_VEGETATION, seed) < 0.2
    assert share("car_park_wet", "pool", SurfaceClass.WATER, seed) > 0.85
    assert share("car_park_wet", "car_park", SurfaceClass.WATER, seed) < 0.02
    assert share("car_park_dry", "car_park", SurfaceClass.WATER, seed) == 0.0
    assert 0.6 < share("flooded_field", "field_north", SurfaceClass.WATER, seed) < 0.99
    assert share("flooded_field", "track", SurfaceClass.BARE, seed) == 1.0
    for region, least in (("maize", 1.0), ("wheat", 1.0)):
        assert share("maize", region, SurfaceClass.LOW_VEGETATION, seed) >= least
    for k in range(1, 8):
        assert share("flat_roofs", f"roof-{k}", SurfaceClass.ROOF, seed) == 1.0


def test_the_roofs_of_the_row_are_4_m_to_25_m_high() -> None:
    scene = scenes.build("flat_roofs", 2)
    found = surface_map(scene.world, (-100.0, -20.0, 100.0, 20.0), 0.5)
    heights = np.unique(np.round(found.roof_height_m[found.surface == SurfaceClass.ROOF]))
    np.testing.assert_array_equal(heights, [4, 6, 8, 11, 15, 20, 25])


def test_the_two_car_parks_of_a_seed_differ_in_their_water_alone() -> None:
    wet, dry = (scenes.build(f"car_park_{name}", 4).world for name in ("wet", "dry"))
    np.testing.assert_array_equal(wet.ground.z_m, dry.ground.z_m)
    assert wet.solids == dry.solids
    x, y = np.meshgrid(np.arange(-44.0, 44.0, 0.25), np.arange(-44.0, 44.0, 0.25))
    z, kind = wet.surface(x, y)
    deep = z - dry.surface(x, y)[0]
    puddle = kind == Kind.PUDDLE
    assert 0.005 < puddle.mean() < 0.05
    assert np.median(deep[puddle]) < 0.03
    assert deep[kind == Kind.WATER].max() < 0.3
