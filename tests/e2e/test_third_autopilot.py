"""A third autopilot, known by its object alone, is found, commanded and landed (docs/autopilot.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.situation import Phase
from companion.flight.link.autopilots.autopilot_interface import OTHER, Autopilot, FenceRules
from companion.flight.link.autopilots.autopilot_registry import add_autopilot, remove_autopilot
from companion.flight.link.vehicle_class import ROTARY_WINGS, type_name
from sitl.autopilot.modes import Mode
from sitl.wire.wire import Peer, Wire
from tests.e2e.brief import brief
from tests.e2e.harness import Mission

pytestmark = pytest.mark.long

MODES = {"VELOCITY": (9, 1), "TOUCHDOWN": (4, 2), "STICKS": (1, 0)}  # ArduCopter's GUIDED is 4, LAND 9
SIMULATED = {MODES["VELOCITY"]: Mode.GUIDED, MODES["TOUCHDOWN"]: Mode.LAND, MODES["STICKS"]: Mode.STABILIZE}
THIRD = Autopilot(
    name="third",
    title="Third",
    mav_autopilot=mavlink.MAV_AUTOPILOT_AUTOQUAD,
    modes=MODES,
    unpack_mode=lambda custom_mode: (custom_mode & 0xFF, custom_mode >> 8),
    guided_mode="VELOCITY",
    landing_mode="TOUCHDOWN",
    no_command_reason=lambda kind, vtol_state, is_plane: "" if kind in ROTARY_WINGS else type_name(kind),
    parameter_file="arducopter.parm",  # of what is simulated
    fence=FenceRules(),
)


class ThirdWire(Wire):
    """Wire on which the simulated ArduCopter speaks as the third autopilot: heartbeat and mode numbers."""

    def __init__(self, wire: Wire) -> None:
        super().__init__()
        self._wire = wire
        self.requested: list[tuple[int, int]] = []
        self.peers.append(Peer(lambda data: wire.peers[0].write(changed(data, self._outwards))))

    def poll(self) -> list[tuple[Peer, bytes]]:
        return [(self.peers[0], changed(data, self._inwards)) for _, data in self._wire.poll()]

    def close(self) -> None:
        self._wire.close()

    def _outwards(self, message: Any) -> None:
        if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == 1:
            main, sub = next(pair for pair, mode in SIMULATED.items() if mode == message.custom_mode)
            message.autopilot, message.custom_mode = THIRD.mav_autopilot, main | sub << 8

    def _inwards(self, message: Any) -> None:
        if getattr(message, "command", None) == mavlink.MAV_CMD_DO_SET_MODE:
            self.requested.append((int(message.param2), int(message.param3)))
            message.param2, message.param3 = float(SIMULATED[self.requested[-1]]), 0.0


def changed(data: bytes, change: Callable[[Any], None]) -> bytes:
    """Return a frame with a change in its message, of the same sender and number."""
    (message,) = mavlink.MAVLink(None).parse_buffer(bytearray(data))
    codec = mavlink.MAVLink(None, message.get_srcSystem(), message.get_srcComponent())
    codec.seq = message.get_seq()
    change(message)
    return bytes(message.pack(codec))


def flown(until: Callable[[Mission], bool]) -> tuple[Mission, ThirdWire]:
    mission = Mission(seed=3, **brief())
    wire = mission.sim.router.wires[0] = ThirdWire(mission.sim.router.wires[0])
    return mission.fly(lambda m: m.until(lambda: until(m))), wire


@pytest.fixture
def registered() -> Iterator[None]:
    add_autopilot(THIRD)
    yield
    remove_autopilot(THIRD)


def test_it_is_commanded_in_its_own_modes_and_lands(registered: None) -> None:
    mission, wire = flown(lambda m: m.phase is Phase.LANDED and not m.sim.autopilot.armed)
    vehicle = mission.companion.link.vehicle
    assert (vehicle.autopilot, vehicle.mode, vehicle.no_command_reason) == (THIRD, "TOUCHDOWN", "")
    assert wire.requested == [MODES["TOUCHDOWN"]]
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() <= 0.5


def test_without_its_object_nothing_is_commanded() -> None:
    mission, wire = flown(lambda m: m.sim.now_ns > 25_000_000_000)  # by then it would survey
    assert mission.companion.link.vehicle.autopilot is OTHER
    assert mission.companion.link.no_command_reason == "unknown autopilot"
    assert mission.sim.autopilot.airborne
    assert wire.requested == []
