"""The estimate under external navigation: followed, switched to, lost, rejected and returned to GPS."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.autopilot.modes import Mode
from sitl.autopilot.position_aiding import AIDED, TIMED_OUT, UNAIDED
from tests.unit.sitl.autopilot.aiding.external_poses import EXTERNAL, Lidar, error_m, heading_error_deg, run
from tests.unit.sitl.bench_flight import ORIGIN, TICK_NS, Bench

F64 = NDArray[np.float64]


def hovering(tick_ns: int = TICK_NS, **parameters: float) -> tuple[Bench, Lidar]:
    """Return a vehicle ten metres up with GPS, and poses that are not yet used."""
    bench = Bench(wind_ms=0.0, tick_ns=tick_ns)
    bench.autopilot = Autopilot(ORIGIN, EXTERNAL | parameters)
    bench.estimator = Estimator(np.random.default_rng(1), EstimateErrors.none(), bench.autopilot.aiding)
    bench.autopilot.add_link(0)
    lidar = Lidar(bench)
    bench.run(6.0, lidar, every_s=0.1)
    bench.airborne_with(lidar, 10.0)
    assert bench.autopilot.airborne
    return bench, lidar


def use_set(bench: Bench, number: int) -> int:
    return bench.command(mavlink.MAV_CMD_SET_EKF_SOURCE_SET, number)


def largest_jump_m(bench: Bench, lidar: Lidar, seconds: float) -> float:
    """Return the largest change of the estimate's error within a tick."""
    steps, before = [], error_m(bench)
    for tick in range(round(seconds * 1e9 / bench.tick_ns)):
        if tick % 40 == 0:
            lidar()
        bench.tick()
        steps.append(float(np.hypot(*(error_m(bench) - before))))
        before = error_m(bench)
    return max(steps)


def test_a_set_that_does_not_exist_is_denied() -> None:
    bench = Bench()
    assert use_set(bench, 2) == mavlink.MAV_RESULT_ACCEPTED
    assert use_set(bench, 4) == mavlink.MAV_RESULT_DENIED
    assert use_set(bench, 0) == mavlink.MAV_RESULT_DENIED
    assert bench.autopilot.aiding.sources.active == 2


def test_with_vision_odometry_it_arms_only_while_poses_come() -> None:
    bench = Bench()
    bench.autopilot = Autopilot(ORIGIN, EXTERNAL)
    bench.run(6.0)
    assert bench.autopilot.arm() == "Arm: VisOdom: not healthy"
    lidar = Lidar(bench)
    run(bench, lidar, 0.5)
    bench.autopilot.set_mode(Mode.GUIDED)
    assert bench.autopilot.arm() is None


def test_without_a_switch_wrong_poses_change_nothing() -> None:
    bench, lidar = hovering()
    lidar.error_enu_m = np.array([30.0, -10.0, 0.0])
    run(bench, lidar, 5.0)
    np.testing.assert_allclose(error_m(bench), 0.0, atol=1e-6)


def test_a_switch_is_no_jump_and_the_estimate_then_follows_the_poses() -> None:
    bench, lidar = hovering()
    lidar.error_enu_m = np.array([30.0, -10.0, 0.0])
    run(bench, lidar, 1.0)
    use_set(bench, 2)
    assert largest_jump_m(bench, lidar, 2.0) < 0.05
    lidar.error_enu_m = lidar.error_enu_m + np.array([0.6, 0.0, 0.0])
    run(bench, lidar, 8.0)
    np.testing.assert_allclose(error_m(bench), (0.6, 0.0), atol=0.05)
    assert bench.autopilot.aiding.flags == AIDED


def test_gps_lost_under_external_navigation_is_of_no_consequence() -> None:
    bench, lidar = hovering()
    use_set(bench, 2)
    run(bench, lidar, 2.0)
    bench.autopilot.aiding.lose_gps(0.0)
    run(bench, lidar, 20.0)
    assert np.hypot(*error_m(bench)) < 0.1
    assert bench.autopilot.aiding.flags == AIDED
    assert bench.autopilot.aiding.fix_type == mavlink.GPS_FIX_TYPE_NO_FIX
    assert not bench.autopilot.failsafes.ekf


def test_a_switch_after_the_loss_of_gps_keeps_the_position() -> None:
    bench, lidar = hovering()
    bench.autopilot.aiding.lose_gps(0.0)
    run(bench, lidar, 3.0)
    use_set(bench, 2)
    run(bench, lidar, 20.0)
    assert bench.autopilot.aiding.absolute
    assert np.hypot(*error_m(bench)) < 0.4  # drifted and aligned to for three seconds


