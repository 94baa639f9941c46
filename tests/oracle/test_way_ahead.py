"""Velocity that obstacles in the way allow, against NumPy's plain formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.landing.guidance import BRAKING_MS2
from companion.flight.landing.look_ahead import LEVEL_M, MARGIN_M, STRAYS, limit_velocity

Floats = NDArray[np.float64]


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
