"""Trust in the first position: only with a fix, where the autopilot reports one."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.command_server import CommandServer
from companion.flight.link.inbox import Inbox
from companion.flight.link.position_fix import PATIENCE_NS, PositionFix, PositionGate
from companion.flight.link.wire.codec import Codec
from tests.unit.companion.flight.link.messages import heartbeat, position, received

S = 1_000_000_000
ABSOLUTE, RELATIVE = 831, 167


def gps(fix_type: int) -> Any:
    return received(mavlink.MAVLink_gps_raw_int_message(0, fix_type, 0, 0, 0, 70, 110, 0, 0, 9))


def ekf(flags: int) -> Any:
    return received(mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0))


def estimator(flags: int) -> Any:
    return received(mavlink.MAVLink_estimator_status_message(0, flags, 0, 0, 0, 0, 0, 0, 0, 0))


def told(*messages: Any, patience_ns: int = PATIENCE_NS) -> list[float]:
    """Return the latitudes that are told after messages a tenth of a second apart."""
    inbox = Inbox(Codec(191), CommandServer(), gate=PositionGate(patience_ns))
    found: list[float] = []
    inbox.on_position.subscribe(lambda _stamp, lat, *_: found.append(lat))
    for k, message in enumerate((heartbeat(), *messages)):
        inbox.on_message(message, S + k * S // 10)
    return found


def flown(n: int, begin: int = 0) -> list[Any]:
    """Return positions, each a ten-millionth of a degree north of the last, from the equator on."""
    return [position(1000 + 100 * (begin + k), lat=begin + k, lon=0) for k in range(n)]


@pytest.mark.parametrize(
    ("words", "believed"),
    [
        ([gps(0)], False),
        ([gps(1)], False),
        ([gps(2)], False),
        ([gps(3)], True),
        ([gps(6)], True),
        ([ekf(RELATIVE)], False),
        ([ekf(ABSOLUTE)], True),
        ([estimator(RELATIVE)], False),
        ([estimator(ABSOLUTE)], True),
        ([gps(3), ekf(RELATIVE)], False),  # the estimator does not use it yet
        ([ekf(ABSOLUTE), gps(0)], True),  # by a camera or beacons
    ],
)
def test_the_first_position_needs_a_fix(words: list[Any], believed: bool) -> None:
    assert bool(told(*words, *flown(60, 1))) is believed


def test_the_word_of_another_component_is_none() -> None:
    gimbal = received(mavlink.MAVLink_gps_raw_int_message(0, 3, 0, 0, 0, 70, 110, 0, 0, 9), 1, 154)
    assert told(gps(1), gimbal, *flown(60, 1)) == []


def test_positions_wait_for_that_word_and_come_without_it_after_a_while() -> None:
    assert told(*flown(20, 1)) == []
    assert len(told(*flown(20, 1), gps(3), *flown(5, 21))) == 5
    assert len(told(*flown(40, 1))) == 10
    assert len(told(*flown(40, 1), patience_ns=0)) == 40


def test_once_there_was_a_fix_the_estimate_is_followed_without() -> None:
    assert len(told(gps(3), *flown(3, 1), gps(0), *flown(3, 4))) == 6


def test_after_a_reboot_a_fix_is_needed_again() -> None:
    flying = [position(90_000 + 100 * k, lat=k, lon=0) for k in range(1, 4)]
    rebooted = [position(100 * k, lat=7) for k in range(55)]
    assert told(gps(3), *flying, *rebooted) == pytest.approx([1e-7, 2e-7, 3e-7])
    assert len(told(gps(3), *flying, *rebooted, gps(3), position(5500, lat=9))) == 4


def test_0_0_is_a_place_with_a_fix_and_none_without() -> None:
    nowhere = [position(1000 + 100 * k, lat=0, lon=0) for k in range(5)]
    assert told(*nowhere, patience_ns=0) == []
    assert told(gps(1), *nowhere) == []
    assert told(gps(3), *nowhere) == [0.0] * 5


def test_an_open_gate_holds_nothing_back() -> None:
    gate = PositionGate(None)
    gate.close()
    assert gate.is_open
    assert gate.accepts(PositionFix(gps=0), S)
