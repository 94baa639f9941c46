"""Telemetry of the simulated autopilot: contents and times."""

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.vehicle.multirotor import GRAVITY_MS2
from tests.unit.sitl.bench_flight import ORIGIN, TICK_NS, Bench


def latest(bench: Bench, number: int) -> Any:
    bench.autopilot.take_outgoing(bench.now_ns)
    assert bench.autopilot.telemetry.send_once(number, 0)
    return bench.autopilot.take_outgoing(bench.now_ns)[-1][1]


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
