"""Order of cells equally far from everything unsafe: all are returned, by rows, then columns."""

from __future__ import annotations

import numpy as np

from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.distance_transform import greatest_clearance


def test_the_middles_of_equal_squares_come_by_rows_and_then_by_columns() -> None:
    corners = [(2, 190), (3, 10), (20, 130), (21, 60), (21, 190), (22, 1)]
    part = np.zeros((45, 230), np.uint8)
    for row, col in corners:
        part[row : row + 5, col : col + 5] = 1
    for hints in np.empty((0, 2), np.int64), np.array([[4, 192], [0, 0], [-9, 500], [21, 4]]):
        found = greatest_clearance(packed(part), 5, hints)
        assert found[:, :2].tolist() == [[row + 2, col + 2] for row, col in corners]
        assert (found[:, 2] == 9).all()
