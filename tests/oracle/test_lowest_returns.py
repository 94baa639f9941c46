"""Lowest returns of a scan by cells, against NumPy's plain formulas."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.fusion.height_datum import CELLS, SIDE, find_lowest


@pytest.mark.parametrize(("every", "reach_m"), [(1, 28.0), (3, 28.0), (2, 5.0), (1, 0.0)])
def test_lowest_returns(every: int, reach_m: float) -> None:
    rng = np.random.default_rng(every)
    sensor = np.array([-70.3, 40.2, 20.0])
    points = rng.normal((-70, 40, 0), (12, 12, 2), (4000, 3))
    some = points[::every]
    some = some[np.hypot(some[:, 0] - sensor[0], some[:, 1] - sensor[1]) < reach_m]
    cells = np.floor(some[:, :2]).astype(np.int64)
    number = cells[:, 0] % SIDE * SIDE + cells[:, 1] % SIDE
    expected = [
        (n, *cells[number == n][0].tolist(), float(some[number == n, 2].min())) for n in np.unique(number)
    ]
    index, places, heights = np.empty(CELLS, np.int64), np.empty((2, CELLS), np.int64), np.empty(CELLS)
    which = np.empty(CELLS, np.int64)
    n = find_lowest(points, every, sensor, reach_m, index, places, heights, which)
    assert list(zip(index[:n], *places[:, :n], points[which[:n], 2], strict=True)) == expected
    assert (heights[:n] == points[which[:n], 2]).all()
