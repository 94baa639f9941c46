"""Phase unwrapping along the best paths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.instruments.phase_unwrapping import unwrap_by_quality

F64 = NDArray[np.float64]


def wrapped(phase: F64) -> F64:
    return np.asarray(np.angle(np.exp(1j * phase)))


def hills(seed: int) -> F64:
    y, x = np.mgrid[:60, :80] / 10.0
    a, b, c = np.random.default_rng(seed).uniform(3, 6, 3)
    return np.asarray(a * np.sin(x) + b * np.cos(0.7 * y) + c * x)


def test_smooth_phase_comes_back_whole_but_for_one_number_of_turns() -> None:
    for seed in range(5):
        true = hills(seed)
        found, region = unwrap_by_quality(wrapped(true), np.ones(true.shape), 0.5)
        turns = (found - true) / (2 * np.pi)
        assert np.ptp(turns) < 1e-9
        assert abs(turns[0, 0] - round(turns[0, 0])) < 1e-9
        assert (region == 1).all()


def test_one_line_is_as_numpy_unwraps_it() -> None:
    true = np.cumsum(np.random.default_rng(2).uniform(-2.5, 2.5, 300))
    found, _ = unwrap_by_quality(wrapped(true)[np.newaxis], np.ones((1, 300)), 0.5)
    theirs = np.unwrap(wrapped(true))
    assert np.allclose(found[0] - found[0, 0], theirs - theirs[0])


def test_a_patch_of_noise_spoils_nothing_around_it() -> None:
    true = hills(1)
    phase, quality = wrapped(true), np.full(true.shape, 0.95)
    phase[20:40, 30:50] = np.random.default_rng(3).uniform(-np.pi, np.pi, (20, 20))
    quality[20:40, 30:50] = 0.85
    found, _ = unwrap_by_quality(phase, quality, 0.5)
    outside = np.ones(true.shape, bool)
    outside[20:40, 30:50] = False
    assert np.ptp((found - true)[outside]) < 1e-9


def test_islands_are_regions_of_their_own_and_the_sea_is_unknown() -> None:
    quality = np.full((30, 30), 0.9)
    quality[:, 14:17] = 0.1
    quality[5, 5] = np.nan
    found, region = unwrap_by_quality(np.zeros((30, 30)), quality, 0.5)
    assert set(np.unique(region)) == {0, 1, 2}
    assert np.isnan(found[:, 14:17]).all()
    assert np.isnan(found[5, 5])
    assert region[0, 0] != region[0, 29]
