"""Health reports of the autopilot, as measured on ArduCopter and PX4."""

from __future__ import annotations

from functools import reduce as fold
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilot_health import Health
from companion.flight.link.vehicle_state import VehicleState, reduce
from tests.unit.companion.flight.link.messages import ARMED, heartbeat, received

S = 1_000_000_000
GOOD = 831  # attitude, velocities, relative and absolute positions, height, and the predicted ones
GONE = GOOD & ~(16 | 512) | 128
PX4_GROUND, PX4_AIR, PX4_LOST = 0x3FF, 0x37F, 0x365  # measured: on the ground the filter stands still


def ekf(flags: int) -> Any:
    return received(mavlink.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.1))


def estimator(flags: int) -> Any:
    return received(mavlink.MAVLink_estimator_status_message(0, flags, *[0.1] * 8))


def channels(*pulses: int) -> Any:
    padded = [*pulses, *[0] * (18 - len(pulses))]
    return received(mavlink.MAVLink_rc_channels_message(0, len(pulses), *padded, 255))


def text(words: str, severity: int) -> Any:
    return received(mavlink.MAVLink_statustext_message(severity, words.encode(), 0, 0))


def sensors(unhealthy: int) -> Any:
    all_of_them = 0x0FFFFFFF
    return received(
        mavlink.MAVLink_sys_status_message(
            all_of_them, all_of_them, all_of_them & ~unhealthy, 0, 12_000, 0, 80, 0, 0, 0, 0, 0, 0
        )
    )


def after(*messages: Any, at_ns: int = 5 * S) -> Health:
    return fold(lambda s, m: reduce(s, m, at_ns), messages, VehicleState()).health


@pytest.mark.parametrize("report", [ekf, estimator])
def test_what_the_estimator_had_and_has_lost_is_named(report: Any) -> None:
    assert after(report(GOOD)).estimate_lost == ""
    assert after(report(GOOD), report(GONE)).estimate_lost == "position"
    assert after(report(GOOD), report(GOOD & ~1)).estimate_lost == "attitude"
    assert after(report(GOOD), report(GOOD & ~32)).estimate_lost == "height"
    assert after(report(GOOD), report(GONE), report(GOOD)).estimate_lost == ""


def test_what_the_estimator_never_had_is_not_lost() -> None:
    flow_only = GOOD & ~(16 | 512)
    assert after(ekf(flow_only)).estimate_lost == ""
    assert after(ekf(167), ekf(GOOD)).estimate_lost == ""  # on the ground, before the first fix
    assert after().estimate_lost == ""


def test_px4_loses_no_position_by_taking_off() -> None:
    assert after(estimator(PX4_GROUND), estimator(PX4_AIR)).estimate_lost == ""
    assert after(estimator(PX4_AIR), estimator(PX4_GROUND)).estimate_lost == ""
    assert after(estimator(PX4_AIR), estimator(PX4_LOST)).estimate_lost == "position"


def test_a_receiver_that_lost_its_fix_is_named() -> None:
    def gps(fix: int) -> Any:
        return received(mavlink.MAVLink_gps_raw_int_message(0, fix, 0, 0, 0, 100, 100, 0, 0, 9))

    assert after(gps(3), gps(1)).gps_lost
    assert after(gps(3), gps(1)).cause(5 * S) == "GPS lost"
    assert not after(gps(1)).gps_lost  # it never had one
    assert not after(gps(3), gps(0), gps(6)).gps_lost


def test_a_reboot_of_the_autopilot_begins_anew() -> None:
    def boot(ms: int) -> Any:
        return received(mavlink.MAVLink_system_time_message(0, ms))

    flying = [boot(60_000), boot(61_000), ekf(GOOD)]
    assert after(*flying, *map(boot, range(0, 6000, 500)), ekf(GONE)).estimate_lost == ""


@pytest.mark.parametrize(
    ("status", "failsafe"),
    [
        (mavlink.MAV_STATE_ACTIVE, False),
        (mavlink.MAV_STATE_CRITICAL, True),
        (mavlink.MAV_STATE_STANDBY, False),
    ],
)
def test_a_failsafe_shows_in_the_heartbeat(status: int, failsafe: bool) -> None:
    beat = heartbeat(base_mode=ARMED)
    beat.system_status = status
    assert reduce(VehicleState(), beat, 0).failsafe == failsafe


