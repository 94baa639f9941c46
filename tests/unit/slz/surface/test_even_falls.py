"""Even falls: extents as planes over blocks, each label by itself."""

from __future__ import annotations

import numpy as np
import pytest

from slz.surface.even_falls import even_falls
from tests.unit.slz.surface.made_ground import places

X, Y = places(64)
NOISE_M2 = np.zeros(3)


def labels() -> np.ndarray:
    """Two extents side by side."""
    return np.where(X < 30, 1, np.where(X < 32, 0, 2)).astype(np.int32)


def test_planes_are_told_with_their_gradient_and_no_unevenness() -> None:
    own = labels()
    height = np.where(own == 1, 0.003 * Y, 1 + 0.001 * X)
    falls = even_falls(own, height[own > 0], NOISE_M2, 1.0)
    np.testing.assert_allclose(falls.level_m, height[own > 0], atol=1e-3)
    assert falls.gradient[1:] == pytest.approx([0.003, 0.001], rel=0.02)
    assert falls.inexact_m.max() < 1e-3


@pytest.mark.parametrize("noise_m", [0.0, 0.02])
def test_undulation_is_told_beyond_the_noise(noise_m: float) -> None:
    own = labels()
    height = 0.02 * np.sin(2 * np.pi * Y / 8) * (own == 1) + np.random.default_rng(1).normal(
        0, noise_m, own.shape
    )
    falls = even_falls(own, height[own > 0], np.full(3, noise_m**2), 1.0)
    assert falls.inexact_m[1] == pytest.approx(0.02 / np.sqrt(2), rel=0.15)
    assert falls.inexact_m[2] < 0.006


def test_a_river_that_bends_is_a_plane_in_each_block() -> None:
    """Its fall turns from south to east."""
    own = np.where((X < 16) | (Y < 16), 1, 0).astype(np.int32)
    height = np.where(X < 16, 0.002 * Y, 0.002 * (16 - X) + 0.032)
    falls = even_falls(own, height[own > 0], NOISE_M2[:2], 1.0)
    assert falls.inexact_m[1] < 1e-3
    assert falls.gradient[1] == pytest.approx(0.002, rel=0.02)
