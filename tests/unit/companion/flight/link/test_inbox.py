"""Messages of other systems, or with too little content, which are ignored."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.command_server import CommandServer
from companion.flight.link.inbox import Inbox
from companion.flight.link.wire.codec import Codec
from tests.unit.companion.flight.link.messages import ARMED, attitude, heartbeat, position, received

S = 1_000_000_000
US = 191
LAND = mavlink.MAV_CMD_NAV_LAND


class Desk:
    """An inbox that has heard its vehicle, and what it said since."""

    def __init__(self) -> None:
        self.server = CommandServer()
        self.inbox = Inbox(Codec(US), self.server)
        self.said: list[str] = []
        self.inbox.on_acknowledgement.subscribe(lambda *_: self.said.append("acknowledged"))
        self.inbox.on_attitude.subscribe(lambda *_: self.said.append("attitude"))
        self.inbox.on_position.subscribe(lambda *_: self.said.append("position"))
        self.inbox.on_message(heartbeat(), S)

    def hear(self, message: Any, now_ns: int = 2 * S) -> list[str]:
        self.said.clear()
        self.inbox.on_message(message, now_ns)
        return self.said


@pytest.mark.parametrize(
    ("system", "component", "ours"),
    [(0, 0, True), (1, US, True), (1, 0, True), (255, 190, False), (1, 190, False), (2, US, False)],
)
def test_the_answer_to_somebody_else_s_command_is_not_ours(system: int, component: int, ours: bool) -> None:
    message = mavlink.MAVLink_command_ack_message(LAND, 0, 255, 0, system, component)
    assert Desk().hear(received(message)) == ["acknowledged"] * ours


@pytest.mark.parametrize(("kind", "name"), [(attitude, "attitude"), (position, "position")])
def test_a_pose_whose_stamp_cannot_be_is_kept_and_not_told(kind: Any, name: str) -> None:
    desk = Desk()
    assert desk.hear(kind(1000)) == [name]
    assert desk.hear(kind(1100), 62 * S) == []  # a minute under way
    assert desk.inbox.clock.implausible == 1


GIMBAL = mavlink.MAV_COMP_ID_GIMBAL
OF_OTHER_COMPONENTS = [
    mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GIMBAL, 8, ARMED, 9, 3, 3),
    mavlink.MAVLink_attitude_quaternion_message(5000, 0.7071, 0, 0.7071, 0, 0, 0, 0),
    mavlink.MAVLink_global_position_int_message(5000, 10_000_000, 20_000_000, 0, 0, 0, 0, 0, 0),
    mavlink.MAVLink_local_position_ned_message(5000, 1, 2, 3, 0, 0, 0),
    mavlink.MAVLink_system_time_message(0, 1),
    mavlink.MAVLink_extended_sys_state_message(0, 1),
    mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 10_000, 0, 1, 0, 0, 0, 0, 0, 0),
    mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, 1),
    mavlink.MAVLink_home_position_message(1, 2, 3, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0),
    mavlink.MAVLink_timesync_message(0, 5),
    mavlink.MAVLink_timesync_message(7, 5),
    mavlink.MAVLink_command_ack_message(LAND, 4, 255, 0, 1, US),
    mavlink.MAVLink_param_value_message(b"RTL_ALT", 1.0, 9, 1, 0),
]


@pytest.mark.parametrize("message", OF_OTHER_COMPONENTS, ids=lambda message: str(message.get_type()))
def test_a_message_of_another_component_of_the_vehicle_s_system_tells_nothing_of_the_vehicle(
    message: Any,
) -> None:
    desk = Desk()
    desk.inbox.on_answer.subscribe(lambda _: desk.said.append("answered"))
    desk.hear(attitude(4000))
    before = desk.inbox.vehicle
    assert desk.hear(received(message, 1, GIMBAL)) == []
    assert not desk.inbox.on_message(received(message, 1, GIMBAL), 3 * S)
    assert desk.inbox.vehicle is before
    assert desk.inbox.clock.timesync.strays == 0


def test_a_heartbeat_of_component_one_that_is_no_autopilot_s_does_not_change_the_mode() -> None:
    """A program that left its component at 1 would let the vehicle look disarmed, or in another mode."""
    desk = Desk()
    desk.inbox.on_message(heartbeat(base_mode=ARMED, custom_mode=4, sequence=1), 2 * S)
    for kind, autopilot in ((mavlink.MAV_TYPE_GCS, 3), (2, mavlink.MAV_AUTOPILOT_INVALID)):
        desk.inbox.on_message(heartbeat(kind=kind, autopilot=autopilot, sequence=2), 2 * S)
    assert (desk.inbox.vehicle.armed, desk.inbox.vehicle.mode) == (True, "GUIDED")
