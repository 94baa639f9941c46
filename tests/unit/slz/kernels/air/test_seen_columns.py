"""Rays through columns of air: what they pass is counted, what lies beyond their return is not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.air.corridor_obstacles import forget_known
from slz.kernels.air.seen_columns import (
    BASE,
    BELOW,
    COL,
    LEVELS,
    NOWHERE,
    ROW,
    SIDE,
    follow_rays,
)

VOXEL_M = 2.0


class Air:
    """Counts of rays, by the voxel's row, column and level."""

    def __init__(self) -> None:
        self.passed = np.zeros((SIDE, SIDE, LEVELS), np.uint8)
        self.column = np.full((SIDE, SIDE, 3), NOWHERE, np.int32)

    def follow(
        self, points: NDArray[np.float64], sensor: tuple[float, float, float], stride: int = 1
    ) -> None:
        rows, origin = np.arange(len(points)), np.zeros(len(points), np.uint16)
        follow_rays(points, rows, origin, np.array([sensor]), 0, stride, VOXEL_M, self.passed, self.column)

    def count(self, row: int, col: int, level: int) -> int:
        a, b = row % SIDE, col % SIDE
        if self.column[a, b, ROW] != row or self.column[a, b, COL] != col:
            return 0
        up = level - self.column[a, b, BASE]
        return int(self.passed[a, b, up]) if 0 <= up < LEVELS else 0


@pytest.mark.parametrize("seed", range(4))
def test_a_ray_is_counted_once_in_the_voxels_it_passes_and_in_no_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sensor, point = rng.uniform((-20, -20, 10), (20, 20, 50)), rng.uniform(-40, 40, 3)
    air = Air()
    air.follow(point[np.newaxis], tuple(sensor))
    share = np.linspace(0, 1, 200_001)[:, np.newaxis]
    path = np.floor((sensor + (point - sensor) * share) / VOXEL_M).astype(int)
    crossed = {(r, c, level) for c, r, level in path.tolist()}
    counted = {
        (int(air.column[a, b, ROW]), int(air.column[a, b, COL]), int(air.column[a, b, BASE] + up))
        for a, b, up in np.argwhere(air.passed)
    }
    assert air.passed.max() == 1
    assert counted <= crossed
    assert len(counted) > 0.6 * len(crossed)  # corners are cut


