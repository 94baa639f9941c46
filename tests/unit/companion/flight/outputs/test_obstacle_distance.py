"""OBSTACLE_DISTANCE: nearest return per direction, unknown is not free."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from companion.flight.geometry.axes import level_frd_m, rotation_enu_from_frd
from companion.flight.outputs.obstacle_distance import UNKNOWN, obstacle_distance, sector_distances_cm
from tests.unit.companion.flight.outputs.pose import pose

BAND = (-2.0, 2.0)


def sectors(points: object, min_m: float = 0.5, max_m: float = 30.0) -> list[int]:
    array = np.array(points, dtype=float).reshape(-1, 3)
    return [int(v) for v in sector_distances_cm(array, min_m=min_m, max_m=max_m, band_m=BAND)]


def test_without_returns_every_direction_is_unknown() -> None:
    assert sectors([]) == [UNKNOWN] * 72


@pytest.mark.parametrize(
    ("point", "sector"),
    [
        ((5, 0, 0), 0),
        ((0, 5, 0), 18),
        ((-5, 0, 0), 36),
        ((0, -5, 0), 54),
        ((5, -0.1, 0), 0),
        ((5, 0.3, 0), 1),
    ],
)
def test_a_return_is_in_the_sector_clockwise_from_forward(point: tuple[float, ...], sector: int) -> None:
    found = sectors([point])
    assert found[sector] == pytest.approx(500, abs=2)
    assert sum(value != UNKNOWN for value in found) == 1


def test_the_nearest_return_counts() -> None:
    assert sectors([(9, 0, 0), (4, 0, 1), (7, 0, -1)])[0] == 400


def test_returns_above_and_below_the_band_and_of_the_vehicle_itself_are_no_obstacle() -> None:
    assert sectors([(5, 0, 2.5), (5, 0, -2.5), (0.3, 0, 0)]) == [UNKNOWN] * 72


def test_a_far_return_through_the_band_shows_a_free_direction_and_the_ground_nearby_does_not() -> None:
    assert sectors([(60, 0, 3)])[0] == 3001
    assert sectors([(31, 0, 10)])[0] == UNKNOWN
    assert sectors([(10, 0, 10)])[0] == UNKNOWN


def test_an_obstacle_wins_over_free() -> None:
    assert sectors([(60, 0, 0), (8, 0, 0)])[0] == 800


def test_rows_with_nan_are_left_out() -> None:
    assert sectors([(math.nan, 0, 0), (8, 0, 0)])[0] == 800


@given(st.lists(st.tuples(*[st.floats(-40, 40)] * 3), max_size=30))
def test_every_value_is_an_obstacle_in_range_or_says_that_there_is_none(points: object) -> None:
    for value in sectors(points):
        assert 50 <= value <= 3001 or value == UNKNOWN


def test_the_message_can_be_encoded_and_says_what_it_holds() -> None:
    message = obstacle_distance(np.array([[5.0, 0.0, 0.0]]), 0, min_m=0.6, max_m=700.0)
    assert (message.increment, message.increment_f, message.angle_offset) == (5, 5.0, 0.0)
    assert (message.min_distance, message.max_distance, message.frame) == (60, 65533, 12)
    assert message.pack(mavlink.MAVLink(None))


def test_a_band_without_the_vehicle_is_refused() -> None:
    with pytest.raises(ValueError, match="own height"):
        sector_distances_cm(np.zeros((0, 3)), min_m=1, max_m=2, band_m=(1.0, 2.0))


def test_a_tilted_vehicle_still_sees_the_wall_level_and_by_its_heading() -> None:
    tilted = pose((10.0, 5.0, 50.0), roll=0.2, pitch=-0.4, yaw=math.pi / 2)
    frd = level_frd_m([[17.0, 5.0, 50.0], [10.0, 4.0, 48.0]], tilted)
    assert frd == pytest.approx(np.array([[7.0, 0.0, 0.0], [0.0, 1.0, 2.0]]), abs=1e-9)


@given(*[st.floats(-3, 3)] * 3)
def test_a_quaternion_of_the_autopilot_turns_body_axes_into_the_map(
    roll: float, pitch: float, yaw: float
) -> None:
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    expected = pose((0, 0, 0), roll, pitch, yaw).rotation_enu_from_frd
    assert rotation_enu_from_frd((w, x, y, z)) == pytest.approx(expected, abs=1e-12)


def columns(cells: object, points: object = (), cell_m: float = 0.6) -> list[int]:
    found = sector_distances_cm(
        points, min_m=0.5, max_m=30.0, band_m=BAND, columns_frd_m=cells, cell_m=cell_m
    )
    return [int(v) for v in found]


def test_a_cell_of_the_map_stands_in_all_the_sectors_that_it_spans() -> None:
    found = columns([(5, 0, -9)])  # its top is above the vehicle
    assert found[0] == 470
    assert found[71] == found[1] == 470
    assert found[2] == UNKNOWN
    assert columns([(20, 0, 0)])[71:] == [UNKNOWN]


def test_a_cell_that_ends_below_the_band_or_holds_the_vehicle_does_not_count() -> None:
    assert columns([(5, 0, 2.1), (0.2, 0.2, 0), (31, 0, 0), (5, 0, math.nan)]) == [UNKNOWN] * 72


def test_the_nearer_of_scan_and_map_counts() -> None:
    assert columns([(5, 0, 0)], [(4, 0, 0)])[0] == 400
    assert columns([(5, 0, 0)], [(9, 0, 0)])[0] == 470
    assert columns([(5, 0, 0)], [(60, 0, 0)])[0] == 470  # seen free by a ray that passed it by


def test_an_edge_nearer_than_the_minimum_is_told_at_the_minimum() -> None:
    assert columns([(0.7, 0, 0)])[0] == 50
