"""Recorded sensors: decoded as in flight; undecodable messages affect only themselves."""

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.desk.replay.own_replay import Replay
from companion.desk.replay.recorded_sensors import RecordedSensors
from companion.desk.replay.recording_reader import Header, Raw
from companion.flight.link.command_server import CommandServer
from companion.flight.recorder import journal
from companion.flight.recorder.journal import BadRecordError
from companion.flight.sensors.returns import Returns
from params import Parameters

HEADER = Header("livox", Parameters().model_dump(mode="json"), 0, odometry="/odom")
WITH_ODOMETRY = Parameters(odometry="map")
BROKEN = [
    Raw(journal.MAVLINK_IN, 1, b""),
    Raw(journal.MAVLINK_IN, 1, b"\xfd\x01"),
    Raw(journal.MAVLINK_IN, 1, np.random.default_rng(1).bytes(60)),
    Raw(journal.LIDAR, 1, b"\0" * 5),
    Raw(journal.ODOMETRY, 1, b"\0" * 5),
    Raw(journal.EVENT, 1, b"[]"),
    Raw(journal.EVENT, 1, b"\xff"),
]


@pytest.mark.parametrize("message", BROKEN)
def test_a_message_that_cannot_be_read_says_so(message: Raw) -> None:
    with pytest.raises(BadRecordError):
        RecordedSensors(HEADER, WITH_ODOMETRY, lambda _returns: None).on_message(message)


@pytest.mark.parametrize(
    "message", [*BROKEN, Raw(journal.GAP, 1, b"null"), Raw(journal.GAP, 1, b'{"lost": "x"}')]
)
def test_a_replay_counts_it_and_goes_on(message: Raw) -> None:
    replay = Replay(HEADER, WITH_ODOMETRY)
    assert replay.process_message(message) is None
    assert replay.outcome.bad == 1


SECOND = 1_000_000_000


def heard(message: Any, at_ns: int, system: int = 1) -> Raw:
    """Return a message as it was recorded, of the autopilot or of another system."""
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=1 if system == 1 else 190)
    return Raw(journal.MAVLINK_IN, at_ns, bytes(message.pack(sender)))


HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3)
LEVEL = mavlink.MAVLink_attitude_quaternion_message(1000, 1, 0, 0, 0, 0, 0, 0)
BELOW = mavlink.MAVLink_distance_sensor_message(1000, 20, 5000, 800, 0, 1, 25, 0)


def test_ranges_that_came_over_mavlink_are_returns_again() -> None:
    found: list[Returns] = []
    header = Header("mavlink", HEADER.values, 0)
    sensors = RecordedSensors(header, Parameters(), found.append)
    sensors.on_message(heard(BELOW, SECOND))  # before anybody knows whose it is
    assert not found
    sensors.on_message(heard(HEARTBEAT, 2 * SECOND))
    sensors.on_message(heard(LEVEL, 3 * SECOND))  # from poses it is known what time it is
    sensors.on_message(heard(BELOW, 3 * SECOND))
    sensors.on_message(heard(BELOW, 4 * SECOND, system=2))  # another vehicle's
    sensors.on_message(Raw(journal.LIDAR, 5 * SECOND, journal.pack_batch([(0, b"a packet of no sensor")])))
    assert len(found) == 1
    assert np.linalg.norm(found[0].xyz_sensor_m) == pytest.approx(8.0, abs=0.5)
    assert found[0].stamp_ns.tolist() == [3 * SECOND]
    assert sensors.vehicle.sysid == 1


def test_ranges_beside_a_lidar_with_packets_of_its_own_are_none_of_it() -> None:
    found: list[Returns] = []
    sensors = RecordedSensors(HEADER, Parameters(), found.append)
    sensors.on_message(heard(HEARTBEAT, 2 * SECOND))
    sensors.on_message(heard(BELOW, 3 * SECOND))
    assert not found


def test_after_a_reboot_of_the_autopilot_poses_are_of_another_epoch() -> None:
    """Where its estimate begins anew nobody knows, even if its stamps go on."""
    sensors = RecordedSensors(HEADER, Parameters(), lambda _returns: None)
    sensors.on_message(heard(HEARTBEAT, SECOND))
    epochs = []
    rebooted = [(100 + 50 * k, 3000 + 50 * k) for k in range(105)]
    for boot_ms, at_ms in ((60_000, 1000), (60_020, 1020), *rebooted):
        at_ns = at_ms * 1_000_000
        place = mavlink.MAVLink_global_position_int_message(
            boot_ms, 470_000_000, 80_000_000, 4000, 0, 0, 0, 0, 0
        )
        attitude = mavlink.MAVLink_attitude_quaternion_message(boot_ms, 1, 0, 0, 0, 0, 0, 0)
        sensors.on_message(heard(attitude, at_ns))
        sensors.on_message(heard(place, at_ns))
        pose = sensors.history.latest(at_ns)
        epochs.append(None if pose is None else pose.epoch)
    assert epochs[:2] == [0, 0]
    assert epochs[-1] == 1
    assert sensors.history.jumps == 0


@pytest.mark.parametrize(
    "order",
    [
        mavlink.MAVLink_command_long_message(1, 191, mavlink.MAV_CMD_USER_1, 0, 1, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_command_int_message(1, 191, 0, mavlink.MAV_CMD_USER_1, 0, 0, 1, 0, 0, 0, 0, 0, 0),
    ],
)
def test_an_operator_s_order_is_not_carried_out_again(monkeypatch: pytest.MonkeyPatch, order: Any) -> None:
    """What came of it, the windows tell."""
    asked: list[Any] = []
    monkeypatch.setattr(CommandServer, "handle_command", lambda _server, message, *_: asked.append(message))
    replay = Replay(HEADER, Parameters())
    replay.process_message(heard(HEARTBEAT, SECOND))
    before = replay.vehicle
    assert replay.process_message(heard(order, 2 * SECOND, system=255)) is None
    assert asked == []
    assert replay.vehicle is before
    assert (replay.outcome.bad, replay.outcome.windows) == (0, 0)


@pytest.mark.parametrize(("kind", "diagnosed"), [("livox", True), ("ros2", False), ("mavlink", False)])
def test_packets_of_a_sensor_are_diagnosed_and_clouds_of_a_driver_are_not(kind: str, diagnosed: bool) -> None:
    sensors = RecordedSensors(Header(kind, HEADER.values, 0), Parameters(), lambda _returns: None)
    assert (sensors.diagnosis is not None) is diagnosed