@pytest.mark.parametrize("voxel_m", [1.0, 1.7])
def test_the_voxels_passed_are_those_of_points_half_a_voxel_apart(voxel_m: float) -> None:
    """Five rays in six have an origin; every second row is followed."""
    rng, air, expected = np.random.default_rng(1), Air(), dict[tuple[int, ...], int]()
    points, origin = rng.uniform(-90, 90, (80, 3)), rng.integers(0, 6, 80).astype(np.uint16)
    points *= (1.0, 1.0, 0.1)
    points[:9, :2] *= 9  # farther than air is remembered
    origins = np.vstack([rng.uniform(-8, 8, (5, 3)), np.full(3, np.nan)])
    rows = rng.permutation(80)[:60]
    follow_rays(points, rows, origin, origins, 1, 2, voxel_m, air.passed, air.column)
    for i in rows[1::2][origin[rows[1::2]] < 5]:
        here, length = origins[origin[i]], float(np.linalg.norm(points[i] - origins[origin[i]]))
        shares = np.arange(0.0, min(length, SIDE * voxel_m) + voxel_m / 2, voxel_m / 2).clip(
            max=length - 0.05
        )
        path = np.floor((here + (points[i] - here) * shares[:, np.newaxis] / length) / voxel_m)
        own = np.floor(here / voxel_m)
        for c, r, level in np.unique(
            path[np.abs(path - own)[:, :2].max(axis=1) < SIDE // 2], axis=0
        ).tolist():
            expected[r, c, level] = expected.get((r, c, level), 0) + 2
    counted = {place: n for place in expected if (n := air.count(*map(int, place)))}
    assert len(counted) > 0.8 * len(expected)
    assert all(expected[place] == n for place, n in counted.items())


def test_nothing_is_counted_beyond_a_return() -> None:
    air = Air()
    air.follow(np.array([[1.0, 1.0, 11.0]]), (1.0, 1.0, 21.0))
    assert [air.count(0, 0, level) for level in range(4, 12)] == [0, 1, 1, 1, 1, 1, 1, 0]


def test_each_ray_stands_for_those_that_are_not_followed() -> None:
    air, points = Air(), np.tile([[1.0, 1.0, 0.0]], (90, 1))
    air.follow(points, (1.0, 1.0, 10.0), stride=30)
    assert air.count(0, 0, 2) == 90
    for _ in range(3):
        air.follow(points, (1.0, 1.0, 10.0), stride=30)
    assert air.count(0, 0, 2) == 255


def test_a_column_that_another_place_takes_is_forgotten() -> None:
    air, far_m = Air(), SIDE * VOXEL_M
    air.follow(np.array([[1.0, 1.0, 0.0]]), (1.0, 1.0, 10.0))
    air.follow(np.array([[1.0 + far_m, 1.0, 0.0]]), (1.0 + far_m, 1.0, 10.0))
    assert air.count(0, 0, 2) == 0
    assert air.count(0, SIDE, 2) == 1


def test_a_ray_is_followed_no_farther_than_air_is_remembered() -> None:
    air = Air()
    air.follow(np.array([[SIDE * VOXEL_M, 1.0, 20.0]]), (1.0, 1.0, 20.0))
    columns = air.column[air.passed.any(axis=2)][:, COL]
    assert columns.max() == SIDE // 2 - 1


@pytest.mark.parametrize("sensor", [(np.nan, 0.0, 0.0), (0.0, 0.0, np.inf), (5.0, 5.0, 5.0)])
def test_rays_from_nowhere_and_of_no_length_count_nothing(sensor: tuple[float, float, float]) -> None:
    air = Air()
    air.follow(np.array([[5.0, 5.0, 5.0]]), sensor)
    assert not air.passed.any()


def test_air_far_below_the_first_return_of_a_column_stays_unseen() -> None:
    air = Air()
    air.follow(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, -4 * BELOW * VOXEL_M]]), (1.0, 1.0, 10.0))
    assert air.count(0, 0, 0) == 2
    assert air.count(0, 0, -BELOW) == 1
    assert air.count(0, 0, -BELOW - 1) == 0


# Tops of the far map beside a near map that knows a part of the ground.


FLOOR_M = 0.3
NEAR_M, FAR_M = 0.2, 0.5


def left(ground: NDArray[np.float32], shift_m: float = 0.0, offset_m: float = 0.0) -> NDArray[np.bool_]:
    """Return (12, 12) which tops of a far map are left; the near map's corner is 1 m and `offset_m` in it."""
    top = np.full((12, 12), 2.0, np.float32)
    corner = shift_m - 1.0
    forget_known(top, corner, corner, FAR_M, ground, shift_m + offset_m, shift_m + offset_m, NEAR_M, FLOOR_M)
    return np.isfinite(top)


@pytest.mark.parametrize("shift_m", [0.0, -37.3, 1234.4])
def test_tops_over_ground_that_the_near_map_knows_are_forgotten(shift_m: float) -> None:
    found = left(np.zeros((20, 20), np.float32), shift_m)  # 4 m: eight cells of the far map from the third on
    inside = np.zeros((12, 12), bool)
    inside[2:10, 2:10] = True
    np.testing.assert_array_equal(found, ~inside)


def test_a_cell_that_the_near_map_knows_in_part_keeps_its_top() -> None:
    ground = np.zeros((20, 20), np.float32)
    ground[0, 0] = np.nan
    found = left(ground)
    assert found[2, 2]
    assert not found[2, 3]


def test_a_cell_that_the_near_map_covers_in_part_keeps_its_top() -> None:
    found = left(np.zeros((20, 20), np.float32), offset_m=0.1)
    assert found[2].all()
    assert not found[3, 3:9].any()


def test_a_top_below_the_floor_stays() -> None:
    top = np.full((4, 4), 0.2, np.float32)
    forget_known(top, 0.0, 0.0, FAR_M, np.zeros((10, 10), np.float32), 0.0, 0.0, NEAR_M, FLOOR_M)
    assert np.isfinite(top).all()
