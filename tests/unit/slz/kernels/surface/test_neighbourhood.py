"""Sums and greatest values over squares of cells, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.kernels.surface.neighbourhood import box_sums, greatest_around

SHAPES = [(1, 1), (1, 7), (6, 2), (17, 23)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [0, 1, 2, 10])
def test_box_sums_are_those_of_a_correlation_with_ones(shape: tuple[int, int], radius: int) -> None:
    layers = np.random.default_rng(1).uniform(0, 50, (3, *shape)).astype(np.float32)
    ones = np.ones((2 * radius + 1, 2 * radius + 1))
    expected = [ndimage.correlate(layer.astype(np.float64), ones, mode="constant") for layer in layers]
    np.testing.assert_allclose(box_sums(layers, radius), expected, rtol=1e-5)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [0, 1, 4, 30])
def test_the_greatest_value_around_is_that_of_a_maximum_filter(shape: tuple[int, int], radius: int) -> None:
    rng = np.random.default_rng(2)
    values = (rng.integers(1, 99, shape) * (rng.random(shape) < 0.1)).astype(np.int32)
    expected = ndimage.maximum_filter(values, 2 * radius + 1, mode="constant")
    np.testing.assert_array_equal(greatest_around(values, radius), expected)
