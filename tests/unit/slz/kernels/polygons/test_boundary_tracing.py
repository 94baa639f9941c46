"""Boundary tracing of a component, independent of its columns' position in the bitmap's words."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.kernels.polygons.boundary_tracing import trace_boundary
from slz.kernels.raster.bitmap import packed

ROWS, COLS = 9, 11


def toured(part: np.ndarray, east: int) -> tuple[list[list[int]], int]:  # type: ignore[type-arg]
    wide = np.zeros((ROWS + 2, 200), np.uint8)
    wide[1:-1, east : east + COLS] = part
    path, edges = np.empty((4 * part.size, 2), np.int32), np.empty(4 * part.size, np.uint8)
    first = int(np.argmax(part[0]))
    n, area = trace_boundary(packed(wide), 1, east + first, path, edges)
    return (path[:n] - [1, east]).tolist(), area


@pytest.mark.parametrize("seed", range(12))
def test_a_tour_does_not_depend_on_where_words_begin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    part = (rng.random((ROWS, COLS)) < 0.62).astype(np.uint8)
    part[0, int(rng.integers(COLS))] = 1
    label, _ = ndimage.label(part, np.ones((3, 3)))
    part[label != label[0, int(np.argmax(part[0]))]] = 0
    path, area = toured(part, 5)
    on_edge = part.astype(bool) & ~ndimage.binary_erosion(part, border_value=0)
    assert all(on_edge[row, col] for row, col in path)
    for east in (*range(50, 67), 118, 126, 127, 128):
        assert toured(part, east)[0] == path
    filled = ndimage.binary_fill_holes(part)
    assert area == toured(filled.astype(np.uint8), 60)[1] == filled.sum()
