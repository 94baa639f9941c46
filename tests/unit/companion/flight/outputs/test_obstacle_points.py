"""OBSTACLE_DISTANCE_3D: ArduPilot's only frame, one stamp a batch, no points that it would drop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.outputs.obstacle_points import faces, nearest_by_face, obstacle_points
from tests.unit.companion.flight.outputs.pose import pose

COORDINATE = st.floats(-60, 60)
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), max_size=40)


def test_a_point_is_told_in_body_axes_however_the_vehicle_leans() -> None:
    leaning = pose((10.0, 5.0, 20.0), pitch=0.2, yaw=math.pi / 2)
    (message,) = obstacle_points([[17.0, 5.0, 20.0]], leaning, 77, min_m=0.6, max_m=50.0)
    assert (message.x, message.y, message.z) == pytest.approx(
        (7 * math.cos(0.2), 0, 7 * math.sin(0.2)), abs=1e-9
    )
    assert (message.time_boot_ms, message.min_distance, message.max_distance) == (77, 0.6, 50.0)
    assert message.pack(mavlink.MAVLink(None))


@given(POINTS)
def test_a_batch_is_body_frd_of_one_stamp_in_range_nearest_first_and_one_a_face(points: object) -> None:
    messages = obstacle_points(points, pose((1.0, 2.0, 3.0), 0.3, -0.2, 1.0), 5, min_m=0.6, max_m=50.0)
    assert {m.frame for m in messages} <= {mavlink.MAV_FRAME_BODY_FRD}
    assert {m.time_boot_ms for m in messages} <= {5}
    found = np.array([(m.x, m.y, m.z) for m in messages]).reshape(-1, 3)
    distance = np.linalg.norm(found, axis=1)
    assert ((distance > 0.6) & (distance < 50)).all()
    assert (np.diff(distance) >= 0).all()
    assert len(set(faces(found).tolist())) == len(found) <= 40


def test_the_nearest_point_of_a_face_is_kept_and_what_is_unknown_is_not() -> None:
    points = np.array([[9.0, 0, 0], [4.0, 0.1, 0], [0, 6, 0], [math.nan, 1, 1], [0.1, 0, 0], [70.0, 0, 0]])
    np.testing.assert_allclose(nearest_by_face(points, 0.6, 50.0), [[4.0, 0.1, 0], [0, 6, 0]])


@pytest.mark.parametrize(
    ("point", "direction", "layer"),
    [
        ((1, 0, 0), 0, 2),
        ((0, 1, 0), 2, 2),
        ((-1, 0, 0), 4, 2),
        ((0, -1, 0), 6, 2),
        ((0, 0, 1), 0, 0),  # straight down
        ((0, 0, -1), 0, 4),
        ((1, 0, 0.5), 0, 1),
        ((1, 0, -0.5), 0, 3),
    ],
)
def test_faces_are_eight_directions_by_five_elevations(
    point: tuple[float, ...], direction: int, layer: int
) -> None:
    assert faces(np.array([point], float)).tolist() == [layer * 8 + direction]
