"""Others near isolated returns, and the chance of them, against plain counting and SciPy's Poisson law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import poisson

from slz.kernels.points.clutter import (
    HIGH,
    LEVEL_M,
    LONELY_LEVEL_M,
    LONELY_M,
    MOST_OTHERS,
    NEAREST_M,
    OPAQUE,
    REACH_M,
    UPRIGHT_M,
    add_others,
    bands_of,
    by_chance,
    chances,
)


@pytest.mark.parametrize("seed", range(6))
def test_the_nearest_others_are_those_that_counting_finds(seed: int) -> None:
    """The returns come in three windows."""
    rng = np.random.default_rng(seed)
    n = 300
    points = np.column_stack([rng.uniform(-4, 4, (n, 2)), rng.uniform(-2, 6, n)])
    bands, reach = bands_of(points[:, 2].copy()), np.full(n, REACH_M)
    bands[rng.random(n) < 0.1] = -1
    upright, level = np.full((2, n, MOST_OTHERS), np.inf)
    lonely = np.ones(n, bool)
    for k in range(3):
        held = (k + 1) * n // 3
        new = np.arange(held) >= k * n // 3
        add_others(
            points[:held], bands[:held], new, reach[:held], upright[:held], level[:held], lonely[:held]
        )
    for i in range(n):
        away = np.maximum(np.hypot(*(points[:, :2] - points[i, :2]).T), NEAREST_M)
        rise = np.abs(points[:, 2] - points[i, 2])
        other = (bands == bands[i]) & (bands[i] >= 0) & (np.arange(n) != i) & (away <= REACH_M)
        tall = other & ((bands != HIGH) | (rise <= UPRIGHT_M))
        for found, which in ((upright[i], tall), (level[i], other & (rise <= LEVEL_M))):
            wanted = np.sort(away[which])[:MOST_OTHERS]
            np.testing.assert_allclose(found, [*wanted, *[np.inf] * (MOST_OTHERS - len(wanted))])
        near = np.where(rise <= LEVEL_M, LONELY_LEVEL_M, LONELY_M)
        assert lonely[i] == (not (other & (rise <= UPRIGHT_M) & (away <= near)).any())


@pytest.mark.parametrize("expected", [1e-6, 0.01, 0.7, 5.0])
def test_the_chance_of_so_many_is_poisson_s(expected: float) -> None:
    told = [by_chance(k, expected) for k in range(1, 7)]
    np.testing.assert_allclose(told, poisson.sf(np.arange(6), expected), rtol=1e-6, atol=1e-12)


def test_the_chance_of_a_return_is_the_least_of_its_circles() -> None:
    rng = np.random.default_rng(7)
    upright, level = np.sort(rng.uniform(NEAREST_M, 2, (2, 50, MOST_OTHERS)))
    upright[::3, 4:] = level[::4, 2:] = np.inf
    rays, opaque = rng.uniform(1, 200, 50), rng.random(50) < 0.5
    share, share_level = rng.uniform(1e-4, 1e-2, (2, 50))
    told = chances(upright, level, opaque, rays, share, share_level)
    for i in range(50):
        least = 1.0
        for others, part in ((upright[i], share[i]), (level[i], share_level[i])):
            for k, away in enumerate(others[np.isfinite(others)].tolist(), 1):
                through = rays[i] * np.pi * away**2
                if not opaque[i] or k + 1 >= OPAQUE * through:
                    least = min(least, float(poisson.sf(k - 1, through * part)))
        assert told[i] == pytest.approx(least, rel=1e-6, abs=1e-12)
