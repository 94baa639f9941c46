"""Height over ground and obstacles ahead, from map and fresh returns together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.geometry.axes import level_frd_m
from companion.flight.mapping.clearance import band_m, height_m, obstacle_points_enu_m
from companion.flight.mapping.recent_obstacles import CAPACITY, RecentObstacles
from slz import SAFE, UNSAFE, Corridors, Nearby, Obstacle, PointState, Scan, SelectedPoint, Surroundings
from slz.frame import LocalFrame
from tests.unit.companion.flight.outputs.pose import pose

S = 1_000_000_000
FRAME = LocalFrame(47.0, 8.0, 400.0)
ABOVE = np.array([0.0, 0.0, 10.0])


def scan(points: NDArray[np.float64], stamp_ns: int) -> Scan:
    return Scan(points, np.full(len(points), stamp_ns), ABOVE, FRAME)


def memory(up_m: float | None, stamp_ns: int = S) -> RecentObstacles:
    """Return the memory of flat ground below at a height, None: of nothing."""
    seen = RecentObstacles(keep_s=1.0, thin=1)
    if up_m is not None:
        ground = np.random.default_rng(1).uniform(-3, 3, (2000, 3))
        ground[:, 2] = up_m
        seen.add(scan(ground, stamp_ns))
    return seen


def mapped(up_m: float | None, pole_m: float = math.nan) -> Nearby:
    ground = np.full((40, 40), np.nan if up_m is None else up_m, np.float32)
    top = ground.copy()
    top[20, 30] = pole_m
    return Nearby(-10.0, -10.0, 0.5, ground, top, np.zeros(ground.shape, bool))


@pytest.mark.parametrize(
    ("map_up_m", "fresh_up_m", "height"),
    [
        (2.0, 2.1, 8.0),  # they agree: the map
        (2.0, 4.0, 6.0),  # a car came: the nearer
        (4.0, 2.0, 6.0),
        (None, 2.0, 8.0),
        (2.0, None, 8.0),
        (None, None, math.nan),
    ],
)
def test_the_nearer_ground_counts_where_map_and_returns_differ(
    map_up_m: float | None, fresh_up_m: float | None, height: float
) -> None:
    found = height_m(ABOVE, S, memory(fresh_up_m), mapped(map_up_m), 0.3)
    assert found == pytest.approx(height, nan_ok=True)


def test_without_a_map_the_fresh_returns_count_until_they_are_old() -> None:
    seen = memory(3.0)
    assert height_m(ABOVE, S + S // 2, seen, None, 0.3) == 7.0
    assert math.isnan(height_m(ABOVE, 3 * S, seen, None, 0.3))
    seen = memory(3.0)
    seen.forget()
    assert math.isnan(height_m(ABOVE, S, seen, None, 0.3))
    assert seen.newest_ns is None


def test_a_few_stray_returns_are_no_ground() -> None:
    seen = RecentObstacles(thin=1)
    seen.add(scan(np.zeros((4, 3)), S))
    assert math.isnan(seen.ground_below_m(ABOVE, S))


def test_the_ring_holds_the_newest_returns_and_turns_them_level() -> None:
    seen = RecentObstacles(keep_s=10.0, thin=1)
    rng = np.random.default_rng(2)
    points = rng.uniform(-5, 5, (3 * CAPACITY // 2, 3))
    for part in np.array_split(points, 7):
        seen.add(scan(part, S))
    at = pose((1.0, 2.0, 3.0), roll=0.3, yaw=1.0)
    found = seen.level_frd_m(at, S)
    wanted = level_frd_m(points[-CAPACITY:], at)
    assert len(found) == CAPACITY
    np.testing.assert_allclose(np.sort(found, axis=0), np.sort(wanted, axis=0), atol=1e-9)


def test_the_ground_to_land_on_is_not_in_the_way() -> None:
    assert band_m(20.0, 0.3) == (-2.0, 2.0)
    assert band_m(math.nan, 0.3) == (-2.0, 2.0)
    assert band_m(1.5, 0.3) == pytest.approx((-2.0, 1.2))
    assert band_m(0.1, 0.3) == (-2.0, 0.3)


def selected(obstacle: Obstacle) -> SelectedPoint:
    around = Surroundings(20.0, (obstacle,), np.zeros(36))
    point = np.array([3.0, 3.0, 0.0])
    return SelectedPoint(point, PointState.SAFE, "near", 0.0, 1.0, 0.1, 1.0, 7, around)


def test_what_stands_around_the_vehicle_and_the_landing_point_is_told_up_to_the_vehicle_s_height() -> None:
    cells = np.array([[5.0, 4.0], [5.2, 4.0]])
    low = Obstacle(5.0, 4.0, 1.5, 1.5, cells, 0.2)
    points = obstacle_points_enu_m(ABOVE, mapped(0.0, pole_m=30.0), selected(low), 2.0)
    np.testing.assert_allclose(points, [[5.25, 0.25, 10.0], [5.0, 4.0, 1.5], [5.2, 4.0, 1.5]])
    assert len(obstacle_points_enu_m(ABOVE, None, None, 2.0)) == 0
    assert len(obstacle_points_enu_m(ABOVE, mapped(0.0, pole_m=7.9), None, 2.0)) == 0


def test_what_blocks_a_way_in_is_told_once_however_far_and_the_rest_is_not() -> None:
    states, tops = np.full((72, 2), SAFE, np.uint8), np.full((72, 3), np.nan)
    states[3:6, 0], tops[3:6], tops[20] = UNSAFE, (40.0, 9.0, 25.0), (7.0, 7.0, 2.0)
    states[30, 0], tops[30] = UNSAFE, (3.0, -20.0, 6.0)
    ways = Corridors(np.zeros(3), (30.0, 90.0), states, np.zeros(72), tops)
    none = Obstacle(5.0, 4.0, 1.5, 1.5, np.empty((0, 2)), 0.2)
    points = obstacle_points_enu_m(ABOVE, None, replace(selected(none), corridors=ways), 2.0)
    np.testing.assert_allclose(points, [[3.0, -20.0, 6.0], [40.0, 9.0, 10.0]])  # up to the vehicle's height


def test_a_scan_without_a_return_is_no_news_of_what_is_around() -> None:
    seen = memory(0.0)
    seen.add(scan(np.empty((0, 3)), 5 * S))
    assert seen.newest_ns == S
    assert math.isnan(RecentObstacles().ground_below_m(ABOVE, S))


@pytest.mark.parametrize("lasers", [4, 16, 32, 96, 128])
@pytest.mark.parametrize("length", [96, 1000, 4001])
def test_every_laser_of_a_sensor_is_remembered(lasers: int, length: int) -> None:
    """They fire in turn: one return in eight would be of the same laser for ever."""
    seen = RecentObstacles(keep_s=10.0)
    for first in range(0, 12_000, length):
        turn = (np.arange(first, first + length) % lasers).astype(float)
        seen.add(scan(np.column_stack([turn, np.zeros((length, 2))]), S))
    remembered = np.rint(seen.level_frd_m(pose((0, 0, 0)), S)[:, 1])  # to the right is east
    counts = np.bincount(remembered.astype(int), minlength=lasers)
    assert counts.min() >= 0.8 * counts.mean()
