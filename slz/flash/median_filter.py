"""Median filter, 3 x 3, that ignores missing pixels."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def median_of_neighbours(image: F64) -> F64:
    """Return the median of the known pixels among 9, 6 at edges and 4 at corners (Flash paper, Eq. (1)).

    Where no more than half of them are known, the result is NaN: a hole is not filled from its rim.
    """
    windows = np.sort(_windows(image, np.nan), axis=-1)  # what is missing comes last
    known = 9 - np.isnan(windows).sum(axis=-1, keepdims=True)
    low, high = (np.take_along_axis(windows, k, axis=-1)[..., 0] for k in ((known - 1) // 2, known // 2))
    present = _windows(np.ones(image.shape), 0.0).sum(axis=-1)
    return np.where(2 * known[..., 0] > present, 0.5 * (low + high), np.nan)


def _windows(image: F64, beyond: float) -> F64:
    """Return (rows, cols, 9) the neighbourhood of each pixel, with one value for all beyond the image."""
    padded = np.pad(image, 1, constant_values=beyond)
    return sliding_window_view(padded, (3, 3)).reshape(*image.shape, 9)
