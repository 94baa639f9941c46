"""Closing and hole filling against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.kernels.surface.masks import REACH, closed, filled


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (30, 41), (64, 3)])
@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.95])
def test_masks_are_closed_and_filled_as_by_scipy(shape: tuple[int, int], share: float) -> None:
    rng = np.random.default_rng(7)
    for _ in range(5):
        mask = rng.random(shape) < share
        np.testing.assert_array_equal(closed(mask), ndimage.binary_closing(mask, iterations=REACH))
        np.testing.assert_array_equal(filled(mask), ndimage.binary_fill_holes(mask))