def test_the_cause_of_a_failsafe_is_what_the_autopilot_said_last_or_what_is_unhealthy() -> None:
    gps = sensors(mavlink.MAV_SYS_STATUS_SENSOR_GPS)
    assert after(gps).cause(5 * S) == "GPS lost"
    assert after(ekf(GOOD), gps, ekf(GONE)).cause(5 * S) == "position lost"
    said = after(gps, text("EKF Failsafe", mavlink.MAV_SEVERITY_CRITICAL))
    assert said.cause(9 * S) == "EKF Failsafe"
    assert said.cause(16 * S) == "GPS lost"
    assert after(text("Radio Failsafe", mavlink.MAV_SEVERITY_WARNING)).cause(5 * S) == "Radio Failsafe"
    lost = after(gps, text("PrecLand: Target Lost", mavlink.MAV_SEVERITY_CRITICAL))
    assert lost.cause(5 * S) == "GPS lost"  # the target was lost by the abort, it is no cause
    assert after(text("PreArm: fine", mavlink.MAV_SEVERITY_INFO)).cause(5 * S) == ""


def test_a_target_lost_is_noted_whatever_else_is_said_in_the_same_moment() -> None:
    lost = text("PrecLand: Target Lost", mavlink.MAV_SEVERITY_CRITICAL)
    other = text("Battery 1 is low", mavlink.MAV_SEVERITY_WARNING)
    assert after(other).target_lost_ns is None
    for health in (after(lost, other), after(other, lost)):
        assert health.target_lost_ns == 5 * S
        assert health.cause(5 * S) == "Battery 1 is low"


def test_the_fence_is_breached_until_it_is_not() -> None:
    def fence(breached: int) -> Any:
        return received(mavlink.MAVLink_fence_status_message(breached, 1, 2, 0))

    assert after(fence(1)).breached
    assert after(fence(1)).cause(0) == "fence breached"
    assert not after(fence(1), fence(0)).breached


def test_sticks_are_roll_and_pitch_of_either_autopilot() -> None:
    assert after(channels(1800, 1400, 1100, 1500)).sticks_us == (1800, 1400)
    assert after(channels(0, 0)).sticks_us is None
    moved = received(mavlink.MAVLink_manual_control_message(1, -200, 600, 500, 0, 0))
    assert after(moved).sticks_us == (1800, 1400)
    nothing = received(mavlink.MAVLink_manual_control_message(1, 0x7FFF, 0x7FFF, 500, 0, 0))
    assert after(nothing).sticks_us is None


def test_a_switch_that_moves_is_the_pilot_s_and_noise_is_not() -> None:
    rest, moved, noise = (channels(1500, 1500, 1100, 1500, mode) for mode in (1100, 1900, 1140))
    assert after(rest, moved).switched_ns == 5 * S
    assert after(rest, noise).switched_ns is None
    assert after(rest).switched_ns is None
    assert after(channels(1500, 1500), rest).switched_ns is None  # a receiver that begins is no hand


# ---- receivers and estimator ------------------------------------------------------------------------


def gps(fix: int, *, second: bool = False) -> Any:
    if second:
        return received(mavlink.MAVLink_gps2_raw_message(0, fix, 0, 0, 0, 100, 100, 0, 0, 9, 0, 0))
    return received(mavlink.MAVLink_gps_raw_int_message(0, fix, 0, 0, 0, 100, 100, 0, 0, 9))


def over_time(*timed: tuple[float, Any]) -> Health:
    return fold(lambda s, one: reduce(s, one[1], round(one[0] * S)), timed, VehicleState()).health


def test_a_receiver_that_dies_beside_another_is_not_missed() -> None:
    assert not after(gps(3), gps(4, second=True), gps(0)).gps_lost
    assert after(gps(3), gps(4, second=True), gps(0), gps(1, second=True)).gps_lost
    assert not after(gps(3), gps(0, second=True)).gps_lost  # the second never had a fix


def test_a_second_receiver_that_fell_silent_has_no_fix() -> None:
    assert over_time((1, gps(3)), (1, gps(3, second=True)), (4.5, gps(0))).gps_lost


@pytest.mark.parametrize("report", [ekf, estimator])
def test_an_estimator_that_keeps_its_position_has_it_from_elsewhere(report: Any) -> None:
    lost = [(1, report(GOOD)), (1, gps(3)), (2, gps(1)), (16, report(GOOD))]
    assert over_time(*lost).gps_lost
    assert not over_time(*lost, (18, report(GOOD))).gps_lost
    assert over_time(*lost, (18, report(GONE))).gps_lost
    assert over_time(*lost, (18, report(GOOD)), (19, gps(3)), (20, gps(1))).gps_lost
    assert over_time(*lost, (18, report(GOOD))).fix_lost


def test_each_estimator_has_its_own_flag_of_a_glitch() -> None:
    """Bit 1024 is GPS_GLITCH of ESTIMATOR_STATUS, and UNINITIALIZED of EKF_STATUS_REPORT."""
    assert after(ekf(GOOD | mavlink.EKF_GPS_GLITCHING)).glitching
    assert after(estimator(GOOD | mavlink.ESTIMATOR_GPS_GLITCH)).glitching
    assert not after(ekf(GOOD | 1024)).glitching
    assert not after(ekf(GOOD | mavlink.EKF_GPS_GLITCHING), ekf(GOOD)).glitching
