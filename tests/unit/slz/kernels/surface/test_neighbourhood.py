"""Sums over squares of cells, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.kernels.surface.neighbourhood import box_sums

SHAPES = [(1, 1), (1, 7), (6, 2), (17, 23)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [0, 1, 2, 10])
def test_box_sums_are_those_of_a_correlation_with_ones(shape: tuple[int, int], radius: int) -> None:
    layers = np.random.default_rng(1).uniform(0, 50, (3, *shape)).astype(np.float32)
    ones = np.ones((2 * radius + 1, 2 * radius + 1))
    expected = [ndimage.correlate(layer.astype(np.float64), ones, mode="constant") for layer in layers]
    np.testing.assert_allclose(box_sums(layers, radius), expected, rtol=1e-5)
