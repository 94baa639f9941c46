"""Failsafes of the simulated PX4: the mode of each, its delay, and the pilot's takeover (failsafe.cpp)."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.px4_modes import Px4Mode
from tests.unit.sitl.autopilot.px4.px4_flight import ACCEPTED, Px4Flight

HOLD_S = 5.0
HOVER = (0.0, 0.0, 0.0)


def lost_radio(flight: Px4Flight) -> None:
    flight.autopilot.receiver.transmitting = False


def lost_station(flight: Px4Flight) -> None:
    flight.has_station = False
    flight.autopilot.parameters["COM_DL_LOSS_T"] = 1


def left_fence(flight: Px4Flight) -> None:
    flight.autopilot.parameters["GF_MAX_HOR_DIST"] = 5.0


def battery_at(share: float) -> Callable[[Px4Flight], None]:
    def drain(flight: Px4Flight) -> None:
        autopilot = flight.autopilot
        autopilot.battery_sag_v += autopilot.battery_v - (14.0 + 2.8 * share)

    return drain


low, critical, emergency = battery_at(0.12), battery_at(0.06), battery_at(0.03)


@pytest.mark.parametrize(
    ("cause", "parameters", "mode"),
    [
        (low, {"COM_LOW_BAT_ACT": 3}, "AUTO.LOITER"),
        (critical, {}, "AUTO.LOITER"),
        (critical, {"COM_LOW_BAT_ACT": 2}, "AUTO.LAND"),
        (critical, {"COM_LOW_BAT_ACT": 3}, "AUTO.RTL"),
        (emergency, {"COM_LOW_BAT_ACT": 3}, "AUTO.LAND"),
        (lost_radio, {}, "AUTO.RTL"),
        (lost_radio, {"NAV_RCL_ACT": 3}, "AUTO.LAND"),
        (lost_radio, {"NAV_RCL_ACT": 0}, "AUTO.LOITER"),
        (lost_radio, {"COM_RCL_EXCEPT": 2}, "AUTO.LOITER"),
        (lost_station, {}, "AUTO.LOITER"),
        (lost_station, {"NAV_DLL_ACT": 2}, "AUTO.RTL"),
        (left_fence, {"GF_ACTION": 3}, "AUTO.RTL"),
        (left_fence, {"GF_ACTION": 5}, "AUTO.LAND"),
        (left_fence, {"GF_ACTION": 1}, "AUTO.LOITER"),
    ],
)
def test_a_failsafe_holds_for_five_seconds_and_then_acts(
    cause: Callable[[Px4Flight], None], parameters: dict[str, float], mode: str
) -> None:
    flight = Px4Flight(3, 7, **parameters)
    cause(flight)
    flight.run(HOLD_S - 0.5)
    assert flight.mode == "AUTO.LOITER"
    flight.run(3)
    assert flight.mode == mode
    assert flight.autopilot.intended is Px4Mode.AUTO_LOITER
    beat = flight.sent("HEARTBEAT")[-1]
    assert (beat.system_status == mavlink.MAV_STATE_CRITICAL) == (mode != "AUTO.LOITER")
    assert flight.sent("CURRENT_MODE")[-1].intended_custom_mode == Px4Mode.AUTO_LOITER


def test_a_breached_fence_holds_at_once_by_default() -> None:
    flight = Px4Flight(3).enter(Px4Mode.POSCTL)
    flight.autopilot.receiver.transmitter[0] = 1700
    left_fence(flight)
    flight.until(lambda: flight.mode == "AUTO.LOITER")
    assert flight.away_m((0, 0)) > 4.9


@pytest.mark.parametrize(
    ("action", "mode"), [(0, "POSCTL"), (3, "AUTO.RTL"), (4, "AUTO.LAND"), (5, "AUTO.LOITER")]
)
def test_lost_setpoints_end_offboard_until_they_return(action: int, mode: str) -> None:
    flight = Px4Flight(4, COM_OBL_RC_ACT=action)
    flight.velocity = HOVER
    flight.run(0.2).enter(Px4Mode.OFFBOARD).run(0.5)
    flight.velocity = None
    flight.run(1.3)
    assert flight.mode == mode
    flight.velocity = HOVER
    flight.run(0.3)
    assert flight.mode == "OFFBOARD"


def test_a_chosen_mode_interrupts_a_failsafe() -> None:
    flight = Px4Flight(4, 7)
    lost_radio(flight)
    flight.until(lambda: flight.mode == "AUTO.RTL", 8)
    assert flight.ask(Px4Mode.AUTO_LAND) == ACCEPTED
    flight.run(1)
    assert flight.mode == "AUTO.LAND"


def test_moved_sticks_interrupt_a_failsafe_but_not_its_delay() -> None:
    flight = Px4Flight(4, 7, COM_LOW_BAT_ACT=2, MPC_LAND_SPEED=0.3, MPC_Z_VEL_MAX_DN=0.3)
    critical(flight)
    sticks = flight.autopilot.receiver.transmitter
    flight.run(1)
    sticks[0] = 1700
    flight.run(1)
    assert flight.mode == "AUTO.LOITER"
    sticks[0] = 1500
    flight.until(lambda: flight.mode == "AUTO.LAND", 6).run(0.5)
    sticks[0] = 1700
    flight.run(1)
    assert flight.mode == "POSCTL"


@pytest.mark.parametrize("mode", [Px4Mode.AUTO_LAND, Px4Mode.AUTO_PRECLAND])
def test_a_landing_goes_on_through_a_lost_radio(mode: Px4Mode) -> None:
    flight = Px4Flight(4)
    flight.target = (1.0, 0.0)
    flight.enter(mode)
    lost_radio(flight)
    flight.run(4)
    assert flight.autopilot.mode is mode


def test_a_radio_that_was_off_at_the_arming_is_not_missed() -> None:
    flight = Px4Flight()
    lost_radio(flight)
    flight.run(1.5).take_off(3).run(9)
    assert flight.mode == "AUTO.LOITER"


def test_position_mode_without_a_transmitter_sinks() -> None:
    flight = Px4Flight()
    lost_radio(flight)
    flight.run(1.5).take_off(6).until(lambda: flight.mode == "AUTO.LOITER").run(1)
    assert flight.ask(Px4Mode.POSCTL) == ACCEPTED
    before_m = flight.height_m
    assert flight.run(4).height_m == pytest.approx(before_m - 2.8, abs=0.4)


def test_a_lost_position_is_landed_without() -> None:
    flight = Px4Flight(3)
    flight.autopilot.aiding.lose_gps(0.0)
    flight.until(lambda: flight.mode == "AUTO.LAND", 8)
    assert flight.autopilot.navigator.is_blind
    flight.until(lambda: not flight.autopilot.armed)
