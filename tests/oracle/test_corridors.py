"""Corridors against a path that is scanned step by step.

With the vehicle's radius as it is, no corridor is clear that a raised cell or an unseen voxel reaches into by
its centre. With a radius wider by the cells' size, every corridor that is free even so is clear.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.landing.guidance import BRAKING_MS2
from companion.flight.landing.look_ahead import LEVEL_M, MARGIN_M, STRAYS, limit_velocity
from slz.kernels.air.corridor_obstacles import clear_over
from slz.kernels.air.seen_columns import BASE, COL, LEVELS, ROW, SIDE, unseen_slopes

SEEDS = [0, 1, *(pytest.param(seed, marks=pytest.mark.bench) for seed in range(2, 6))]  # on request, for time
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
BEARINGS, SPREAD, HEIGHT_M, RADIUS_M, REACH_M = 24, 0.1, 2.0, 2.0, 36.0
TANGENTS = np.array([0.3, 0.6, 1.2, np.inf])
CEILING_M, VOXEL_M, CELL_M, STEP_M = 9.0, 1.0, 0.5, 0.05
POINT = np.array([3.3, -7.1, 0.4])


def covered(places: Floats, radius_m: float, lifted_m: float = 0.0) -> Flags:
    """Return (bearings, slopes, n) whether the vehicle covers places (n, 3) on its way to the point.

    lifted_m: by how much its underside is higher.
    """
    away, up = places[:, :2] - POINT[:2], places[:, 2] - POINT[2]
    out = np.zeros((BEARINGS, len(TANGENTS), len(places)), np.bool_)
    for b in range(BEARINGS):
        way = np.array([np.sin(b * 2 * np.pi / BEARINGS), np.cos(b * 2 * np.pi / BEARINGS)])
        for s, tangent in enumerate(TANGENTS):
            if np.isinf(tangent):
                out[b, s] = (np.hypot(*away.T) < radius_m) & (up > lifted_m) & (places[:, 2] < CEILING_M)
                continue
            for far in np.arange(0, (CEILING_M - POINT[2]) / tangent, STEP_M):
                under = np.hypot(*(away - far * way).T) < radius_m + SPREAD * far
                low = far * tangent + lifted_m
                out[b, s] |= under & (up > low) & (up < min(low + HEIGHT_M, CEILING_M - POINT[2]))
    return out


@pytest.mark.parametrize("seed", SEEDS)
def test_air_that_was_not_seen_is_not_clear_and_all_other_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    passed = np.full((SIDE, SIDE, LEVELS), 50, np.uint8)
    column = np.zeros((SIDE, SIDE, 3), np.int32)
    index = np.arange(-SIDE // 2, SIDE // 2)
    column[index[:, None], index, ROW], column[index[:, None], index, COL] = np.meshgrid(
        index, index, indexing="ij"
    )
    column[..., BASE] = -5
    holes = np.column_stack([rng.integers((-32, -22), (18, 28), (4, 2)), rng.integers(0, 9, 4)])
    for row, col, level in holes:
        passed[row, col, level + 5] = 4
    unseen = np.zeros((BEARINGS, len(TANGENTS)), np.bool_)
    place = VOXEL_M, *POINT.tolist(), CEILING_M
    unseen_slopes(passed, column, *place, TANGENTS, RADIUS_M, SPREAD, HEIGHT_M, REACH_M, 5, unseen)
    inside = np.concatenate([(hole[[1, 0, 2]] + rng.uniform(0, 1, (200, 3))) * VOXEL_M for hole in holes])
    assert (unseen | ~covered(inside, RADIUS_M).any(axis=2)).all()
    wide = np.concatenate(
        [covered(inside, RADIUS_M + 1.6 * VOXEL_M, lift).any(axis=2)[None] for lift in (-2.5, 0, 1.2)]
    )
    assert (~unseen | wide.any(axis=0)).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_no_top_reaches_into_a_clear_corridor_and_others_are_clear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    side = int(2 * REACH_M / CELL_M)
    west, south = (POINT[:2] - REACH_M).tolist()
    top = np.full((side, side), 0.1, np.float32)
    cells = rng.integers(4, side - 4, (5, 2))
    top[cells[:, 0], cells[:, 1]] = rng.uniform(0.5, 12, 5)
    tangents, highest = np.zeros(BEARINGS), np.full((BEARINGS, 3), np.nan)
    place = south, west, CELL_M, *POINT.tolist()
    clear_over(top, top < 0.5, *place, RADIUS_M, SPREAD, 1.5 * REACH_M, 0.1, tangents, highest)
    blocked = (tangents[:, np.newaxis] > TANGENTS) | np.isinf(tangents)[:, np.newaxis]
    posts = [
        np.column_stack([
            west + (col + rng.uniform(0, 1, 300)) * CELL_M,
            south + (row + rng.uniform(0, 1, 300)) * CELL_M,
            rng.uniform(POINT[2], top[row, col], 300),
        ])
        for row, col in cells
    ]  # fmt: skip
    places = np.concatenate(posts)
    assert (blocked | ~covered(places, RADIUS_M).any(axis=2)).all()
    wide = covered(places, RADIUS_M + 1.5 * CELL_M).any(axis=2)
    low = ~np.isinf(tangents)[:, np.newaxis] & np.isfinite(TANGENTS)
    steep = np.degrees(np.arctan(tangents))[:, np.newaxis] > np.degrees(np.arctan(TANGENTS)) + 8
    assert (wide | ~(blocked & low & steep)).all()


def test_what_asks_for_the_slope_is_told() -> None:
    top = np.full((80, 80), np.nan, np.float32)
    top[60, 40] = 5.0
    tangents, highest = np.zeros(BEARINGS), np.full((BEARINGS, 3), np.nan)
    clear_over(top, top < 0, 0, 0, 0.5, 20.25, 10.0, 0.0, 1.0, 0.0, 40.0, 0.01, tangents, highest)
    assert highest[0].tolist() == [20.25, 30.25, 5.0]
    assert tangents[0] == pytest.approx(5 / (20.25 - 1 - 0.5 * np.sqrt(0.5)))
    assert not tangents[4:21].any()
    assert np.isnan(highest[4:21]).all()


# Velocity that obstacles in the way allow, against NumPy's plain formulas.


def speed_ms(distances_m: Floats, least_m: float) -> float:
    beyond = np.sort(distances_m[distances_m > least_m])
    nearest_m = beyond[STRAYS] if len(beyond) > STRAYS else math.inf
    return math.sqrt(2 * BRAKING_MS2 * max(0.0, nearest_m - MARGIN_M))


@pytest.mark.parametrize("seed", range(30))
def test_velocities_among_obstacles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(0, rng.choice([4.0, 12.0, 30.0]), (int(rng.choice([2, 30, 600])), 3))
    points[rng.random(len(points)) < 0.05] = np.nan
    wanted, aside_m, least_m = rng.normal(0, 4, 3), float(rng.uniform(1, 3)), 0.6
    speed = math.hypot(wanted[0], wanted[1])
    way = wanted[:2] / speed
    along, aside = points[:, :2] @ way, np.abs(points[:, :2] @ (-way[1], way[0]))
    ahead = along[(aside < aside_m) & (np.abs(points[:, 2]) < LEVEL_M)]
    above = -points[np.hypot(points[:, 0], points[:, 1]) < aside_m, 2]
    expected = [*(way * min(speed, speed_ms(ahead, least_m))), wanted[2]]
    if wanted[2] < 0:
        expected[2] = max(wanted[2], -speed_ms(above, least_m))
    found = limit_velocity(wanted, points, least_m, aside_m).velocity_frd_ms
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
