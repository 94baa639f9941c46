"""Water, plants and snow over the ground: shores, tops, and what rays meet."""

from __future__ import annotations

import numpy as np
import pytest

from sitl.world.primitives import Box, Ground, Kind
from sitl.world.surface_layers import MAIZE, MEADOW, SNOW, Plants, SurfaceLayers
from sitl.world.water_waves import WaterState
from sitl.world.world import World

DOWN = np.array([[0.0, 0.0, -1.0]])


def beach(plants: Plants | None = None, level: float = 0.0, solids: tuple[Box, ...] = ()) -> World:
    """Return ground that rises by 10 % to the east through height 0, under water below a level."""
    x = np.arange(-40.0, 41.0, 2.0)
    ground = Ground(-40.0, -40.0, 2.0, np.tile(0.1 * x, (41, 1)), np.full((40, 40), Kind.SAND, np.uint8))
    plant = np.full((40, 40), int(plants is not None), np.uint8)
    layers = SurfaceLayers(np.full((40, 40), level), plant, () if plants is None else (plants,))
    return World(ground, solids, layers=layers)


def test_the_shore_is_where_the_ground_reaches_the_level() -> None:
    world = beach()
    x = np.array([-20.0, -0.6, -0.4, -0.01, 0.01, 20.0])
    z, kind = world.surface(x, np.full(6, 0.7))
    np.testing.assert_allclose(z, [0, 0, 0, 0, 0.001, 2.0], atol=1e-12)
    assert [Kind(k).name for k in kind] == ["WATER", "WATER", "PUDDLE", "PUDDLE", "SAND", "SAND"]


@pytest.mark.parametrize("tilt", [0.0, 0.5, -0.5, 1.2, -1.2])
def test_rays_end_at_the_water_and_know_its_depth(tilt: float) -> None:
    world = beach()
    rng = np.random.default_rng(1)
    n = 500
    origins = np.column_stack([rng.uniform(-20, 20, (n, 2)), rng.uniform(3, 6, n)])
    azimuth = rng.uniform(0, 2 * np.pi, n)
    flat = np.sin(tilt)
    directions = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.full(n, -np.cos(tilt))])
    c = world.cross(origins, directions, 90.0, np.ones((n, 1)))
    level_m = origins[:, 2] / np.cos(tilt)
    at = origins + level_m[:, None] * directions
    # Down to the level the ray must stay over the beach, which rises to the east.
    inside = np.abs(at[:, :2]).max(axis=1) < 39.9
    wet = inside & (at[:, 0] < -1e-6)
    np.testing.assert_allclose(c.water_m[wet], level_m[wet])
    np.testing.assert_allclose(c.depth_m[wet], -0.1 * at[wet, 0], atol=1e-9)
    assert (c.bottom[wet] == Kind.SAND).all()
    assert np.isnan(c.water_m[inside & (at[:, 0] > 1e-6)]).all()
    assert wet.sum() > 50


def test_a_pier_in_the_water_is_seen_first() -> None:
    world = beach(solids=(Box(-20.0, 0.0, -5.0, 6.0, 6.0, 5.5),))
    c = world.cross(
        np.array([[-20.0, 0.0, 9.0], [-30.0, 0.0, 9.0]]), np.tile(DOWN, (2, 1)), 90.0, np.ones((2, 1))
    )
    np.testing.assert_array_equal(np.isnan(c.water_m), [True, False])
    assert c.range_m[0] == pytest.approx(8.5)
    z, kind = world.surface(np.array([-20.0]), np.array([0.0]))
    assert (z[0], kind[0]) == (0.5, Kind.CONCRETE)


def test_plants_stand_on_the_ground_and_show_their_top() -> None:
    world = beach(MAIZE, level=-9.0)
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-39, 39, (2, 3000))
    z, kind = world.surface(x, y)
    assert (kind == Kind.MAIZE).all()
    tall = z - 0.1 * x
    assert (tall.min(), tall.max()) == pytest.approx((1.7, 2.3), abs=0.12)
    assert tall.mean() == pytest.approx(2.0, abs=0.03)
    assert np.abs(np.diff(world.surface(np.linspace(0, 2, 200), np.zeros(200))[0])).max() < 0.03  # no steps


