"""The inertial filter beside EKF3's prediction and fusion, step by step, and a vehicle that believes it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.inertial_filter import (
    GRAVITY_MS2,
    POSITION,
    TILT,
    VELOCITY,
    InertialFilter,
)
from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.autopilot.position_aiding import AIDED, DRIFT_MS2, FILTER_STEP_S
from sitl.vehicle.rigid_body import rotate, to_euler
from tests.unit.sitl.autopilot.aiding.external_poses import BODY_FRD, EXTERNAL, LOCAL_FRD, odometry
from tests.unit.sitl.bench_flight import ORIGIN, Bench

F64 = NDArray[np.float64]
ERROR_M, ERROR_MS = 0.1, 0.1
PERIOD_S = 0.1


# ---- covariance, step by step ------------------------------------------------------------------------


def stepped(covariance: F64, seconds: float) -> F64:
    """Return a covariance after EKF3's steps: its noise is added to the increments of each one."""
    dt = FILTER_STEP_S
    move = np.array([[1.0, dt, 0.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    noise = np.diag([0.0, (0.35 * dt) ** 2, (GRAVITY_MS2 * 0.015 * dt) ** 2])
    for _ in range(round(seconds / dt)):
        covariance = move @ covariance @ move.T + noise
    return covariance


def fused(covariance: F64, row: int, error: float) -> tuple[F64, F64]:
    """Return gain and covariance after the fusion of one state (FuseVelPosNED)."""
    gain = covariance[:, row] / (covariance[row, row] + error**2)
    select = np.zeros(3)
    select[row] = 1.0
    return gain, (np.eye(3) - np.outer(gain, select)) @ covariance


def test_gains_are_those_of_the_filters_own_steps() -> None:
    ours = InertialFilter(FILTER_STEP_S)
    theirs = ours.covariance.copy()
    for _ in range(50):
        theirs = stepped(theirs, 0.096)
        by_velocity, theirs = fused(theirs, VELOCITY, ERROR_MS)
        by_position, theirs = fused(theirs, POSITION, ERROR_M)
        ours.predict(0.096)
        np.testing.assert_allclose(ours.gain(VELOCITY, ERROR_MS), by_velocity, rtol=0.03, atol=1e-4)
        np.testing.assert_allclose(ours.gain(POSITION, ERROR_M), by_position, rtol=0.03, atol=1e-4)


def test_a_settled_filter_is_as_unsure_of_its_tilt_as_an_arducopter_drifts_without_gps() -> None:
    assert math.sqrt(InertialFilter(FILTER_STEP_S).covariance[TILT, TILT]) == pytest.approx(DRIFT_MS2, 0.05)


def test_the_gate_is_five_sigmas_of_innovation() -> None:
    one = InertialFilter(FILTER_STEP_S)
    sigma_m = math.sqrt(one.covariance[POSITION, POSITION] + ERROR_M**2)
    at_m = 5.0 * math.sqrt(2.0) * sigma_m
    assert one.test_ratio(POSITION, np.array([at_m, 0.0, 0.0]), ERROR_M, 5.0) == pytest.approx(1.0)
    one.reset(POSITION, 0.1)
    assert one.test_ratio(POSITION, np.array([at_m, 0.0, 0.0]), ERROR_M, 5.0) > 1.1


# ---- a vehicle that believes it ----------------------------------------------------------------------


class Odometer:
    """Source of ODOMETRY, ten a second, whose velocity and position are told from truth and estimate.

    share: of the estimate's error against the truth that it sees; 0 repeats the autopilot's own estimate.
    """

    def __init__(self, share: float) -> None:
        self.bench = Bench(wind_ms=0.0)
        self.bench.autopilot = Autopilot(ORIGIN, EXTERNAL | {"VISO_POS_M_NSE": ERROR_M, "EK3_SRC2_YAW": 1.0})
        self.bench.estimator = Estimator(
            np.random.default_rng(1), EstimateErrors.none(), self.bench.autopilot.aiding
        )
        self.bench.autopilot.add_link(0)
        self.share = share
        self.step_enu_m, self.speed_enu_ms = np.zeros(3), np.zeros(3)
        self.greatest_ms = 0.0
        self.bench.run(6.0, self.send, every_s=PERIOD_S)
        self.bench.airborne_with(self.send, 10.0)

    def send(self) -> None:
        estimate, truth = self.bench.autopilot.estimate, self.bench.truth
        if estimate is None:
            return
        self.step_enu_m = self.step_enu_m + self.speed_enu_ms * PERIOD_S
        place = estimate.pos_enu_m + self.share * (truth.pos_enu_m - estimate.pos_enu_m) + self.step_enu_m
        velocity = estimate.vel_enu_ms + self.share * (truth.vel_enu_ms - estimate.vel_enu_ms)
        velocity = velocity + self.speed_enu_ms
        yaw = to_euler(estimate.quat_wxyz)[2]
        c, s = math.cos(yaw), math.sin(yaw)
        ahead, right = c * velocity[1] + s * velocity[0], c * velocity[0] - s * velocity[1]
        stamp_us = self.bench.now_ns // 1000
        self.bench.tell(
            odometry(
                place, stamp_us, yaw_rad=yaw, frames=(LOCAL_FRD, BODY_FRD),
                velocity=(float(ahead), float(right), float(-velocity[2])),
            )
        )  # fmt: skip
        self.greatest_ms = max(self.greatest_ms, float(np.hypot(velocity[0], velocity[1])))

    def without_gps(self, seconds: float) -> None:
        self.greatest_ms = 0.0
        self.bench.autopilot.aiding.lose_gps(0.0)
        self.bench.command(mavlink.MAV_CMD_SET_EKF_SOURCE_SET, 2)
        self.fly(seconds)

    def fly(self, seconds: float) -> None:
        self.bench.run(seconds, self.send, every_s=PERIOD_S)

    @property
    def error_m(self) -> float:
        estimate = self.bench.autopilot.estimate
        assert estimate is not None
        return float(np.hypot(*(estimate.pos_enu_m - self.bench.truth.pos_enu_m)[:2]))


def test_an_estimate_that_comes_back_as_its_own_evidence_leads_the_vehicle_away() -> None:
    echo = Odometer(0.0)
    start_m = echo.bench.truth.pos_enu_m.copy()
    echo.without_gps(28.0)
    aiding = echo.bench.autopilot.aiding
    assert echo.error_m > 8.0
    assert np.hypot(*(echo.bench.truth.pos_enu_m - start_m)[:2]) > 8.0
    assert echo.greatest_ms < 0.5  # it claims to hover
    assert float(np.hypot(*echo.bench.truth.vel_enu_ms[:2])) > 0.6
    assert aiding.flags == AIDED
    assert aiding.position_test_ratio < 1.0


def test_an_odometry_that_sees_holds_the_vehicle() -> None:
    seeing = Odometer(1.0)
    seeing.without_gps(28.0)
    assert seeing.error_m < 0.15


def test_a_step_within_the_gate_is_believed_and_one_beyond_is_not() -> None:
    for step_m, followed_m in ((0.5, 0.5), (6.0, 0.0)):
        seeing = Odometer(1.0)
        seeing.without_gps(5.0)
        seeing.step_enu_m = np.array([step_m, 0.0, 0.0])
        seeing.fly(4.0)
        assert seeing.error_m == pytest.approx(followed_m, abs=0.2)


def test_a_ramp_is_believed_with_its_velocity_and_bends_the_tilt_meanwhile() -> None:
    seeing = Odometer(1.0)
    seeing.without_gps(5.0)
    seeing.speed_enu_ms = np.array([0.5, 0.0, 0.0])  # 0.75 m/s at once would be rejected
    seeing.fly(0.5)
    estimate = seeing.bench.autopilot.estimate
    assert estimate is not None
    down = np.array([0.0, 0.0, 1.0])
    apart = rotate(estimate.quat_wxyz, down) - rotate(seeing.bench.truth.quat_wxyz, down)
    assert math.degrees(float(np.linalg.norm(apart))) > 0.3
    seeing.fly(9.5)
    assert seeing.error_m == pytest.approx(5.0, abs=0.3)
    assert seeing.bench.truth.vel_enu_ms[0] == pytest.approx(-0.5, abs=0.1)
