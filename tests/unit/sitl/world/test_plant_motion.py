"""Swaying crowns and grass under a rotor: bounds of the motion, and what beams and truth see of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.scenes import build
from sitl.sensors.optics import Noise
from sitl.sensors.vlp16 import Vlp16
from sitl.world.plant_motion import FULL_WIND_MS, PRESSED, Sway, Wash, swept
from sitl.world.primitives import Box, Ellipsoid, Kind
from sitl.world.world import World
from tests.unit.sitl.still_world import flat_world, hover

CROWN = Ellipsoid(0.0, 0.0, 6.0, 1.5, 1.5, 2.0)
SWAY = Sway(0.4, 0.7, 0.5, 0.3)
TIMES = np.arange(0.0, 4.0, 0.05)


def test_a_crown_swings_by_the_square_of_the_wind_and_no_further_than_its_amplitude() -> None:
    for wind_ms, most in ((0.0, 0.0), (5.0, 0.1), (FULL_WIND_MS, 0.4), (30.0, 0.4)):
        away = np.array([SWAY.offset_m(float(t), wind_ms) for t in np.arange(0.0, 2.0, 0.001)])
        assert np.hypot(*away.T).max() == pytest.approx(most, abs=1e-4)
        np.testing.assert_allclose(away[:, 0] * math.sin(0.7), away[:, 1] * math.cos(0.7), atol=1e-12)


def test_the_swept_ellipsoid_holds_the_crown_at_every_place_of_its_swing() -> None:
    whole = swept(CROWN, SWAY)
    unit = np.random.default_rng(1).normal(size=(4000, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, np.newaxis]
    for away in np.linspace(-0.4, 0.4, 9):
        x, y, z = (unit * [1.5, 1.5, 2.0]).T
        x, y = x + away * math.cos(0.7), y + away * math.sin(0.7)
        inside = (x / whole.radius_x_m) ** 2 + (y / whole.radius_y_m) ** 2 + (z / whole.radius_z_m) ** 2
        assert inside.max() <= 1.0 + 1e-9


def test_beams_see_the_crown_where_it_is_and_everything_else_all_that_it_sweeps() -> None:
    world = World(flat_world().ground, [CROWN], sways={0: SWAY})
    world.wind_ms = FULL_WIND_MS
    origins = np.tile([1.4, 0.0, 30.0], (len(TIMES), 1))
    down = np.tile([0.0, 0.0, -1.0], (len(TIMES), 1))
    seen = world.cross(origins, down, 50.0, np.empty((len(TIMES), 0)), time_s=TIMES).range_m
    for t, range_m in zip(TIMES, seen, strict=True):
        # Crowns stand still for a quantum of 20 ms.
        near = [SWAY.offset_m(t + dt, FULL_WIND_MS) for dt in (-0.02, 0.0, 0.02)]
        rest = [1.0 - ((1.4 - e) ** 2 + n**2) / 1.5**2 for e, n in near]
        tops = [24.0 - 2.0 * math.sqrt(r) if r > 0.0 else 30.0 for r in rest]
        assert min(tops) - 0.02 <= range_m <= max(tops) + 0.02
    assert np.ptp(seen) > 0.5
    assert world.height_m(1.85, 0.0) > 5.0
    assert world.height_m(0.0, 0.0) == pytest.approx(6.0 + 2.0 * (1.0 + 0.4 / 1.5))


def test_only_ellipsoids_sway() -> None:
    with pytest.raises(ValueError, match="'box' cannot sway"):
        World(flat_world().ground, [Box(0.0, 0.0, 0.0, 1.0, 1.0, 1.0)], sways={0: SWAY})


def test_shots_at_swaying_trees_do_not_depend_on_how_time_is_cut() -> None:
    world = build("swaying_trees", 1).world
    whole = Vlp16(np.random.default_rng(1)).shots(0, 60_000_000, hover(0.0, 30.0, 20.0), world)
    cut = Vlp16(np.random.default_rng(1))
    parts = [cut.shots(k * 10_000_000, (k + 1) * 10_000_000, hover(0.0, 30.0, 20.0), world) for k in range(6)]
    np.testing.assert_array_equal(
        whole.echoes.range_m, np.concatenate([part.echoes.range_m for part in parts])
    )


def test_a_wash_begins_two_diameters_over_the_ground() -> None:
    assert Wash.below(0.45, 1.0, 2.0, 1.81) is None
    low = Wash.below(0.45, 1.0, 2.0, 0.0)
    half = Wash.below(0.45, 1.0, 2.0, 0.9)
    assert low is not None
    assert half is not None
    assert (low.press, half.press) == (PRESSED, pytest.approx(PRESSED / 2))


def test_grass_in_the_wash_is_nearer_to_the_ground_and_flutters() -> None:
    world = build("swaying_trees", 2).world
    bare = World(world.ground)
    pose = hover(0.0, 10.0, world.height_m(0.0, 10.0) + 1.0)
    heights = []
    for wash in (None, Wash(0.0, 10.0, 1.2, PRESSED)):
        world.wash = wash
        lidar = Vlp16(np.random.default_rng(3), noise=Noise.none())
        shots = lidar.shots(0, 100_000_000, pose, world)
        position, attitude = pose(shots.index)
        at = (
            position + lidar.mount.lever_enu_m(attitude) + lidar.mount.to_enu(lidar.points_m(shots), attitude)
        )
        near = (shots.echoes.range_m > 0.0) & (np.hypot(at[:, 0], at[:, 1] - 10.0) < 1.0)
        heights.append(at[near, 2] - bare.surface(at[near, 0], at[near, 1])[0])
    still, blown = heights
    assert still.min() > -0.01
    assert blown.min() > -0.01
    assert blown.mean() < 0.7 * still.mean()
    assert Kind.MEADOW in world.surface(np.array([0.0]), np.array([10.0]))[1]