def test_poses_that_come_too_late_return_an_abandoned_position_by_a_reset() -> None:
    bench, lidar = hovering()
    bench.autopilot.aiding.lose_gps(0.0)
    run(bench, lidar, 9.0)
    assert not bench.autopilot.aiding.absolute
    use_set(bench, 2)
    run(bench, lidar, 0.3)
    assert bench.autopilot.aiding.flags == AIDED


@pytest.mark.parametrize("kind", ["silent", "bad"])
def test_poses_that_stop_or_turn_bad_end_in_the_loss_of_the_position(kind: str) -> None:
    bench, lidar = hovering()
    use_set(bench, 2)
    run(bench, lidar, 2.0)
    lidar.is_on, lidar.quality = kind == "bad", -1
    flags = []
    for _ in range(16):
        run(bench, lidar, 1.0)
        flags.append(bench.autopilot.aiding.flags)
    assert flags[5] == AIDED
    assert flags[8] == TIMED_OUT
    assert flags[15] == UNAIDED
    assert 0.5 < np.hypot(*error_m(bench)) < 3.0
    assert bench.autopilot.mode is Mode.LAND
    assert bench.autopilot.failsafes.ekf


def test_a_distant_pose_is_rejected_until_the_filter_resets_itself_to_it() -> None:
    bench, lidar = hovering()
    use_set(bench, 2)
    run(bench, lidar, 2.0)
    lidar.error_enu_m = np.array([5.0, 0.0, 0.0])
    run(bench, lidar, 5.0)
    assert np.hypot(*error_m(bench)) < 0.3
    assert bench.autopilot.aiding.position_test_ratio > 1.0
    assert bench.autopilot.aiding.flags == AIDED
    run(bench, lidar, 7.0)
    np.testing.assert_allclose(error_m(bench), (5.0, 0.0), atol=0.3)


def test_a_reset_of_the_sender_is_taken_at_once_and_the_vehicle_stays() -> None:
    bench, lidar = hovering()
    use_set(bench, 2)
    run(bench, lidar, 2.0)
    before_m = bench.truth.pos_enu_m
    lidar.error_enu_m, lidar.resets = np.array([5.0, 0.0, 0.0]), 1
    run(bench, lidar, 3.0)
    np.testing.assert_allclose(error_m(bench), (5.0, 0.0), atol=0.1)
    assert np.linalg.norm(bench.truth.pos_enu_m - before_m) < 0.5


def test_back_to_gps_is_a_jump_that_clients_see() -> None:
    bench, lidar = hovering(tick_ns=2_500_000)
    use_set(bench, 2)
    lidar.error_enu_m = np.array([0.0, 1.0, 0.0])
    run(bench, lidar, 8.0)
    np.testing.assert_allclose(error_m(bench), (0.0, 1.0), atol=0.1)
    use_set(bench, 1)
    assert largest_jump_m(bench, lidar, 1.0) == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(error_m(bench), 0.0, atol=1e-5)  # a tick old: the corrected tilt moves it


def test_a_delay_that_the_filter_does_not_know_is_an_error_in_flight() -> None:
    errors = []
    for delay_ms in (10.0, 110.0):
        bench, lidar = hovering(VISO_DELAY_MS=delay_ms)
        use_set(bench, 2)
        run(bench, lidar, 1.0)
        lidar.late_s = 0.1

        def push(bench: Bench = bench, lidar: Lidar = lidar) -> None:
            bench.velocity(0.0, 4.0, 0.0)
            lidar()

        bench.run(6.0, push, every_s=0.1)
        errors.append(float(error_m(bench)[1]))
    assert errors[0] < errors[1] - 0.15


def test_the_heading_follows_the_poses_where_the_set_says_so() -> None:
    bench, lidar = hovering(tick_ns=2_500_000)
    use_set(bench, 2)
    lidar.turn_rad = math.radians(8.0)
    run(bench, lidar, 20.0)
    assert heading_error_deg(bench) == pytest.approx(8.0, abs=0.5)
    use_set(bench, 1)
    run(bench, lidar, 0.2)
    assert heading_error_deg(bench) == pytest.approx(0.0, abs=0.1)


def test_a_heading_of_the_compass_ignores_the_poses() -> None:
    bench, lidar = hovering(EK3_SRC2_YAW=1.0)
    use_set(bench, 2)
    lidar.turn_rad = math.radians(8.0)
    run(bench, lidar, 5.0)
    assert heading_error_deg(bench) == pytest.approx(0.0, abs=0.1)


def test_a_reboot_returns_to_the_first_set() -> None:
    bench, lidar = hovering()
    use_set(bench, 2)
    run(bench, lidar, 1.0)
    bench.autopilot.reboot(0.5)
    assert bench.autopilot.aiding.sources.active == 1
