"""Scripted ground station: acts by messages only, and retries everything."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.autopilot.pilot import Pilot
from sitl.wire.wire import MemoryWire

SECOND_NS = 1_000_000_000
LANDED, FLYING, RISING = (
    mavlink.MAV_LANDED_STATE_ON_GROUND,
    mavlink.MAV_LANDED_STATE_IN_AIR,
    mavlink.MAV_LANDED_STATE_TAKEOFF,
)


class Vehicle:
    """What the pilot is told, and the commands it gave."""

    def __init__(self) -> None:
        self.wire = MemoryWire("pilot")
        self.pilot = Pilot(self.wire, 30.0)
        self._codec: Any = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._reader: Any = mavlink.MAVLink(None)
        self.now_ns = 0
        self.heartbeats: list[Any] = []

    def tell(self, message: Any, component: int = 1) -> None:
        self._codec.srcComponent = component
        self.wire.received.append(bytes(message.pack(self._codec)))

    def state(self, mode: Mode, *, armed: bool, landed: int, component: int = 1) -> None:
        flags = 1 | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
        self.tell(mavlink.MAVLink_heartbeat_message(2, 3, flags, int(mode), 4, 3), component)
        self.tell(mavlink.MAVLink_extended_sys_state_message(0, landed), component)

    def commands(self, seconds: float = 1.0) -> list[Any]:
        """Let time pass; return the commands of it."""
        end = self.now_ns + round(seconds * SECOND_NS)
        while self.now_ns < end:
            self.pilot.on_tick(self.now_ns)
            self.now_ns += SECOND_NS // 100
        data = b"".join(part for _, part in self.wire.poll())
        messages = self._reader.parse_buffer(bytearray(data)) or []
        assert all((m.get_srcSystem(), m.get_srcComponent()) == (255, 190) for m in messages)
        self.heartbeats += [m for m in messages if m.get_type() == "HEARTBEAT"]
        return [m for m in messages if m.get_type() == "COMMAND_LONG"]


def test_it_asks_for_guided_again_each_second_until_it_has_it() -> None:
    vehicle = Vehicle()
    vehicle.state(Mode.STABILIZE, armed=False, landed=LANDED)
    asked = vehicle.commands(5)
    assert [m.command for m in asked] == [mavlink.MAV_CMD_DO_SET_MODE] * 5
    assert {(m.target_system, m.target_component, m.param1, m.param2) for m in asked} == {(1, 1, 1, 4)}


def test_it_arms_in_guided_and_takes_off_once_armed() -> None:
    vehicle = Vehicle()
    vehicle.state(Mode.GUIDED, armed=False, landed=LANDED)
    (arm,) = vehicle.commands()
    assert (arm.command, arm.param1) == (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    vehicle.state(Mode.GUIDED, armed=True, landed=LANDED)
    (rise,) = vehicle.commands()
    assert (rise.command, rise.param7) == (mavlink.MAV_CMD_NAV_TAKEOFF, 30.0)


def test_it_waits_while_the_vehicle_climbs() -> None:
    vehicle = Vehicle()
    vehicle.state(Mode.GUIDED, armed=True, landed=RISING)
    assert vehicle.commands(5) == []
    assert not vehicle.pilot.done


def test_a_vehicle_that_disarms_before_it_rose_is_armed_again() -> None:
    vehicle = Vehicle()
    vehicle.state(Mode.GUIDED, armed=True, landed=LANDED)
    vehicle.commands()
    vehicle.state(Mode.GUIDED, armed=False, landed=LANDED)
    assert [m.command for m in vehicle.commands()] == [mavlink.MAV_CMD_COMPONENT_ARM_DISARM]


@pytest.mark.parametrize("mode", [Mode.GUIDED, Mode.LAND, Mode.LOITER, Mode.STABILIZE])
def test_in_the_air_it_only_watches_whatever_the_mode_becomes(mode: Mode) -> None:
    vehicle = Vehicle()
    vehicle.state(Mode.GUIDED, armed=True, landed=FLYING)
    vehicle.commands()
    assert vehicle.pilot.done
    vehicle.state(mode, armed=False, landed=LANDED)
    assert vehicle.commands(5) == []


def test_its_heartbeat_beats_once_a_second_to_the_end() -> None:
    vehicle = Vehicle()
    vehicle.state(Mode.GUIDED, armed=True, landed=FLYING)
    vehicle.commands(10)
    assert len(vehicle.heartbeats) == 10
    assert {m.type for m in vehicle.heartbeats} == {mavlink.MAV_TYPE_GCS}


def test_the_companions_heartbeat_is_not_taken_for_the_autopilots() -> None:
    vehicle = Vehicle()
    vehicle.state(Mode.GUIDED, armed=True, landed=LANDED)
    vehicle.state(Mode.STABILIZE, armed=False, landed=FLYING, component=191)
    vehicle.commands()
    assert (vehicle.pilot.mode, vehicle.pilot.armed) == (Mode.GUIDED, True)
    assert not vehicle.pilot.done


def test_it_keeps_what_it_was_told_and_answered() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_statustext_message(6, b"SLZ: landing", 0, 0), component=191)
    vehicle.tell(mavlink.MAVLink_command_ack_message(22, 4))
    vehicle.wire.received.append(b"\xfd garbage")
    vehicle.commands()
    assert (vehicle.pilot.heard, vehicle.pilot.acks) == (["SLZ: landing"], [(22, 4)])


def test_it_keeps_who_called_it_at_critical() -> None:
    vehicle = Vehicle()
    vehicle.tell(mavlink.MAVLink_statustext_message(2, b"EKF variance", 0, 0))
    vehicle.tell(mavlink.MAVLink_statustext_message(2, b"SLZ: ta", 1, 0), component=191)
    vehicle.tell(mavlink.MAVLink_statustext_message(2, b"ke over", 1, 1), component=191)
    vehicle.tell(mavlink.MAVLink_statustext_message(4, b"SLZ: LiDAR lost", 0, 0), component=191)
    vehicle.commands()
    assert list(vehicle.pilot.calls) == [(1, "EKF variance"), (191, "SLZ: take over")]
