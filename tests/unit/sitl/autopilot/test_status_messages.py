"""Health reports of the simulated autopilot, as those of ArduCopter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.vehicle.multirotor import GRAVITY_MS2
from tests.unit.sitl.bench_flight import ORIGIN, TICK_NS, Bench

HEALTHY = 831
GPS, RADIO, BATTERY, FENCE, READY = (
    mavlink.MAV_SYS_STATUS_SENSOR_GPS,
    mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER,
    mavlink.MAV_SYS_STATUS_SENSOR_BATTERY,
    mavlink.MAV_SYS_STATUS_GEOFENCE,
    mavlink.MAV_SYS_STATUS_PREARM_CHECK,
)


def latest(bench: Bench, number: int) -> Any:
    bench.autopilot.take_outgoing(bench.now_ns)
    assert bench.autopilot.telemetry.send_once(number, 0)
    return bench.autopilot.take_outgoing(bench.now_ns)[-1][1]


def state(bench: Bench) -> int:
    return int(latest(bench, mavlink.MAVLINK_MSG_ID_HEARTBEAT).system_status)


def health(bench: Bench) -> tuple[int, int]:
    """Return the bits of SYS_STATUS that are enabled and those that are healthy."""
    status = latest(bench, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    assert status.onboard_control_sensors_present & status.onboard_control_sensors_enabled
    return status.onboard_control_sensors_enabled, status.onboard_control_sensors_health


def test_a_sound_flight_reports_itself_sound() -> None:
    bench = Bench().airborne(5)
    ekf = latest(bench, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT)
    assert ekf.flags == HEALTHY
    assert max(ekf.velocity_variance, ekf.pos_horiz_variance, ekf.pos_vert_variance) < 0.1
    gps = latest(bench, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)
    assert gps.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
    assert gps.satellites_visible > 10
    enabled, healthy = health(bench)
    assert enabled & ~healthy == 0
    assert enabled & (GPS | RADIO | BATTERY | READY) == GPS | RADIO | BATTERY | READY


def test_the_state_is_standby_on_the_ground_and_active_in_the_air() -> None:
    bench = Bench().run(6)
    assert state(bench) == mavlink.MAV_STATE_STANDBY
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED) == 0
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
    assert state(bench.run(0.5)) == mavlink.MAV_STATE_STANDBY
    assert bench.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 4) == 0
    assert state(bench.run(6)) == mavlink.MAV_STATE_ACTIVE
    assert bench.command(mavlink.MAV_CMD_NAV_LAND) == 0
    assert state(bench.run(20)) == mavlink.MAV_STATE_STANDBY


def test_before_it_has_settled_the_filter_keeps_its_position_constant() -> None:
    bench = Bench().run(1)
    flags = latest(bench, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT).flags
    assert flags & mavlink.EKF_CONST_POS_MODE
    assert not flags & mavlink.EKF_POS_HORIZ_ABS
    assert not health(bench)[1] & READY


def test_a_transmitter_at_rest_has_its_sticks_centred() -> None:
    channels = latest(Bench().run(1), mavlink.MAVLINK_MSG_ID_RC_CHANNELS)
    assert (channels.chan1_raw, channels.chan2_raw, channels.chan4_raw) == (1500, 1500, 1500)
    assert 1000 <= channels.chan3_raw <= 1500
    assert channels.chan5_raw == 1800
    assert channels.chancount == 8


def test_a_fence_is_reported_only_while_there_is_one() -> None:
    bench = Bench().run(1)
    enabled, healthy = health(bench)
    assert (enabled & FENCE, healthy & FENCE) == (0, FENCE)
    assert not bench.autopilot.telemetry.send_once(mavlink.MAVLINK_MSG_ID_FENCE_STATUS, 0)
    bench.autopilot.parameters["FENCE_ENABLE"] = 1
    enabled, healthy = health(bench.run(1))
    assert enabled & healthy & FENCE
    assert latest(bench, mavlink.MAVLINK_MSG_ID_FENCE_STATUS).breach_status == 0


@pytest.mark.parametrize(
    "name", ["EKF_STATUS_REPORT", "GPS_RAW_INT", "RC_CHANNELS", "FENCE_STATUS", "SYS_STATUS", "HEARTBEAT"]
)
def test_each_comes_at_the_rate_that_is_asked_for(name: str) -> None:
    bench = Bench().run(1)
    bench.autopilot.parameters["FENCE_ENABLE"] = 1
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 100_000) == 0
    bench.sent.clear()
    bench.run(2)
    assert sum(m.get_type() == name for m in bench.sent) == pytest.approx(20, abs=2)


# Telemetry of the simulated autopilot: contents and times.


def test_a_position_is_stamped_with_the_time_it_was_true() -> None:
    bench = Bench().airborne(10)
    bench.run(8, lambda: bench.velocity(4, 0, 0))
    when: dict[int, float] = {}
    for _ in range(8):
        when[(bench.now_ns + bench.autopilot.boot_offset_ns) // 1_000_000] = float(bench.truth.pos_enu_m[0])
        bench.tick()
        message = latest(bench, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        assert message.y == pytest.approx(when[message.time_boot_ms], abs=1e-6)


def test_the_gps_stamps_the_estimate_too() -> None:
    bench = Bench().airborne(10)
    boot_us = (bench.now_ns - TICK_NS + bench.autopilot.boot_offset_ns) // 1000
    assert latest(bench, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT).time_usec == boot_us


def test_sim_state_gives_specific_force_and_places_as_ardupilot_fills_them() -> None:
    bench = Bench(wind_ms=0.0).run(2)
    message = latest(bench, mavlink.MAVLINK_MSG_ID_SIM_STATE)
    np.testing.assert_allclose((message.xacc, message.yacc, message.zacc), (0, 0, -GRAVITY_MS2), atol=1e-6)
    assert (message.lat_int, message.lon_int) == (round(ORIGIN[0] * 1e7), round(ORIGIN[1] * 1e7))
    assert message.lat == pytest.approx(ORIGIN[0] * 1e7, rel=1e-6)
    assert message.lon == pytest.approx(ORIGIN[1] * 1e7, rel=1e-6)


def test_a_multirotor_feels_only_thrust_along_its_axis_and_drag() -> None:
    bench = Bench(wind_ms=0.0).airborne(10)
    bench.autopilot.truth_source = lambda: bench.truth
    bench.run(1, lambda: bench.velocity(6, 0, 0))
    assert np.abs(bench.truth.acc_enu_ms2[:2]).max() > 1.0
    message = latest(bench, mavlink.MAVLINK_MSG_ID_SIM_STATE)
    drag_ms2 = 0.25 * float(np.sqrt(np.sum(np.square(bench.truth.vel_enu_ms))))
    assert np.hypot(message.xacc, message.yacc) < drag_ms2 + 0.05
    assert message.zacc < -8.0
