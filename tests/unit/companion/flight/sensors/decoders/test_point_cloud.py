"""Messages sensor_msgs/PointCloud2 as records of their fields."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.sensors.decoders.point_cloud import BadCloudError, coordinates, decode, table_of
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


def records(**columns: object) -> np.ndarray:
    """Return three points with further fields."""
    fields = {name: np.asarray(values) for name, values in columns.items()}
    kinds = [(name, "f4") for name in "xyz"] + [(name, values.dtype) for name, values in fields.items()]
    table = np.zeros(3, kinds)
    table["x"] = [1, 2, 3]
    for name, values in fields.items():
        table[name] = values
    return table


def test_intensity_keeps_the_scale_of_the_file_and_return_numbers_come_along() -> None:
    table = records(
        intensity=np.array([0, 300, 65_535], np.uint16),
        return_number=np.array([1, 2, 3], np.uint8),
        number_of_returns=np.array([1, 2, 2], np.uint8),
    )
    found = decode(table, BEGIN_NS, None).returns
    assert found.intensity.tolist() == [0, 300, 65_535]
    assert found.echo.tolist() == [1, 2, 3]
    assert found.echoes.tolist() == [1, 2, 2]


def test_a_cloud_without_intensity_or_with_nonsense_is_taken() -> None:
    bare = decode(records(), BEGIN_NS, None).returns
    assert np.isnan(bare.intensity).all()
    assert (bare.echo.tolist(), bare.has_attributes) == ([0, 0, 0], False)
    odd = decode(records(intensity=[np.nan, -5.0, 1e300], return_number=[np.nan, -1, 999]), BEGIN_NS, None)
    np.testing.assert_array_equal(odd.returns.intensity, [np.nan, 0, np.inf])
    assert odd.returns.echo.tolist() == [0, 0, 255]
    small = decode(records(reflectivity=np.array([3, 2, 1], np.uint8)), BEGIN_NS, None).returns
    assert small.intensity.dtype == np.uint8
    assert small.intensity.tolist() == [3, 2, 1]
