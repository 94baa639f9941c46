"""Even falls: extents as planes over blocks, each label by itself."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.surface.even_falls import even_falls
from tests.unit.slz.surface.made_ground import places

X, Y = places(64)
ALL = np.array([False, True, True])


def labels() -> np.ndarray:
    """Two extents side by side."""
    return np.where(X < 30, 1, np.where(X < 32, 0, 2)).astype(np.int32)


def test_planes_are_told_with_their_gradient_and_no_unevenness() -> None:
    own = labels()
    height = np.where(own == 1, 0.003 * Y, 1 + 0.001 * X)
    off, variance, gradient = even_falls(own, height.astype(np.float32), ALL, 1.0)
    np.testing.assert_allclose(off[own > 0], 0, atol=1e-3)
    assert gradient[1:] == pytest.approx([0.003, 0.001], rel=0.02)
    assert variance.max() < 1e-6


@pytest.mark.parametrize("noise_m", [0.0, 0.02])
def test_undulation_and_noise_are_the_variance_about_the_planes(noise_m: float) -> None:
    own = labels()
    height = 0.02 * np.sin(2 * np.pi * Y / 8) * (own == 1) + np.random.default_rng(1).normal(
        0, noise_m, own.shape
    )
    _, variance, _ = even_falls(own, height.astype(np.float32), ALL, 1.0)
    assert np.sqrt(variance[1]) == pytest.approx(np.hypot(0.02 / np.sqrt(2), noise_m), rel=0.15)
    assert variance[2] == pytest.approx(noise_m**2, rel=0.15, abs=1e-6)


def test_a_river_that_bends_is_a_plane_in_each_block() -> None:
    """Its fall turns from south to east."""
    own = np.where((X < 16) | (Y < 16), 1, 0).astype(np.int32)
    height = np.where(X < 16, 0.002 * Y, 0.002 * (16 - X) + 0.032)
    _, variance, gradient = even_falls(own, height.astype(np.float32), ALL[:2], 1.0)
    assert variance[1] < 1e-6
    assert gradient[1] == pytest.approx(0.002, rel=0.02)
