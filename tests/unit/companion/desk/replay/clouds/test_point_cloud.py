"""Messages sensor_msgs/PointCloud2 as records of their fields."""

from __future__ import annotations

import numpy as np
import pytest

from companion.desk.replay.clouds.point_cloud import BadCloudError, coordinates, table_of
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS

POINTS = np.array([[1.0, 2, 3], [4, 5, 6]], np.float32)
AFTER = np.array([5_000, 90_000_000])


def test_clouds_that_contradict_themselves_are_refused() -> None:
    for name, value in (("width", 3), ("point_step", 10), ("point_step", 0), ("height", 7), ("fields", [])):
        message = flights.cloud(POINTS, AFTER, BEGIN_NS)
        setattr(message, name, value)
        with pytest.raises(BadCloudError):
            table_of(message)


def test_rows_with_padding_are_read() -> None:
    message = flights.cloud(np.repeat(POINTS, 2, axis=0), np.arange(4), BEGIN_NS)
    rows = message.data.reshape(2, -1)
    message.data = np.concatenate([rows, np.full((2, 8), 255, np.uint8)], axis=1).ravel()
    message.height, message.width, message.row_step = 2, 2, 48
    np.testing.assert_array_equal(coordinates(table_of(message)), np.repeat(POINTS, 2, axis=0)[::-1])


def test_fields_of_a_cloud_that_are_no_numbers_are_passed_over() -> None:
    message = flights.cloud(POINTS, AFTER, BEGIN_NS)
    (field,) = {type(f) for f in message.fields}
    vector, strange = field("normal", 0, 7, 3), field("label", 10**6, 99, 1)
    message.fields = [vector, strange, *message.fields]
    table = table_of(message)
    assert "normal" not in (table.dtype.names or ())
    np.testing.assert_array_equal(coordinates(table), POINTS[::-1])  # as the writer orders them
