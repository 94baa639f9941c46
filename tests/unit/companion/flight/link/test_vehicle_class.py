"""Whether a vehicle may be commanded, by its type and its state of flight."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, Autopilot
from companion.flight.link.autopilots.autopilot_registry import (
    add_autopilot,
    autopilot_of,
    registered_autopilots,
    remove_autopilot,
)
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.vehicle_class import type_name
from companion.flight.link.vehicle_state import VehicleState, reduce
from tests.unit.companion.flight.link.messages import heartbeat, received

S = 1_000_000_000
UNDEFINED, TO_FW, TO_MC, MC, FW = range(5)
QUADROTOR, FIXED_WING, HELICOPTER, ROVER, VTOL = 2, 1, 4, 10, 22
WINGED = "VTOL in fixed-wing flight"


@pytest.mark.parametrize(
    ("autopilot", "kind", "vtol_state", "reason"),
    [
        *((ARDUPILOT, kind, MC, "") for kind in (QUADROTOR, HELICOPTER, 13, 14, 35)),  # as ArduCopter does
        *((ARDUPILOT, kind, UNDEFINED, "") for kind in (QUADROTOR, HELICOPTER, 13, 14, 35)),
        *((PX4, kind, UNDEFINED, "") for kind in (QUADROTOR, HELICOPTER, 13, 14, 35)),
        (PX4, QUADROTOR, None, ""),
        (PX4, FIXED_WING, UNDEFINED, "fixed wing"),
        (ARDUPILOT, FIXED_WING, UNDEFINED, "fixed wing"),
        (PX4, VTOL, MC, ""),
        (PX4, FIXED_WING, MC, ""),  # MAV_TYPE is a parameter of PX4
        (PX4, VTOL, FW, WINGED),
        (PX4, QUADROTOR, FW, WINGED),
        (PX4, VTOL, TO_FW, "VTOL in transition"),
        (PX4, VTOL, TO_MC, "VTOL in transition"),
        (PX4, VTOL, UNDEFINED, "VTOL state unknown"),
        (PX4, VTOL, None, "VTOL state unknown"),
        (PX4, VTOL, 9, "VTOL state unknown"),
        *((ARDUPILOT, kind, FW, "ArduPlane") for kind in (FIXED_WING, QUADROTOR, VTOL)),  # Q_MAV_TYPE
        (ARDUPILOT, FIXED_WING, MC, "fixed wing"),
        (ARDUPILOT, VTOL, MC, "ArduPlane"),
        (ARDUPILOT, VTOL, None, "ArduPlane"),
        (ARDUPILOT, ROVER, UNDEFINED, "ground rover"),
        (PX4, 11, UNDEFINED, "surface boat"),
        (PX4, 5, UNDEFINED, "antenna tracker"),
        (PX4, 0, UNDEFINED, "generic"),
        (PX4, 200, None, "type 200"),
        (OTHER, QUADROTOR, MC, "unknown autopilot"),
    ],
)  # fmt: skip
def test_what_flies_as_a_multirotor_or_helicopter_may_be_commanded(
    autopilot: Autopilot, kind: int, vtol_state: int | None, reason: str
) -> None:
    assert autopilot.no_command_reason(kind, vtol_state, False) == reason


def state_after(vtol_state: int, silent_s: float, kind: int = VTOL) -> VehicleState:
    """A vehicle that was heard with a state, and by its heartbeats alone since then."""
    beat = heartbeat(autopilot=mavlink.MAV_AUTOPILOT_PX4, kind=kind)
    state = reduce(VehicleState(), beat, S)
    state = reduce(state, received(mavlink.MAVLink_extended_sys_state_message(vtol_state, 2)), S)
    return reduce(state, beat, S + round(silent_s * S))


@pytest.mark.parametrize("kind", [VTOL, QUADROTOR])
def test_a_vtol_that_hovered_some_seconds_ago_may_be_on_the_wing_by_now(kind: int) -> None:
    assert state_after(MC, 2.0, kind).no_command_reason == ""
    assert state_after(MC, 3.0, kind).no_command_reason == "VTOL state unknown"
    assert state_after(FW, 30.0, kind).no_command_reason == WINGED


def test_a_multirotor_says_that_it_is_no_vtol_and_need_not_say_it_again() -> None:
    assert state_after(UNDEFINED, 60.0, QUADROTOR).no_command_reason == ""


def test_arducopter_stays_a_multirotor_while_its_state_is_late() -> None:
    beat = heartbeat(autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, kind=QUADROTOR)
    state = reduce(VehicleState(), beat, S)
    state = reduce(state, received(mavlink.MAVLink_extended_sys_state_message(MC, 2)), S)
    assert reduce(state, beat, 31 * S).no_command_reason == ""


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_a_quadplane_that_poses_as_a_multirotor_is_known_by_its_parameter(value: float) -> None:
    """Before its first transition, and after a reboot: ArduCopter has no Q_ENABLE of any value."""
    told = received(mavlink.MAVLink_param_value_message(b"Q_ENABLE", value, 2, 900, 0))
    for autopilot, reason in ((mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "ArduPlane"), (12, "")):
        state = reduce(VehicleState(), heartbeat(autopilot=autopilot, kind=QUADROTOR), S)
        state = reduce(state, received(mavlink.MAVLink_extended_sys_state_message(MC, 2)), S)
        assert state.no_command_reason == ""
        assert reduce(state, told, S).no_command_reason == reason


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (19, "tailsitter VTOL"),
        (20, "tailsitter VTOL"),
        (21, "tiltrotor VTOL"),
        (22, "fixed-rotor VTOL"),
        (23, "tailsitter VTOL"),
        (24, "tiltwing VTOL"),
        (25, "VTOL"),
        (2, "quadrotor"),
        (200, "type 200"),
    ],
)
def test_a_type_has_a_plain_name(kind: int, name: str) -> None:
    """The dialect calls a tailsitter "vtol reserved4"."""
    assert type_name(kind) == name


def test_nothing_is_said_of_a_vehicle_that_nobody_has_heard() -> None:
    assert VehicleState().no_command_reason == ""


# Registry of autopilots; tests/e2e/test_third_autopilot.py flies one that is added.


NUMBER = mavlink.MAV_AUTOPILOT_AUTOQUAD


def test_ours_are_found_by_their_heartbeats_and_no_other() -> None:
    assert registered_autopilots() == (ARDUPILOT, PX4)
    assert [autopilot_of(number) for number in (3, 12, NUMBER, 0)] == [ARDUPILOT, PX4, OTHER, OTHER]


def test_one_is_added_and_removed() -> None:
    third = Autopilot(name="third", mav_autopilot=NUMBER)
    add_autopilot(third)
    try:
        assert autopilot_of(NUMBER) is third
        with pytest.raises(ValueError, match="there already"):
            add_autopilot(third)
    finally:
        remove_autopilot(third)
    assert autopilot_of(NUMBER) is OTHER


@pytest.mark.parametrize(
    ("name", "number"),
    [("third", None), ("third", 12), ("px4", NUMBER), ("unknown", NUMBER), ("other", NUMBER)],
)
def test_one_without_a_number_or_with_another_s_is_refused(name: str, number: int | None) -> None:
    with pytest.raises(ValueError):
        add_autopilot(Autopilot(name=name, mav_autopilot=number))


@pytest.mark.parametrize("autopilot", registered_autopilots(), ids=str)
def test_its_modes_are_among_its_modes_and_each_has_another_number(autopilot: Autopilot) -> None:
    assert {autopilot.guided_mode, autopilot.landing_mode} <= set(autopilot.modes)
    assert len(set(autopilot.modes.values())) == len(autopilot.modes)
