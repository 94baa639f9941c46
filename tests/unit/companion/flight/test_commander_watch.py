"""Another commander, found by the target that the autopilot reports."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight import commander_watch
from companion.flight.commander_watch import CommanderWatch
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.vehicle_state import VehicleState
from tests.unit.companion.flight.link.messages import received

MS, S = 1_000_000, 1_000_000_000
PLACE, SPEED = 0xDF8, 0xDC7  # type_mask of a position, and of a velocity, alone
HERE = (1.0, 2.0, -15.0)


class Wire:
    """A link of which the test says what is heard; the autopilot's time since boot is ours."""

    system_id, component_id = 1, 191

    def __init__(self, autopilot: Autopilot, monkeypatch: pytest.MonkeyPatch) -> None:
        mode = autopilot.guided_mode or ""
        self.vehicle = VehicleState(sysid=1, autopilot=autopilot, mode=mode, vehicle_type=2)
        self._handlers: dict[str, Any] = {}
        self.now_ns = 100 * S
        monkeypatch.setattr(commander_watch, "now_ns", lambda: self.now_ns)
        self.watch = CommanderWatch(self)  # type: ignore[arg-type]

    def subscribe(self, name: str, handler: Any, *, anyone: bool = False) -> None:
        self._handlers[name] = handler

    def hear(self, message: Any, system: int = 1, component: int = 1) -> None:
        heard = received(message, system, component)
        self._handlers[heard.get_type()](heard, self.now_ns)

    def target(
        self, mask: int, position: Any = HERE, ned_ms: Any = (0.0, 0.0, 0.0), late_ms: int = 0
    ) -> None:
        """Report a target of `late_ms` ago."""
        boot_ms = self.now_ns // MS - late_ms
        rest = (0.0, 0.0, 0.0, 0.0, 0.0)
        self.hear(
            mavlink.MAVLink_position_target_local_ned_message(boot_ms, 1, mask, *position, *ned_ms, *rest)
        )

    def command(
        self, seconds: float, enu_ms: Any = (2.0, 0.0, 0.0), follows: bool = True, **how: bool
    ) -> None:
        """Send a setpoint each 50 ms, and let the autopilot report it."""
        for _ in range(round(seconds / 0.05)):
            self.watch.on_setpoint(np.array(enu_ms), self.now_ns, **how)
            self.now_ns += 20 * MS
            if follows:
                self.target(SPEED, ned_ms=(enu_ms[1], enu_ms[0], -enu_ms[2]))
            self.now_ns += 30 * MS


