"""Identification of the vehicle among several MAVLink systems."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.command_server import CommandServer
from companion.flight.link.inbox import Inbox
from companion.flight.link.vehicle_class import type_name
from companion.flight.link.vehicle_identity import LISTEN_NS, NOT_AIRCRAFT, VehicleIdentity
from companion.flight.link.wire.codec import Codec
from tests.unit.companion.flight.link.messages import ARMED, heartbeat, received

S = 1_000_000_000
TRACKER, ROVER, COPTER = mavlink.MAV_TYPE_ANTENNA_TRACKER, mavlink.MAV_TYPE_GROUND_ROVER, 2


class Line:
    """An inbox, and what it said of the vehicle."""

    def __init__(self, **known: Any) -> None:
        self.codec = Codec(191)
        self.inbox = Inbox(self.codec, CommandServer(), VehicleIdentity(listen_ns=LISTEN_NS, **known))
        self.strangers: list[int] = []
        self.positions: list[float] = []
        self.sent: list[Any] = []
        self.inbox.on_stranger.subscribe(lambda candidate: self.strangers.append(candidate.system))
        self.inbox.on_position.subscribe(lambda _stamp, lat, *_: self.positions.append(round(lat)))
        self.inbox.on_answer.subscribe(self.sent.append)

    def beat(self, at_s: float, system: int = 1, kind: int = COPTER, base_mode: int = 1) -> None:
        self.inbox.on_message(heartbeat(system=system, kind=kind, base_mode=base_mode), round(at_s * S))

    def place(self, at_s: float, system: int, component: int = 1) -> None:
        """Let a system tell a position on the latitude of its own number."""
        place = mavlink.MAVLink_global_position_int_message(
            round(at_s * 1000), system * 10_000_000, 80_000_000, 0, 0, 0, 0, 0, 0
        )
        self.inbox.on_message(received(place, system, component), round(at_s * S))

    @property
    def vehicle(self) -> int | None:
        return self.inbox.vehicle.sysid


def test_the_only_aircraft_is_the_vehicle_once_it_was_listened_for_long_enough() -> None:
    line = Line()
    for at_s in (0.0, 1.0, 2.0):
        line.beat(at_s, system=7)
        assert line.vehicle is None
    assert line.codec.system_id == 1
    line.inbox.confirm_vehicle(LISTEN_NS)
    assert (line.vehicle, line.codec.system_id) == (7, 7)
    assert not line.inbox.identity.ambiguous


def test_poses_are_taken_from_the_beginning_and_nothing_is_answered_before_it_is_the_vehicle() -> None:
    line = Line()
    line.beat(0.0, system=3)
    line.place(0.1, 3)
    asked = mavlink.MAVLink_timesync_message(0, 5)
    line.inbox.on_message(received(asked, 3), S)
    assert (line.positions, line.sent) == ([3], [])
    line.inbox.confirm_vehicle(3 * S)
    line.inbox.on_message(received(asked, 3), 3 * S)
    assert len(line.sent) == 1


@pytest.mark.parametrize("kind", sorted(NOT_AIRCRAFT))
def test_what_is_no_aircraft_is_never_the_vehicle(kind: int) -> None:
    line = Line()
    for at_s in range(10):
        line.beat(at_s, system=2, kind=kind)
        line.place(at_s + 0.1, 2)
    assert (line.vehicle, line.positions) == (None, [])
    line.beat(10.0)
    line.place(10.1, 1)
    line.inbox.confirm_vehicle(13 * S)
    assert (line.vehicle, line.positions, line.strangers) == (1, [1], [])


@pytest.mark.parametrize("kind", [0, 1, 2, 4, 13, 14, 15, 21, 29, 43])
def test_whatever_may_be_an_aircraft_can_be_the_vehicle(kind: int) -> None:
    line = Line()
    line.beat(0.0, kind=kind)
    line.inbox.confirm_vehicle(3 * S)
    assert line.vehicle == 1


def test_two_aircraft_at_the_start_are_ambiguous_and_both_are_named() -> None:
    line = Line()
    line.beat(0.0, system=4)
    line.beat(2.4, system=2, kind=mavlink.MAV_TYPE_HELICOPTER)
    for at_s in range(3, 30):
        line.beat(at_s, system=4)
    assert line.vehicle is None
    assert line.inbox.identity.ambiguous
    said = str(line.inbox.identity.error())
    assert "system 2 (helicopter) and system 4 (quadrotor)" in said
    assert "--system" in said


def test_one_heard_later_is_told_once_and_changes_nothing() -> None:
    line = Line()
    line.beat(0.0, system=4)
    line.inbox.confirm_vehicle(3 * S)
    for at_s in range(3, 30):
        line.beat(at_s, system=2)
        line.place(at_s, 2)
    assert (line.vehicle, line.strangers, line.positions) == (4, [2], [])
    assert not line.inbox.identity.ambiguous


@pytest.mark.parametrize("kind", [COPTER, ROVER, TRACKER])
def test_the_system_that_was_named_is_the_vehicle_at_once_whoever_else_is_heard(kind: int) -> None:
    line = Line(named=9)
    line.beat(0.0, system=4)
    line.place(0.1, 4)
    assert line.vehicle is None
    line.beat(0.2, system=9, kind=kind)
    line.place(0.3, 9)
    assert (line.vehicle, line.positions) == (9, [9])
    assert not line.inbox.identity.ambiguous


def test_a_start_in_flight_finds_the_vehicle_of_the_run_before() -> None:
    """The companion fell and is started again while others are near: it must neither wait nor end."""
    line = Line(remembered=4)
    line.beat(0.0, system=2)
    line.place(0.1, 2)
    line.beat(0.2, system=3)
    assert not line.inbox.identity.ambiguous
    line.beat(0.5, system=4, base_mode=ARMED)
    line.place(0.6, 4)
    line.place(0.7, 2)
    assert (line.vehicle, line.positions) == (4, [2, 4])
    assert not line.inbox.identity.ambiguous


def test_on_the_ground_the_vehicle_of_the_run_before_is_not_taken_for_this_one() -> None:
    line = Line(remembered=4)
    line.beat(0.0, system=2)
    line.beat(0.5, system=4)
    line.inbox.confirm_vehicle(10 * S)
    assert line.vehicle is None
    assert line.inbox.identity.ambiguous


def test_a_type_is_told_by_name_or_by_number() -> None:
    assert (type_name(TRACKER), type_name(200)) == ("antenna tracker", "type 200")
