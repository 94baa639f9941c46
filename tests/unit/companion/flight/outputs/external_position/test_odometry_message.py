"""ODOMETRY: frames and covariances against SciPy, and nothing from an estimate that is none."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.outputs.external_position.odometry_message import clock_message, odometry_message
from companion.flight.outputs.external_position.odometry_stream import OdometryStream
from slz.frame import LocalFrame

MS, S = 1_000_000, 1_000_000_000
TAKEN, NOW = 50 * S, 50 * S + 220 * MS
HELD = {ARDUPILOT: 200 * MS, PX4: 0}  # ArduPilot: VISO_DELAY_MS
ORIGIN = np.array([100.0, -20.0, 3.0])
FRAME = LocalFrame(47.0, 8.0, 400.0)
VEHICLES = {name: VehicleState(sysid=1, autopilot=name) for name in (ARDUPILOT, PX4)}
AUTOPILOTS = pytest.mark.parametrize("autopilot", list(VEHICLES))
NED_FROM_ENU = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
ANGLE, TILT = st.floats(-math.pi, math.pi), st.floats(-1.2, 1.2)


def spread(size: int, seed: int = 1) -> NDArray[np.float64]:
    """Return a covariance with all its correlations, standard deviations of some centimetres."""
    root = np.random.default_rng(seed).normal(0, 0.03, (size, size))
    return root @ root.T + 1e-5 * np.eye(size)


def estimate(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, **changes: Any) -> OdometryEstimate:
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    made = OdometryEstimate(
        TAKEN,
        ORIGIN + np.array([3.0, 4.0, 20.0]),
        np.array([1.0, 2.0, -0.5]),
        np.array([w, x, y, z]),
        spread(6),
        spread(3),
        np.ones(6, np.bool_),
        0,
    )
    return replace(made, **changes)


def sent(made: OdometryEstimate, autopilot: Autopilot = ARDUPILOT, now_ns: int = NOW) -> Any:
    """Return the message as the other side decodes it, None for none."""
    message = odometry_message(VEHICLES[autopilot], made, ORIGIN, now_ns)
    if message is None:
        return None
    return mavlink.MAVLink(None).parse_buffer(message.pack(mavlink.MAVLink(None)))[0]


def square(triangle: list[float]) -> NDArray[np.float64]:
    """Return the matrix of an upper triangle, counted as in the definition of ODOMETRY."""
    matrix = np.empty((6, 6))
    numbers = iter(triangle)
    for row in range(6):
        for column in range(row, 6):
            matrix[row, column] = matrix[column, row] = next(numbers)
    return matrix


# ---- frames ---------------------------------------------------------------------------------------------


def test_each_autopilot_gets_the_frame_and_the_estimator_type_that_it_reads() -> None:
    local_frd, local_ned = mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_LOCAL_NED
    lidar, vision = mavlink.MAV_ESTIMATOR_TYPE_LIDAR, mavlink.MAV_ESTIMATOR_TYPE_VISION
    for autopilot, frame, kind in ((ARDUPILOT, local_frd, lidar), (PX4, local_ned, vision)):
        message = sent(estimate(), autopilot)
        assert (message.frame_id, message.child_frame_id) == (frame, mavlink.MAV_FRAME_BODY_FRD)
        assert message.estimator_type == kind


@AUTOPILOTS
def test_position_is_north_east_down_of_the_autopilot_s_origin(autopilot: Autopilot) -> None:
    message = sent(estimate(), autopilot)
    assert (message.x, message.y, message.z) == pytest.approx((4, 3, -20))
    assert message.time_usec == (TAKEN + HELD[autopilot]) // 1000


@AUTOPILOTS
@given(ANGLE, TILT, ANGLE)
def test_the_velocity_turned_back_is_that_of_the_map(
    autopilot: Autopilot, roll: float, pitch: float, yaw: float
) -> None:
    message = sent(estimate(roll, pitch, yaw), autopilot)
    w, x, y, z = message.q
    turn = Rotation.from_quat([x, y, z, w])
    north, east, down = turn.apply([message.vx, message.vy, message.vz])
    assert (east, north, -down) == pytest.approx((1.0, 2.0, -0.5), abs=1e-5)
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    assert (turn * expected.inv()).magnitude() == pytest.approx(0, abs=1e-5)


# ---- covariance -----------------------------------------------------------------------------------------


@given(ANGLE, TILT, ANGLE)
def test_the_covariance_of_position_and_velocity_is_turned_into_their_axes(
    roll: float, pitch: float, yaw: float
) -> None:
    made = estimate(roll, pitch, yaw)
    message = sent(made)
    position = square(message.pose_covariance)[:3, :3]
    assert position == pytest.approx(NED_FROM_ENU @ made.pose_covariance[:3, :3] @ NED_FROM_ENU.T, abs=1e-7)
    velocity = square(message.velocity_covariance)
    body_from_enu = Rotation.from_euler("ZYX", [yaw, pitch, roll]).inv().as_matrix() @ NED_FROM_ENU
    assert velocity[:3, :3] == pytest.approx(
        body_from_enu @ made.velocity_covariance @ body_from_enu.T, abs=1e-7
    )
    assert np.isnan(velocity[3:, :]).all(), "rates of rotation are not estimated"
    assert all(math.isnan(rate) for rate in (message.rollspeed, message.pitchspeed, message.yawspeed))


@given(ANGLE, TILT, ANGLE)
def test_the_covariance_of_roll_pitch_and_yaw_is_that_of_many_turned_vehicles(
    roll: float, pitch: float, yaw: float
) -> None:
    made = estimate(roll, pitch, yaw, pose_covariance=1e-4 * spread(6))
    level = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    step = 1e-6
    jacobian = np.zeros((6, 6))
    jacobian[:3, :3] = NED_FROM_ENU
    for axis in range(3):  # a small turn about east, north or up, seen as a change of the angles
        turn = np.zeros(3)
        turn[axis] = step
        ends = [
            (Rotation.from_rotvec(sign * NED_FROM_ENU @ turn) * level).as_euler("ZYX")[::-1]
            for sign in (1.0, -1.0)
        ]
        jacobian[3:, 3 + axis] = ((ends[0] - ends[1] + np.pi) % (2 * np.pi) - np.pi) / (2 * step)
    expected = jacobian @ made.pose_covariance @ jacobian.T
    assert square(sent(made).pose_covariance) == pytest.approx(expected, rel=1e-3, abs=1e-11)


# ---- refusals -------------------------------------------------------------------------------------------


def test_the_delay_that_ardupilot_subtracts_is_that_of_its_parameter_file() -> None:
    rows = {row.name: row for row in ARDUPILOT.required(odometry=True)}
    assert rows["VISO_DELAY_MS"].value * MS == HELD[ARDUPILOT]
    assert (rows["VISO_DELAY_MS"].level, rows["VISO_DELAY_MS"].accepted) == ("needed", ())


@pytest.mark.parametrize(("autopilot", "first", "last"), [(ARDUPILOT, 200, 250), (PX4, 0, 300)])
def test_an_old_estimate_and_one_that_comes_too_early_are_not_sent(
    autopilot: Autopilot, first: int, last: int
) -> None:
    for age_ns, goes in (
        (first * MS - 1, False), (first * MS, True), (last * MS, True), (last * MS + 1, False),
    ):  # fmt: skip
        assert (sent(estimate(), autopilot, TAKEN + age_ns) is not None) == goes


@AUTOPILOTS
@pytest.mark.parametrize("axis", range(6))
def test_the_autopilot_s_own_estimate_is_not_sent_back_as_a_position(autopilot: Autopilot, axis: int) -> None:
    observed = np.ones(6, np.bool_)
    observed[axis] = False
    message = sent(estimate(observed=observed), autopilot)
    assert (message is None) == (axis < 3)
    if message is not None:
        assert message.quality == 83


@pytest.mark.parametrize("field", ["position_enu_m", "velocity_enu_ms", "quat_wxyz"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_nothing_that_is_no_number_is_sent(field: str, value: float) -> None:
    broken = getattr(estimate(), field).copy()
    broken[1] = value
    assert sent(estimate(**{field: broken})) is None


@pytest.mark.parametrize("field", ["pose_covariance", "velocity_covariance"])
def test_a_covariance_that_is_none_is_not_sent(field: str) -> None:
    good = getattr(estimate(), field)
    broken, negative, skew, wide = (good.copy() for _ in range(4))
    broken[0, 1] = math.nan
    negative[1, 1] = -1e-4
    skew[0, 1] += 1e-5
    wide[0, 0] = 101.0
    singular = np.zeros_like(good)
    for matrix in (broken, negative, skew, wide, singular):
        assert sent(estimate(**{field: matrix})) is None


def test_a_quaternion_that_is_no_rotation_and_a_pitch_that_leaves_yaw_open_are_not_sent() -> None:
    assert sent(estimate(quat_wxyz=np.zeros(4))) is None
    assert sent(estimate(pitch=math.pi / 2)) is None
    assert sent(estimate(pitch=1.56, pose_covariance=1e-8 * spread(6))) is None


def test_nothing_is_sent_to_an_autopilot_that_is_not_known_or_whose_origin_is_not() -> None:
    assert odometry_message(VehicleState(autopilot=OTHER), estimate(), ORIGIN, NOW) is None
    assert odometry_message(VehicleState(), estimate(), ORIGIN, NOW) is None
    assert odometry_message(VEHICLES[PX4], estimate(), None, NOW) is None
    assert odometry_message(VEHICLES[PX4], estimate(), ORIGIN * math.nan, NOW) is None


def test_a_map_that_began_anew_is_counted_in_eight_bits() -> None:
    assert [sent(estimate(resets=n)).reset_counter for n in (0, 255, 256, 300)] == [0, 255, 0, 44]


# ---- the stream -----------------------------------------------------------------------------------------


def flying(autopilot: Autopilot, armed: bool = True) -> VehicleState:
    return replace(
        VEHICLES[autopilot],
        armed=armed,
        position_lla=(FRAME.lat_deg, FRAME.lon_deg, FRAME.alt_m),
        velocity_ned_ms=(0.0, 0.0, 0.0),
        local_ned_m=(0.0, 0.0, 0.0),
    )


def kinds(messages: list[Any]) -> list[str]:
    return [message.get_type() for message in messages]


@AUTOPILOTS
def test_each_estimate_is_sent_once_at_its_time_and_thirty_a_second_at_most(autopilot: Autopilot) -> None:
    stream, vehicle, ages, times = OdometryStream(), flying(autopilot), [], []
    for step in range(600):  # estimates of 10 ms, looked for each 2 ms, 50 ms old
        now = NOW + 2 * step * MS
        taken = now - now % (10 * MS) - 50 * MS
        made = estimate(stamp_ns=taken, position_enu_m=np.array([1.0, 2.0, 3.0]))
        for message in stream.due(vehicle, made, FRAME, now):
            if message.get_type() == "ODOMETRY":
                times.append(message.time_usec)
                ages.append(now - 1000 * message.time_usec + HELD[autopilot])
                assert (message.x, message.y, message.z) == pytest.approx((2, 1, -3), abs=1e-6)
    assert len(times) == len(set(times)) == (27 if autopilot is ARDUPILOT else 30)
    assert np.diff(times).min() >= 33_000
    assert set(ages) == ({200 * MS} if autopilot is ARDUPILOT else {50 * MS})


def test_an_estimate_older_than_the_last_is_not_sent() -> None:
    stream = OdometryStream()
    assert len(stream.due(flying(PX4), estimate(stamp_ns=NOW), FRAME, NOW)) == 1
    assert stream.due(flying(PX4), estimate(stamp_ns=NOW - 100 * MS), FRAME, NOW) == []


def test_an_estimate_that_waited_too_long_is_not_sent() -> None:
    stream, vehicle = OdometryStream(), flying(ARDUPILOT)
    assert stream.due(vehicle, estimate(), FRAME, TAKEN + 100 * MS) == []
    assert stream.due(vehicle, None, FRAME, TAKEN + 251 * MS) == []


def test_nothing_is_sent_without_a_map_frame_or_a_local_origin() -> None:
    assert OdometryStream().due(flying(PX4), estimate(), None, NOW) == []
    assert OdometryStream().due(VehicleState(autopilot=PX4), estimate(), FRAME, NOW) == []
    assert kinds(OdometryStream().due(flying(PX4), estimate(), FRAME, NOW)) == ["ODOMETRY"]


def test_ardupilot_is_shown_the_clock_with_estimates_once_a_second_and_on_the_ground_ten_times() -> None:
    for armed, made, count in ((True, True, 2), (True, False, 0), (False, False, 20), (False, True, 20)):
        stream, clocks = OdometryStream(), 0
        for step in range(100):
            now = TAKEN + 20 * step * MS
            given_estimate = estimate(stamp_ns=now - now % (100 * MS)) if made else None
            due = stream.due(flying(ARDUPILOT, armed), given_estimate, FRAME, now)
            shown = [m for m in due if m.get_type() == "VISION_SPEED_ESTIMATE"]
            assert all(m.usec == now // 1000 for m in shown)
            clocks += len(shown)
        assert clocks == count
        assert stream.due(flying(PX4, armed), None, FRAME, NOW) == []


def test_the_clock_message_carries_no_velocity() -> None:
    message = clock_message(NOW)
    message = mavlink.MAVLink(None).parse_buffer(message.pack(mavlink.MAVLink(None)))[0]
    assert all(math.isnan(value) for value in (message.x, message.y, message.z, *message.covariance))
