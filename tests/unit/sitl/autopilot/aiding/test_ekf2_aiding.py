"""PX4's filter: GNSS and external vision together, each without the other, and what is told of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.ekf2_aiding import INVALID, VALID, Ekf2Aiding
from sitl.autopilot.aiding.ekf2_odometry import Ekf2Odometry
from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.autopilot.parameters import with_defaults
from tests.unit.sitl.autopilot.aiding.external_poses import (
    BODY_FRD,
    LOCAL_FRD,
    Lidar,
    error_m,
    heading_error_deg,
    odometry,
    run,
)
from tests.unit.sitl.bench_flight import ORIGIN, Bench

LOCAL_NED, LOCAL_ENU, LOCAL_FLU = (
    mavlink.MAV_FRAME_LOCAL_NED,
    mavlink.MAV_FRAME_LOCAL_ENU,
    mavlink.MAV_FRAME_LOCAL_FLU,
)


def hovering(**parameters: float) -> tuple[Bench, Lidar, Ekf2Aiding]:
    """Return a vehicle ten metres up with PX4's filter, GNSS, and poses that it fuses."""
    bench = Bench(wind_ms=0.0)
    bench.autopilot = Autopilot(ORIGIN, {"EKF2_EN": 1.0, "EKF2_EV_CTRL": 5.0} | parameters)
    bench.estimator = Estimator(np.random.default_rng(1), EstimateErrors.none(), bench.autopilot.aiding)
    bench.autopilot.add_link(0)
    lidar = Lidar(bench, frames=(LOCAL_NED, BODY_FRD))
    bench.run(6.0, lidar, every_s=0.1)
    bench.airborne_with(lidar, 10.0)
    assert bench.autopilot.airborne
    aiding = bench.autopilot.aiding
    assert isinstance(aiding, Ekf2Aiding)
    return bench, lidar, aiding


def test_by_default_the_filter_is_ardupilots_and_has_no_parameter_of_px4() -> None:
    autopilot = Autopilot(ORIGIN)
    assert not isinstance(autopilot.aiding, Ekf2Aiding)
    assert not any(name.startswith("EKF2_") for name in autopilot.parameters)


def test_beside_gnss_wrong_poses_do_not_move_the_estimate() -> None:
    bench, lidar, aiding = hovering()
    lidar.error_enu_m = np.array([1.0, -2.0, 0.0])
    run(bench, lidar, 10.0)
    assert (aiding.fuses_gnss, aiding.fuses_vision) == (True, True)
    np.testing.assert_allclose(error_m(bench), 0.0, atol=1e-6)


def test_gnss_lost_poses_keep_the_position_in_their_own_frame() -> None:
    bench, lidar, aiding = hovering()
    lidar.error_enu_m = np.array([0.0, 3.0, 0.0])
    run(bench, lidar, 5.0)
    aiding.lose_gps(0.0)
    run(bench, lidar, 6.0)
    assert np.hypot(*error_m(bench)) < 0.1
    run(bench, lidar, 20.0)
    np.testing.assert_allclose(error_m(bench), (0.0, 3.0), atol=0.1)
    assert aiding.flags == VALID
    assert not aiding.fuses_gnss
    assert not bench.autopilot.failsafes.ekf


def test_gnss_lost_without_poses_the_position_is_invalid_after_five_seconds() -> None:
    bench, lidar, aiding = hovering(EKF2_EV_CTRL=0.0)
    aiding.lose_gps(0.0)
    run(bench, lidar, 4.5)
    assert aiding.flags == VALID
    run(bench, lidar, 1.0)
    assert aiding.flags == INVALID
    assert 0.3 < np.hypot(*error_m(bench)) < 0.8


@pytest.mark.parametrize("kind", ["silent", "bad"])
def test_poses_that_end_or_turn_bad_after_gnss_end_in_an_invalid_position(kind: str) -> None:
    bench, lidar, aiding = hovering(EKF2_EV_QMIN=50.0)
    aiding.lose_gps(0.0)
    run(bench, lidar, 10.0)
    assert aiding.flags == VALID
    lidar.is_on, lidar.quality = kind == "bad", 20
    run(bench, lidar, 6.5)
    assert aiding.flags == INVALID
    lidar.is_on, lidar.quality = True, 90
    run(bench, lidar, 0.5)
    assert aiding.flags == VALID


