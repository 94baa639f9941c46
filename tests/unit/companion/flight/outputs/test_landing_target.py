"""LANDING_TARGET: each autopilot's frame and angle convention, nothing from an old pose."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from companion.flight.landing.executive import Phase
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.outputs.landing_status import PHASES, POINTS, Status, status_messages
from companion.flight.outputs.landing_target import landing_target, local_origin_enu_m
from slz import PointState
from slz.frame import LocalFrame
from tests import REPOSITORY
from tests.unit.companion.flight.outputs.pose import Pose, pose

S = 1_000_000_000
COORDINATE = st.floats(-200, 200)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)
ANGLE = st.floats(-math.pi, math.pi)
COPTER = VehicleState(sysid=1, autopilot=ARDUPILOT)
FRAME = LocalFrame(47.0, 8.0, 400.0)


def px4(local_ned_m: tuple[float, float, float]) -> VehicleState:
    """Return a PX4 at the origin of the map that gives itself this local position."""
    return VehicleState(
        sysid=1,
        autopilot=PX4,
        position_lla=(FRAME.lat_deg, FRAME.lon_deg, FRAME.alt_m),
        velocity_ned_ms=(0.0, 0.0, 0.0),
        local_ned_m=local_ned_m,
    )


def target(point: Any, at: Pose, vehicle: VehicleState = COPTER, **kwargs: Any) -> Any:
    options = {"now_ns": 10 * S, "pose_timeout_s": 0.5, "frame": FRAME} | kwargs
    return landing_target(vehicle, point, at, **options)


def test_a_point_ahead_and_below_of_a_vehicle_that_faces_east() -> None:
    message = target((13, 5, 2), pose((10, 5, 12), yaw=math.pi / 2))
    assert (message.frame, message.position_valid) == (mavlink.MAV_FRAME_BODY_FRD, 1)
    assert (message.x, message.y, message.z) == pytest.approx((3, 0, 10), abs=1e-9)
    assert message.distance == pytest.approx(math.sqrt(109))
    assert message.time_usec == 10_000_000


@given(POINT, POINT, ANGLE, ANGLE, ANGLE)
def test_the_body_vector_turned_back_is_the_way_to_the_point(
    point: Any, position: Any, roll: float, pitch: float, yaw: float
) -> None:
    below = np.array(point) - (0.0, 0.0, 1000.0)
    turn = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    message = target(below, pose(position, roll, pitch, yaw))
    north, east, down = turn.apply([message.x, message.y, message.z])
    there = np.add(position, (east, north, -down))
    if turn.inv().apply([0.0, 0.0, 1.0])[2] < 0.5 or message.z < 0.011:
        below[2] = there[2]  # of a vehicle that lies on its side the height is another
    assert there == pytest.approx(below, abs=0.011)
    assert message.distance > 0


@pytest.mark.parametrize("roll", [0.0, 0.2])
def test_a_point_above_the_vehicle_is_sent_below_it_at_its_place(roll: float) -> None:
    """ArduPilot drops a target that is not below, and calls it lost where the vehicle touches down."""
    message = target((11, 5, 12.4), pose((10, 5, 12), roll=roll))
    north, east, down = Rotation.from_euler("x", roll).apply([message.x, message.y, message.z])
    assert (north, east) == pytest.approx((0.0, 1.0))
    assert message.z == pytest.approx(0.01)
    assert down < 0.5


@given(POINT, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_ardupilot_s_reading_of_the_angles_gives_the_same_direction(
    position: Any, roll: float, pitch: float
) -> None:
    message = target(np.add(position, (1.0, 2.0, -20.0)), pose(position, roll, pitch, 1.0))
    seen = np.array([-math.tan(message.angle_y), math.tan(message.angle_x), 1.0])
    body = np.array([message.x, message.y, message.z])
    assert seen / np.linalg.norm(seen) == pytest.approx(body / np.linalg.norm(body), abs=1e-6)


def test_on_the_point_the_distance_is_still_positive() -> None:
    message = target((1, 2, 3), pose((1, 2, 3)))
    assert message.distance > 0
    assert (message.x, message.y, message.z) == (0, 0, pytest.approx(0.01))


def test_px4_gets_its_local_frame_and_our_own_clock() -> None:
    message = target((3, 4, -10), pose((0, 0, 0)), px4((100.0, 200.0, -30.0)))
    assert message.frame == mavlink.MAV_FRAME_LOCAL_NED
    assert (message.x, message.y, message.z) == pytest.approx((104, 203, -20), abs=1e-6)
    assert message.time_usec == 10_000_000


def test_px4_gets_nothing_while_its_origin_is_unknown() -> None:
    assert target((3, 4, -10), pose((0, 0, 0)), VehicleState(autopilot=PX4)) is None
    assert target((3, 4, -10), pose((0, 0, 0)), px4((1.0, 2.0, 3.0)), frame=None) is None


def test_no_target_from_a_stale_or_broken_pose() -> None:
    assert target((0, 0, 0), pose((0, 0, 9)), now_ns=10 * S + S // 2) is not None
    assert target((0, 0, 0), pose((0, 0, 9)), now_ns=10 * S + S // 2 + 1) is None
    assert target((0, 0, math.nan), pose((0, 0, 9))) is None
    assert target((0, 0, 0), pose((math.inf, 0, 9))) is None


def test_the_stamp_is_never_zero() -> None:
    assert target((0, 0, 0), pose((0, 0, 9), stamp_ns=0), now_ns=0).time_usec == 1


def test_the_local_origin_is_found_from_positions_of_different_times() -> None:
    lat, lon, alt = FRAME.lla([30.0, 20.0, 10.0])
    state = VehicleState(
        position_lla=(float(lat), float(lon), float(alt)),
        position_boot_ms=5100,
        velocity_ned_ms=(4.0, 0.0, -1.0),
        local_ned_m=(14.6, 5.0, -3.9),  # 0.1 s earlier: 0.4 m farther south, 0.1 m lower
        local_boot_ms=5000,
    )
    assert local_origin_enu_m(FRAME, state) == pytest.approx([25.0, 5.0, 6.0], abs=1e-6)


def test_positions_too_far_apart_in_time_give_no_origin() -> None:
    state = VehicleState(
        position_lla=(47.0, 8.0, 400.0),
        position_boot_ms=5300,
        velocity_ned_ms=(0.0, 0.0, 0.0),
        local_ned_m=(0.0, 0.0, 0.0),
        local_boot_ms=5000,
    )
    assert local_origin_enu_m(FRAME, state) is None


# Status stream: names that fit, numbers that the documentation explains, no unknown values.


STATUS = Status("descend", 3, 17.0, "safe", 0.99, 12.5, 210.0, 0, 0.3)
DOCUMENT = REPOSITORY / "docs" / "mavlink.md"


def told(status: Status) -> dict[str, float]:
    return {m.name: m.value for m in status_messages(status, 1234)}


def test_every_value_has_a_name_of_ten_bytes_at_most_and_is_documented() -> None:
    messages = status_messages(STATUS, 2**32 + 1234)
    assert all(len(m.name) <= 10 and m.time_boot_ms == 1234 for m in messages)
    documented = set(re.findall(r"^\| `(SLZ_[A-Z]+)` \|", DOCUMENT.read_text("utf-8"), re.MULTILINE))
    assert {m.name for m in messages} == documented


def test_phases_and_points_are_told_by_number() -> None:
    assert told(STATUS)["SLZ_PHASE"] == 3
    assert told(STATUS)["SLZ_POINT"] == 1
    assert told(replace(STATUS, phase="dance"))["SLZ_PHASE"] == -1
    assert {phase.value for phase in Phase} <= set(PHASES)
    assert {state.value for state in PointState} == set(POINTS[1:])


def test_what_is_unknown_is_not_told() -> None:
    unknown = Status("idle", 0, math.nan, "none", math.nan, math.inf, math.nan, 2, math.nan)
    assert told(unknown) == {"SLZ_PHASE": 0, "SLZ_ZONES": 0, "SLZ_POINT": 0, "SLZ_DROPS": 2}
