"""Failsafes of the simulated autopilot: triggers, texts, and return of control."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from tests.unit.sitl.bench_flight import Bench

CRITICAL, WARNING, NOTICE = (
    mavlink.MAV_SEVERITY_CRITICAL,
    mavlink.MAV_SEVERITY_WARNING,
    mavlink.MAV_SEVERITY_NOTICE,
)
POSITION_CONTROL = mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
REFUSED = mavlink.MAV_RESULT_FAILED


def flying(
    parameters: dict[str, float] | None = None, *, height_m: float = 8.0, wind_ms: float = 0.0
) -> Bench:
    bench = Bench(wind_ms=wind_ms)
    bench.autopilot.parameters.update(parameters or {})
    bench.airborne(height_m)
    bench.sent.clear()
    return bench


def texts(bench: Bench) -> list[tuple[int, str]]:
    return [(m.severity, m.text) for m in bench.sent if m.get_type() == "STATUSTEXT"]


def latest(bench: Bench, name: str) -> Any:
    return [m for m in bench.sent if m.get_type() == name][-1]


def critical(bench: Bench) -> bool:
    return bool(latest(bench, "HEARTBEAT").system_status == mavlink.MAV_STATE_CRITICAL)


def unhealthy(bench: Bench) -> int:
    """Return the bits of SYS_STATUS that are enabled and not healthy."""
    status = latest(bench, "SYS_STATUS")
    return int(status.onboard_control_sensors_enabled & ~status.onboard_control_sensors_health)


def mode(bench: Bench) -> str:
    return bench.autopilot.mode_name


def beat(bench: Bench) -> None:
    bench.tell(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))


# ---- GPS ------------------------------------------------------------------------------------------


def test_without_gps_guided_becomes_a_landing_without_position() -> None:
    bench = flying()
    bench.autopilot.aiding.lose_gps(0.0)
    bench.run(7)
    assert (mode(bench), critical(bench)) == ("GUIDED", False)
    assert latest(bench, "GPS_RAW_INT").fix_type <= mavlink.GPS_FIX_TYPE_NO_FIX
    bench.run(3)
    assert mode(bench) == "LAND"
    assert critical(bench)
    assert (CRITICAL, "EKF Failsafe: changed to LAND Mode") in texts(bench)
    assert latest(bench, "EKF_STATUS_REPORT").flags == 0x25
    assert unhealthy(bench) == mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert not latest(bench, "SYS_STATUS").onboard_control_sensors_enabled & POSITION_CONTROL
    height_m = float(bench.truth.pos_enu_m[2])
    bench.run(1.5)  # it waits for four seconds
    assert bench.truth.pos_enu_m[2] == pytest.approx(height_m, abs=0.3)


@pytest.mark.parametrize("wanted", [Mode.GUIDED, Mode.LOITER, Mode.RTL, Mode.BRAKE])
def test_in_an_ekf_failsafe_modes_that_need_a_position_are_refused(wanted: Mode) -> None:
    bench = flying()
    bench.autopilot.aiding.lose_gps(0.0)
    bench.run(10)
    bench.sent.clear()
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, wanted) == REFUSED
    bench.run(0.1)
    assert mode(bench) == "LAND"
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.ALT_HOLD) == 0


def test_the_refusal_says_why() -> None:
    bench = flying()
    bench.autopilot.aiding.lose_gps(0.0)
    bench.run(10)
    bench.autopilot.set_mode(Mode.GUIDED)
    bench.run(0.1)
    assert (WARNING, "Mode change to GUIDED failed: requires position") in texts(bench)


def test_a_landing_goes_on_blind_and_ends_some_metres_off() -> None:
    bench = flying(height_m=15, wind_ms=0.3)
    bench.autopilot.aiding.lose_gps(2.0)
    bench.run(2, lambda: bench.landing_target(0, 0))
    assert bench.command(mavlink.MAV_CMD_NAV_LAND) == 0
    bench.run(5, lambda: bench.landing_target(0, 0))
    assert math.hypot(*bench.truth.pos_enu_m[:2]) < 1.2
    bench.run(30, lambda: bench.landing_target(0, 0))
    assert (CRITICAL, "EKF Failsafe") in texts(bench)
    assert critical(bench)  # still so on the ground
    assert bench.vehicle.contact is not None
    assert 2.0 < math.hypot(bench.vehicle.contact["e"], bench.vehicle.contact["n"]) < 7.0
    assert not bench.autopilot.armed


def test_without_wind_a_blind_landing_drifts_by_what_the_estimate_errs() -> None:
    bench = flying(height_m=15)
    bench.autopilot.aiding.lose_gps(2.0)
    bench.run(2, lambda: bench.landing_target(0, 0))
    assert bench.command(mavlink.MAV_CMD_NAV_LAND) == 0
    bench.run(30, lambda: bench.landing_target(0, 0))
    estimate = bench.autopilot.estimate
    assert estimate is not None
    error_m = math.hypot(*(estimate.pos_enu_m - bench.truth.pos_enu_m)[:2])
    assert error_m == pytest.approx(1.7, abs=0.2)


def test_gps_that_returns_clears_the_failsafe_and_the_modes_but_not_the_landing() -> None:
    bench = flying(height_m=14)
    bench.autopilot.aiding.lose_gps(0.0)
    bench.run(9)
    assert mode(bench) == "LAND"
    bench.autopilot.aiding.regain_gps()
    bench.run(3.5)
    assert (CRITICAL, "EKF Failsafe Cleared") in texts(bench)
    assert not critical(bench.run(1))
    assert latest(bench, "EKF_STATUS_REPORT").flags == 831
    assert mode(bench) == "LAND"
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED) == 0


def test_a_short_gap_of_gps_triggers_nothing() -> None:
    bench = flying()
    bench.autopilot.aiding.lose_gps(0.0)
    bench.run(5)
    bench.autopilot.aiding.regain_gps()
    bench.run(8)
    assert (mode(bench), critical(bench)) == ("GUIDED", False)
    assert math.hypot(*bench.truth.pos_enu_m[:2]) < 0.5


def test_blind_the_roll_stick_leans_the_vehicle() -> None:
    bench = flying(height_m=14)
    bench.autopilot.aiding.lose_gps(0.0)
    bench.run(9)
    before = bench.truth.pos_enu_m
    bench.autopilot.receiver.transmitter[0] = 1800
    bench.run(2)
    right = np.array([math.cos(0.7), -math.sin(0.7)])
    assert right @ (bench.truth.pos_enu_m - before)[:2] > 2.0


# ---- radio, ground station, battery ---------------------------------------------------------------


def test_a_lost_radio_returns_the_vehicle_and_is_cleared_when_it_is_back() -> None:
    bench = flying()
    bench.autopilot.receiver.transmitting = False
    bench.run(2.2)
    assert (mode(bench), critical(bench)) == ("RTL", True)
    assert unhealthy(bench) == mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    assert (WARNING, "Radio Failsafe") in texts(bench)
    bench.autopilot.receiver.transmitting = True
    bench.run(2)
    assert (WARNING, "Radio Failsafe Cleared") in texts(bench)
    assert (mode(bench), critical(bench)) == ("RTL", False)


def test_a_radio_that_is_lost_where_rtl_is_refused_lands_the_vehicle() -> None:
    bench = flying(height_m=12)
    bench.autopilot.aiding.lose_gps(0.0)
    bench.run(9)
    bench.autopilot.set_mode(Mode.ALT_HOLD)
    bench.autopilot.receiver.transmitting = False
    bench.run(2)
    assert mode(bench) == "LAND"


def test_a_radio_that_is_lost_on_the_ground_disarms() -> None:
    bench = Bench().run(6)
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED) == 0
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
    bench.autopilot.receiver.transmitting = False
    bench.run(2)
    assert not bench.autopilot.armed
    assert mode(bench) == "GUIDED"


def test_a_ground_station_that_falls_silent_returns_the_vehicle() -> None:
    bench = flying({"FS_GCS_ENABLE": 1})
    bench.run(2, lambda: beat(bench), 1.0)
    bench.run(3.5)
    assert mode(bench) == "GUIDED"
    bench.run(2)
    assert (mode(bench), critical(bench)) == ("RTL", True)
    assert (WARNING, "GCS Failsafe") in texts(bench)
    bench.run(2, lambda: beat(bench), 1.0)
    assert (WARNING, "GCS Failsafe Cleared") in texts(bench)


def test_a_ground_station_that_was_never_there_is_not_missed() -> None:
    assert mode(flying({"FS_GCS_ENABLE": 1}).run(8)) == "GUIDED"


@pytest.mark.parametrize(("action", "taken"), [(0, "GUIDED"), (1, "LAND"), (2, "RTL")])
def test_a_low_battery_does_what_its_parameter_says_and_stays_critical(action: int, taken: str) -> None:
    bench = flying({"BATT_FS_LOW_ACT": action, "BATT_LOW_TIMER": 1})
    bench.autopilot.battery_sag_v = bench.autopilot.battery_v - 10.4
    bench.run(2.2)
    assert (mode(bench), critical(bench)) == (taken, True)
    assert unhealthy(bench) == mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    assert any(
        severity == WARNING and text.startswith("Battery 1 is low 10.4") for severity, text in texts(bench)
    )
    bench.autopilot.battery_sag_v = 0.0
    assert critical(bench.run(2))


def test_a_sag_shorter_than_the_timer_triggers_nothing() -> None:
    bench = flying({"BATT_FS_LOW_ACT": 2})
    bench.autopilot.battery_sag_v = 7.0
    bench.run(8)
    bench.autopilot.battery_sag_v = 0.0
    bench.run(4)
    assert (mode(bench), critical(bench)) == ("GUIDED", False)


def test_a_reboot_forgets_a_low_battery() -> None:
    bench = flying({"BATT_LOW_TIMER": 0})
    bench.autopilot.battery_sag_v = 7.0
    bench.run(1)
    assert bench.autopilot.failsafes.any_triggered
    bench.autopilot.battery_sag_v = 0.0
    bench.autopilot.reboot(0.1)
    assert not bench.run(2).autopilot.failsafes.any_triggered


# ---- fence ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "text", "kind"),
    [
        ({"FENCE_ALT_MAX": 4}, "Max Alt fence breached", mavlink.FENCE_BREACH_MAXALT),
        ({"FENCE_RADIUS": 3}, "Circle fence breached", mavlink.FENCE_BREACH_BOUNDARY),
    ],
)
def test_leaving_the_fence_returns_the_vehicle_and_is_no_critical_state(
    parameters: dict[str, float], text: str, kind: int
) -> None:
    bench = flying()
    bench.run(3, lambda: bench.velocity(3, 0, 0))
    assert mode(bench) == "GUIDED"
    bench.autopilot.parameters.update({"FENCE_ENABLE": 1} | parameters)
    bench.run(1.5)
    assert (mode(bench), critical(bench)) == ("RTL", False)
    assert (NOTICE, text) in texts(bench)
    status = latest(bench, "FENCE_STATUS")
    assert (status.breach_status, status.breach_count, status.breach_type) == (1, 1, kind)
    assert unhealthy(bench) == mavlink.MAV_SYS_STATUS_GEOFENCE


def test_within_the_fence_again_the_breach_is_over() -> None:
    bench = flying({"AVOID_ENABLE": 0, "FENCE_ENABLE": 1, "FENCE_RADIUS": 3, "RTL_ALT": 800})
    bench.run(3, lambda: bench.velocity(3, 0, 0))
    assert mode(bench) == "RTL"
    bench.run(16)
    assert latest(bench, "FENCE_STATUS").breach_status == 0
    assert unhealthy(bench) == 0
    assert mode(bench) == "RTL"


def test_a_mode_set_outside_the_fence_is_left_to_the_pilot() -> None:
    bench = flying({"AVOID_ENABLE": 0, "FENCE_ENABLE": 1, "FENCE_RADIUS": 3})
    bench.run(3, lambda: bench.velocity(3, 0, 0))
    assert mode(bench) == "RTL"
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.LOITER) == 0
    assert mode(bench.run(5)) == "LOITER"


@pytest.mark.parametrize(("action", "taken"), [(0, "GUIDED"), (2, "LAND")])
def test_the_fence_reports_only_or_lands_as_its_parameter_says(action: int, taken: str) -> None:
    bench = flying({"FENCE_ACTION": action})
    bench.autopilot.parameters.update({"FENCE_ENABLE": 1, "FENCE_ALT_MAX": 4})
    assert mode(bench.run(1)) == taken


# ---- who is in charge -----------------------------------------------------------------------------


def test_a_failsafe_is_in_charge_until_somebody_sets_a_mode() -> None:
    bench = flying()
    assert not bench.autopilot.failsafes.in_charge
    bench.autopilot.receiver.transmitting = False
    bench.run(2)
    assert bench.autopilot.failsafes.in_charge
    bench.autopilot.receiver.transmitting = True
    bench.run(2)
    assert bench.autopilot.failsafes.in_charge
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.LOITER) == 0
    assert not bench.autopilot.failsafes.in_charge
