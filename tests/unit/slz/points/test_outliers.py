"""Outlier removal: where an object would not be isolated."""

from __future__ import annotations

import numpy as np
import pytest

from slz.points.outliers import is_dense_at

N_RETURNS = 100_000
SENSOR = np.array([10.0, 20.0, 30.0])


@pytest.mark.parametrize(("down_m", "dense"), [(4.44, True), (4.48, False)])
def test_near_the_sensor_an_object_would_send_back_two(down_m: float, dense: bool) -> None:
    """An object of 0.005 m2 sends back 0.005 x 100000 / (4 pi d2) of that many: two at 4.461 m."""
    point = SENSOR - np.array([[0.0, 0.0, down_m]])
    assert is_dense_at(point, SENSOR, N_RETURNS).tolist() == [dense]