def test_an_opaque_view_ends_at_the_tops() -> None:
    """Radar and flash cameras use `trace`."""
    world = beach(Plants(Kind.WHEAT, 0.7, 2.0, 0.15), level=-9.0)
    rng = np.random.default_rng(3)
    n = 400
    origins = np.column_stack([rng.uniform(-30, 30, (n, 2)), np.full(n, 12.0)])
    range_m, kind, cosine = world.trace(origins, np.tile(DOWN, (n, 1)), 90.0)
    assert (kind == Kind.WHEAT).all()
    assert (cosine == 1.0).all()
    top, _ = world.surface(origins[:, 0], origins[:, 1])
    np.testing.assert_allclose(12.0 - range_m, top, atol=0.02)


def test_water_has_no_return_for_an_opaque_view() -> None:
    range_m, kind, _ = beach().trace(np.array([[-20.0, 0.0, 9.0]]), DOWN, 90.0)
    assert np.isnan(range_m[0])
    assert kind[0] == Kind.WATER


def test_reed_stands_out_of_the_water_and_hides_it() -> None:
    reed = Plants(Kind.REED, 1.5, 0.75, 0.0)
    world = beach(reed)
    z, kind = world.surface(np.array([-5.0, -18.0]), np.zeros(2))
    assert (z[0], kind[0]) == (pytest.approx(1.0), Kind.REED)
    assert (z[1], kind[1]) == (0.0, Kind.WATER)
    rng = np.random.default_rng(4)
    n = 4000
    c = world.cross(
        np.tile([[-5.0, 0.0, 9.0]], (n, 1)), np.tile(DOWN, (n, 1)), 90.0, rng.exponential(1.0, (n, 1))
    )
    leaf = c.leaf_m[:, 0]
    assert np.isnan(leaf).mean() == pytest.approx(np.exp(-0.75 * 1.0), abs=0.03)
    assert np.nanmax(leaf) <= 9.0  # none below the water
    assert c.depth_m[0] == pytest.approx(0.5)


@pytest.mark.parametrize("plants", [MEADOW, SNOW])
def test_light_enters_a_meadow_deeply_and_snow_a_little(plants: Plants) -> None:
    world = beach(plants, level=-9.0)
    rng = np.random.default_rng(5)
    n = 3000
    origins = np.column_stack([rng.uniform(-30, 30, (n, 2)), np.full(n, 12.0)])
    c = world.cross(origins, np.tile(DOWN, (n, 1)), 90.0, rng.exponential(1.0, (n, 1)))
    top, _ = world.surface(origins[:, 0], origins[:, 1])
    below = top - (12.0 - c.leaf_m[:, 0])
    assert np.nanmin(below) > -0.01
    # Mean of the exponential distribution, given that the leaf is above the ground.
    whole = plants.extinction_per_m * plants.height_m
    mean_m = (1.0 - whole / np.expm1(whole)) / plants.extinction_per_m
    assert np.nanmean(below) == pytest.approx(mean_m, rel=0.05)
    assert np.nanmax(below) < plants.tallest_m


def test_waves_have_their_height_and_move() -> None:
    state = WaterState(wind_ms=8.0, fetch_m=400.0)
    rng = np.random.default_rng(6)
    x, y = rng.uniform(-200, 200, (2, 20_000))
    still = np.zeros(20_000)
    now = state.height_m(x, y, still)
    assert now.std() == pytest.approx(state.height_rms_m, rel=0.05)
    assert state.height_rms_m == pytest.approx(0.25 * 0.0016 * 8.0 * np.sqrt(400.0 / 9.81))
    near = state.height_m(x + 0.02, y, still)
    assert np.corrcoef(now, near)[0, 1] > 0.97
    later = state.height_m(x, y, still + 0.4)
    assert np.corrcoef(now, later)[0, 1] < 0.7
    assert not WaterState(0.0).height_m(x, y, still).any()


def test_layers_of_another_shape_are_refused() -> None:
    ground = Ground(0, 0, 1, np.zeros((3, 3)), np.zeros((2, 2), np.uint8))
    with pytest.raises(ValueError, match="the ground has"):
        World(ground, layers=SurfaceLayers(np.zeros((3, 3)), np.zeros((3, 3), np.uint8)))
    with pytest.raises(ValueError, match="plants for every number"):
        SurfaceLayers(np.zeros((2, 2)), np.ones((2, 2), np.uint8))