def test_gnss_that_returns_near_the_estimate_is_fused_without_a_jump() -> None:
    bench, lidar, aiding = hovering()
    aiding.lose_gps(0.0)
    lidar.error_enu_m = np.array([0.5, 0.0, 0.0])
    run(bench, lidar, 12.0)
    aiding.regain_gps()
    run(bench, lidar, 9.0)
    assert not aiding.fuses_gnss
    run(bench, lidar, 8.0)
    assert aiding.fuses_gnss
    assert np.hypot(*error_m(bench)) < 0.05


def test_gnss_that_returns_far_from_the_estimate_is_left_out() -> None:
    bench, lidar, aiding = hovering()
    aiding.lose_gps(0.0)
    lidar.error_enu_m = np.array([8.0, 0.0, 0.0])
    run(bench, lidar, 12.0)
    aiding.regain_gps()
    run(bench, lidar, 15.0)
    assert not aiding.fuses_gnss
    np.testing.assert_allclose(error_m(bench), (8.0, 0.0), atol=0.2)


def test_a_takeover_of_gnss_is_a_fault_where_poses_are_fused_and_a_reset_where_not() -> None:
    for bits, expected_m in ((5.0, 0.0), (0.0, 30.0)):
        bench, lidar, aiding = hovering(EKF2_EV_CTRL=bits)
        aiding.gnss.error_enu_m = np.array([30.0, 0.0, 0.0])
        run(bench, lidar, 6.0)
        assert np.hypot(*error_m(bench)) < 0.1
        assert aiding.position_test_ratio > 1.0
        run(bench, lidar, 6.0)
        assert np.hypot(*error_m(bench)) == pytest.approx(expected_m, abs=0.2)
        assert aiding.fuses_gnss is (bits == 0.0)


def test_a_frame_of_its_own_heading_is_turned_into_the_filters() -> None:
    bench, lidar, aiding = hovering()
    lidar.frames, lidar.turn_rad = (LOCAL_FRD, BODY_FRD), math.radians(-90.0)
    lidar.is_turned = True
    lidar.error_enu_m = np.array([2.0, 0.0, 0.0])
    run(bench, lidar, 5.0)
    aiding.lose_gps(0.0)
    run(bench, lidar, 7.5)
    assert aiding.flags == VALID
    np.testing.assert_allclose(error_m(bench), (2.0, 0.0), atol=0.1)
    assert heading_error_deg(bench) == pytest.approx(0.0, abs=0.1)


def test_a_heading_is_fused_in_a_frame_towards_north_only_while_gnss_is() -> None:
    for frame, error_deg in ((LOCAL_NED, 6.0), (LOCAL_FRD, 0.0)):
        bench, lidar, _ = hovering(EKF2_EV_CTRL=13.0)
        lidar.frames, lidar.turn_rad = (frame, BODY_FRD), math.radians(6.0)
        run(bench, lidar, 10.0)
        assert heading_error_deg(bench) == pytest.approx(error_deg, abs=0.7)


@pytest.mark.parametrize(
    ("frame", "place_enu_m"),
    [
        (LOCAL_NED, (4.0, 3.0, 5.0)),
        (LOCAL_FRD, (4.0, 3.0, 5.0)),
        (LOCAL_ENU, (3.0, 4.0, -5.0)),
        (LOCAL_FLU, (-4.0, 3.0, -5.0)),
    ],
)
def test_four_frames_are_taken(frame: int, place_enu_m: tuple[float, float, float]) -> None:
    receiver = Ekf2Odometry(with_defaults({"EKF2_EN": 1.0, "EKF2_EV_CTRL": 1.0}))
    receiver.on_odometry(odometry(np.array([4.0, 3.0, 5.0]), 1_000, frames=(frame, BODY_FRD)), 10**9)
    (pose,) = receiver.drain(None)
    np.testing.assert_allclose(pose.position_enu_m, place_enu_m)


def test_a_frame_of_the_body_is_none_for_a_position() -> None:
    receiver = Ekf2Odometry(with_defaults({"EKF2_EN": 1.0, "EKF2_EV_CTRL": 1.0}))
    receiver.on_odometry(odometry(np.zeros(3), 1_000, frames=(BODY_FRD, BODY_FRD)), 10**9)
    assert receiver.drain(None) == []
    assert receiver.refused == 1


def test_it_reports_by_estimator_status_alone() -> None:
    bench, lidar, aiding = hovering()
    aiding.lose_gps(0.0)
    bench.sent.clear()
    run(bench, lidar, 2.0)
    sent = {message.get_type() for message in bench.sent}
    assert "ESTIMATOR_STATUS" in sent
    assert "EKF_STATUS_REPORT" not in sent
    assert [m.flags for m in bench.sent if m.get_type() == "ESTIMATOR_STATUS"][-1] == VALID