@pytest.fixture(params=[ARDUPILOT, PX4])
def wire(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Wire:
    return Wire(request.param, monkeypatch)


def test_our_own_targets_are_ours(wire: Wire) -> None:
    for enu_ms in ([2.0, 0.0, 0.0], [0.0, -4.0, 1.0], [0.0, 0.0, -1.5]):
        wire.command(3, enu_ms)
        assert wire.watch.commander() == ""


def test_a_place_that_the_autopilot_flies_to_is_another_s(wire: Wire) -> None:
    wire.command(1)
    wire.target(PLACE)
    assert wire.watch.commander() == "another"


def test_the_sender_is_named_where_it_was_heard(wire: Wire) -> None:
    wire.command(1)
    place = (0, 1, 1, 1, PLACE, 1.0, 2.0, -5.0, 0, 0, 0, 0, 0, 0, 0, 0)
    wire.hear(mavlink.MAVLink_set_position_target_local_ned_message(*place), 255, 190)
    wire.target(PLACE)
    assert wire.watch.commander() == "255/190"


@pytest.mark.parametrize("system", [1, 2])
def test_what_is_sent_to_another_vehicle_or_by_us_names_nobody(wire: Wire, system: int) -> None:
    wire.command(1)
    place = (0, system, 1, 1, PLACE, 1.0, 2.0, -5.0, 0, 0, 0, 0, 0, 0, 0, 0)
    sender = (1, 191) if system == 1 else (255, 190)
    wire.hear(mavlink.MAVLink_set_position_target_local_ned_message(*place), *sender)
    assert wire.watch.commander() == ""


def test_a_place_from_before_our_first_setpoint_is_not_held_against_anybody(wire: Wire) -> None:
    """The take-off's, until a setpoint has arrived; and one that was overtaken on the way."""
    wire.command(2, follows=False)
    wire.target(PLACE)
    assert wire.watch.commander() == ""
    wire.command(1)
    wire.target(PLACE, late_ms=2000)
    assert wire.watch.commander() == ""


def test_a_velocity_of_nobody_now_and_then_is_avoidance(wire: Wire) -> None:
    wire.command(1)
    for _ in range(5):
        wire.command(0.6)
        wire.target(SPEED, ned_ms=(9.0, -9.0, 0.0))
    assert wire.watch.commander() == ""


def test_two_senders_in_turn_are_told_from_one(wire: Wire) -> None:
    wire.command(1)
    for _ in range(4):
        wire.command(0.05, follows=False)
        wire.target(SPEED, ned_ms=(0.0, -4.0, 0.0))
    assert wire.watch.commander() == "another"


def test_a_velocity_that_the_autopilot_limits_is_ours(wire: Wire) -> None:
    """ArduCopter's avoidance slides along and backs off; PX4 shortens."""
    asked = [4.0, 0.0, 2.0]
    wire.command(1, asked)
    limited = [(0.0, 2.0, -2.0), (0.0, 4.0, -0.5), (0.0, 0.0, 0.0)]
    if wire.vehicle.autopilot is ARDUPILOT:
        limited += [(3.0, 1.0, 0.0), (0.0, -0.75, 0.75)]
    for ned_ms in limited * 3:
        wire.command(0.05, asked, follows=False)
        wire.target(SPEED, ned_ms=ned_ms)
    assert wire.watch.commander() == ""


def test_after_a_pause_another_s_target_counts_for_nothing_until_ours_is_flown_again(wire: Wire) -> None:
    wire.command(1)
    wire.target(PLACE)
    wire.now_ns += 2 * S
    assert wire.watch.commander() == ""  # nothing is commanded, so nobody is in the way
    assert wire.watch.is_foreign
    wire.command(0.1)
    assert not wire.watch.is_foreign


def test_idle_setpoints_end_where_another_flies_and_may_come_again_in_another_mode(wire: Wire) -> None:
    """Zero velocities at 5 Hz keep OFFBOARD open; they would brake who flies by it."""
    for _ in range(10):
        wire.command(0.05, [0.0, 0.0, 0.0], idle=True)
        wire.now_ns += 150 * MS
    for _ in range(4):
        wire.target(SPEED, ned_ms=(3.0, 0.0, 0.0))
    assert wire.watch.commander() == ""
    assert wire.watch.is_foreign
    guided, wire.vehicle = wire.vehicle, VehicleState(sysid=1, mode="AUTO.LOITER")
    assert not wire.watch.is_foreign
    wire.vehicle = guided
    assert not wire.watch.is_foreign


def test_ardupilot_s_other_messages_of_a_target_count_and_px4_s_do_not(wire: Wire) -> None:
    wire.command(1)
    boot_ms = wire.now_ns // MS
    nothing = (0,) * 9
    wire.hear(mavlink.MAVLink_position_target_global_int_message(boot_ms, 0, PLACE, 1, 1, 1.0, *nothing[:8]))
    assert wire.watch.is_foreign is (wire.vehicle.autopilot is ARDUPILOT)


def test_a_course_to_a_point_counts_after_three_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    wire = Wire(ARDUPILOT, monkeypatch)
    wire.command(1)
    for far_m, foreign in ((0, False), (9, False), (9, False), (9, True)):
        wire.hear(mavlink.MAVLink_nav_controller_output_message(0, 0, 0, 0, far_m, 0, 0, 0))
        assert wire.watch.is_foreign is foreign


def test_fly_to_here_heard_on_the_link_counts_for_the_autopilot_that_obeys_it(wire: Wire) -> None:
    wire.command(1)
    wire.hear(
        mavlink.MAVLink_command_int_message(
            1, 1, 3, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, 0, 0, 0, 0, 1, 1, 20.0
        ),
        255,
        190,
    )
    assert wire.watch.commander() == ("255/190" if wire.vehicle.autopilot is ARDUPILOT else "")
