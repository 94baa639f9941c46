"""Pose sources of an attached LiDAR, and refused poses."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.attached.pose_source import Pose, PoseSource, streams
from tests.unit.sitl.autopilot_messages import HOME, LEVEL, Sender, beside_home

PX4 = mavlink.MAV_AUTOPILOT_PX4


def poses(source: PoseSource, *frames: bytes) -> list[Pose]:
    codec = mavlink.MAVLink(None)
    messages = [message for frame in frames for message in codec.parse_buffer(bytearray(frame))]
    taken = [source.on_message(message) for message in messages]
    return [pose for pose in taken if pose is not None]


def test_the_true_pose_of_ardupilot_has_the_time_of_the_attitude_before_it() -> None:
    source, sender = PoseSource(), Sender()
    quat = np.array([math.cos(0.1), math.sin(0.1), 0.0, 0.0])
    frames = (
        sender.heartbeat(),
        sender.sim_state(HOME),  # no stamp yet
        sender.attitude(5000, LEVEL),
        sender.sim_state(HOME, quat),
    )
    (pose,) = poses(source, *frames)
    assert pose.boot_ns == 5_000_000_000
    assert pose.quat_wxyz == pytest.approx(quat, abs=1e-6)
    assert pose.lla == pytest.approx(HOME, abs=1e-6)
    assert source.source == "SIM_STATE"
    assert source.standing_m == pytest.approx(0.1)


def test_the_true_pose_of_px4_has_its_own_stamp() -> None:
    source, sender = PoseSource(), Sender(PX4)
    (pose,) = poses(source, sender.heartbeat(), sender.hil_state(7_123_456, HOME))
    assert pose.boot_ns == 7_123_456_000
    assert source.standing_m == 0


def test_without_a_stamp_it_has_the_time_of_the_attitude_before_it() -> None:
    source, sender = PoseSource(), Sender(PX4)
    frames = (
        sender.heartbeat(),
        sender.hil_state(0, HOME),  # no stamp yet
        sender.attitude(7332),
        sender.hil_state(0, HOME),
    )
    (pose,) = poses(source, *frames)
    assert pose.boot_ns == 7_332_000_000


def test_the_estimate_serves_when_no_true_pose_comes() -> None:
    source, sender = PoseSource(), Sender()
    first = poses(source, sender.heartbeat(), sender.attitude(1000), sender.global_position(1000, HOME))
    assert first == []
    turning = sender.attitude(4000, LEVEL, (0.0, 0.0, 1.0))
    (pose,) = poses(source, turning, sender.global_position(4010, HOME))
    assert source.source == "GLOBAL_POSITION_INT"
    assert 2 * math.atan2(pose.quat_wxyz[3], pose.quat_wxyz[0]) == pytest.approx(0.01, abs=1e-6)


def test_the_estimate_is_left_once_the_truth_comes() -> None:
    source, sender = PoseSource(), Sender()
    poses(source, sender.heartbeat(), sender.attitude(1000), sender.global_position(1000, HOME))
    assert len(poses(source, sender.attitude(4500), sender.global_position(4500, HOME))) == 1
    assert len(poses(source, sender.attitude(4510), sender.sim_state(HOME))) == 1
    assert poses(source, sender.global_position(4520, HOME)) == []


def test_only_the_first_autopilot_heard_counts() -> None:
    source, sender, other = PoseSource(), Sender(), Sender(PX4, system=9)
    assert poses(source, sender.heartbeat(), other.heartbeat(armed=True), other.hil_state(1, HOME)) == []
    assert (source.kind, source.sysid, source.armed) == ("ardupilot", 1, False)


@pytest.mark.parametrize(
    "frame",
    [
        Sender().sim_state((0.0, 0.0, 10.0)),
        Sender().sim_state((*HOME[:2], math.nan)),
        Sender().sim_state(HOME, np.zeros(4)),
        Sender().sim_state(HOME, np.array([math.nan, 0.0, 0.0, 0.0])),
    ],
)
def test_what_is_no_pose_is_refused(frame: bytes) -> None:
    source, sender = PoseSource(), Sender()
    assert poses(source, sender.heartbeat(), sender.attitude(1), frame) == []


def test_home_and_landed_state_are_kept_until_a_restart() -> None:
    source, sender = PoseSource(), Sender()
    poses(source, sender.heartbeat(armed=True), sender.home(), sender.landed(mavlink.MAV_LANDED_STATE_IN_AIR))
    assert source.home_lla == pytest.approx(HOME)
    assert source.on_ground is False
    poses(source, sender.landed(0))
    assert source.on_ground is None
    source.restart()
    assert (source.home_lla, source.armed, source.sysid) == (None, False, 1)


def test_each_autopilot_is_asked_for_its_own_true_pose() -> None:
    true = {mavlink.MAVLINK_MSG_ID_SIM_STATE, mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION}
    asked = {kind: true & {s.message_id for s in streams(kind)} for kind in ("ardupilot", "px4", "other")}
    assert asked["ardupilot"] == {mavlink.MAVLINK_MSG_ID_SIM_STATE}
    assert asked["px4"] == {mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION}
    assert asked["other"] == set()


def test_places_survive_the_wire() -> None:
    source, sender = PoseSource(), Sender()
    place = beside_home(12.0, -7.0, 30.0)
    (pose,) = poses(source, sender.heartbeat(), sender.attitude(1), sender.sim_state(place))
    assert pose.lla == pytest.approx(place, abs=1e-4)


@pytest.mark.parametrize("kind", [5, 10])
def test_a_tracker_or_rover_heard_first_is_not_followed(kind: int) -> None:
    source, tracker, sender = PoseSource(), Sender(system=2), Sender()
    beat = tracker.pack(mavlink.MAVLink_heartbeat_message(kind, 3, 81, 0, 4, 3))
    assert poses(source, beat, tracker.attitude(5000), tracker.sim_state(HOME)) == []
    assert len(poses(source, sender.heartbeat(), sender.attitude(5000), sender.sim_state(HOME))) == 1
    assert source.sysid == 1
