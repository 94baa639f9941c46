"""Errors of the simulated estimator: size and rate as configured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.estimator import SEVERITIES, EstimateErrors, Estimator
from sitl.vehicle.multirotor import DRAG_PER_S
from sitl.vehicle.rigid_body import State, from_euler, multiply
from sitl.vehicle.wind_field import wind_profile
from tests.unit.sitl.bench_flight import Bench

F64 = NDArray[np.float64]
TRUTH = State(
    pos_enu_m=np.array([10.0, -20.0, 30.0]),
    vel_enu_ms=np.array([1.0, 2.0, -0.5]),
    quat_wxyz=from_euler(0.1, -0.2, 2.5),
    rates_frd_rad_s=np.array([0.01, 0.02, 0.03]),
    acc_enu_ms2=np.zeros(3),
)


def turn_deg(estimate: State) -> F64:
    """Return the small rotation (3,), north-east-down degrees, between truth and estimate."""
    inverse = TRUTH.quat_wxyz * np.array([1.0, -1.0, -1.0, -1.0])
    error = multiply(estimate.quat_wxyz, inverse)
    return np.asarray(np.degrees(2 * error[1:] * np.sign(error[0])))


def errors_over_runs(errors: EstimateErrors, seconds: float, runs: int = 400) -> tuple[F64, F64, F64]:
    """Return position, velocity and attitude errors (runs, 3) at the end of independent runs."""
    out = np.empty((3, runs, 3))
    for run in range(runs):
        estimator = Estimator(np.random.default_rng(run), errors)
        for _ in range(max(1, round(seconds / 0.1))):
            estimate = estimator.update(0.1, TRUTH)
        out[0, run] = estimate.pos_enu_m - TRUTH.pos_enu_m
        out[1, run] = estimate.vel_enu_ms - TRUTH.vel_enu_ms
        out[2, run] = turn_deg(estimate)
    return out[0], out[1], out[2]


@pytest.mark.parametrize("seconds", [0.1, 20.0])
def test_errors_have_the_spread_configured_from_the_first_moment_on(seconds: float) -> None:
    e = EstimateErrors()
    position, velocity, attitude = errors_over_runs(e, seconds)
    # Smoothing takes away up to a sixth of the fastest of them, velocity.
    np.testing.assert_allclose(position.std(axis=0), [e.horizontal_m] * 2 + [e.vertical_m], rtol=0.2)
    np.testing.assert_allclose(velocity.std(axis=0), e.velocity_ms, rtol=0.25)
    np.testing.assert_allclose(attitude.std(axis=0), [e.tilt_deg] * 2 + [e.yaw_deg], rtol=0.2)
    assert np.abs(position.mean(axis=0)).max() < 0.15 * 3 / np.sqrt(len(position))


def test_the_position_error_wanders_over_a_minute_not_over_a_second() -> None:
    changes = []
    for run in range(60):
        estimator = Estimator(np.random.default_rng(run))
        first = estimator.update(0.1, TRUTH).pos_enu_m
        for _ in range(10):
            second = estimator.update(0.1, TRUTH).pos_enu_m
        for _ in range(1200):
            late = estimator.update(0.1, TRUTH).pos_enu_m
        changes.append((second - first, late - first))
    within_second, within_minutes = np.array(changes).std(axis=(0, 2))
    assert within_second < 0.03
    assert within_minutes > 0.1


def test_without_errors_the_estimate_is_the_truth() -> None:
    estimator = Estimator(np.random.default_rng(0), EstimateErrors.none())
    for _ in range(5):
        estimate = estimator.update(0.1, TRUTH)
    for name in ("pos_enu_m", "vel_enu_ms", "quat_wxyz", "rates_frd_rad_s"):
        np.testing.assert_array_equal(getattr(estimate, name), getattr(TRUTH, name))


def test_a_filter_reset_moves_every_later_position_and_nothing_else() -> None:
    estimator = Estimator(np.random.default_rng(0), EstimateErrors.none())
    estimator.jump_enu_m[:] = (3.0, 0.0, -1.0)
    estimate = estimator.update(0.1, TRUTH)
    np.testing.assert_allclose(estimate.pos_enu_m - TRUTH.pos_enu_m, (3.0, 0.0, -1.0))
    np.testing.assert_array_equal(estimate.vel_enu_ms, TRUTH.vel_enu_ms)


def test_the_truth_is_left_as_it_was() -> None:
    before = [a.copy() for a in (TRUTH.pos_enu_m, TRUTH.vel_enu_ms, TRUTH.quat_wxyz)]
    Estimator(np.random.default_rng(0)).update(0.1, TRUTH)
    for now, then in zip((TRUTH.pos_enu_m, TRUTH.vel_enu_ms, TRUTH.quat_wxyz), before, strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize(("name", "level_m", "up_m"), [("light", 0.092, 0.031), ("severe", 0.735, 0.245)])
def test_a_drift_is_a_random_walk_of_the_size_of_its_severity(name: str, level_m: float, up_m: float) -> None:
    drift = EstimateErrors.of_severity(name)
    alone = replace(EstimateErrors.none(), drift_ms=drift.drift_ms, drift_up_ms=drift.drift_up_ms)
    still = replace(TRUTH, quat_wxyz=from_euler(0.0, 0.0, 2.5))
    ends = []
    for run in range(400):
        estimator = Estimator(np.random.default_rng(run), alone)
        for _ in range(120):
            estimate = estimator.update(0.5, still)
        ends.append(estimate.pos_enu_m - TRUTH.pos_enu_m)
    np.testing.assert_allclose(np.std(ends, axis=0), [level_m, level_m, up_m], rtol=0.1)


def test_a_drift_has_the_velocity_that_it_reports() -> None:
    estimator = Estimator(np.random.default_rng(1), replace(EstimateErrors.none(), drift_ms=0.1))
    first = estimator.update(0.1, TRUTH)
    for _ in range(50):
        second = estimator.update(0.1, TRUTH)
    moved = (second.pos_enu_m - first.pos_enu_m) / 5.0
    np.testing.assert_allclose(moved, second.vel_enu_ms - TRUTH.vel_enu_ms, atol=1e-9)
    assert np.linalg.norm(moved) > 0.01


def test_no_drift_is_the_default_and_draws_the_same_errors() -> None:
    assert EstimateErrors.of_severity("none") == EstimateErrors()
    both = [Estimator(np.random.default_rng(3), EstimateErrors.of_severity(n)) for n in ("none", "severe")]
    first, second = (each.update(0.1, TRUTH) for each in both)
    np.testing.assert_array_equal(first.quat_wxyz, second.quat_wxyz)
    assert list(SEVERITIES) == ["none", "light", "moderate", "strong", "severe"]


def test_an_unknown_severity_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match="'gentle': there are none, light, moderate, strong, severe"):
        EstimateErrors.of_severity("gentle")


# The simulated autopilot's wind estimate, and WIND as ArduPilot sends it.


UP_M = 20.0


def reported(bench: Bench) -> list[Any]:
    return [message for message in bench.sent if message.get_type() == "WIND"]


@pytest.mark.parametrize(("from_deg", "sent_deg"), [(90.0, 90.0), (200.0, -160.0), (315.0, -45.0)])
def test_wind_is_told_by_where_it_comes_from(from_deg: float, sent_deg: float) -> None:
    bench = Bench(wind_ms=6.0, wind_from_deg=from_deg, gust_ms=0.0)
    bench.autopilot.parameters["EK3_DRAG_MCOEF"] = DRAG_PER_S
    newest = reported(bench.airborne(UP_M))[-1]
    assert newest.direction == pytest.approx(sent_deg, abs=2)
    assert newest.speed == pytest.approx(6.0 * wind_profile(UP_M), rel=0.03)
    assert newest.speed_z == pytest.approx(0.0, abs=0.05)


def test_its_own_motion_is_no_wind() -> None:
    bench = Bench(wind_ms=6.0, wind_from_deg=90.0, gust_ms=0.0).airborne(UP_M)
    still = reported(bench)[-1]
    bench.run(12, lambda: bench.velocity(0, 5, 0))
    moving = reported(bench)[-1]
    assert moving.direction == pytest.approx(still.direction, abs=6)
    assert moving.speed == pytest.approx(still.speed, rel=0.1)


def test_it_is_sent_once_a_second_in_the_air_alone_and_as_often_as_asked() -> None:
    bench = Bench(wind_ms=3.0).run(4)
    assert reported(bench) == []
    bench.airborne(UP_M)
    before = len(reported(bench))
    assert len(reported(bench.run(5))) - before == pytest.approx(5, abs=1)
    bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_WIND, 200_000)
    before = len(reported(bench))
    assert len(reported(bench.run(5))) - before == pytest.approx(25, abs=2)


def test_without_a_drag_coefficient_arducopter_tells_no_wind() -> None:
    bench = Bench(wind_ms=5.0)
    bench.autopilot.parameters["EK3_DRAG_MCOEF"] = 0.0
    assert reported(bench.airborne(UP_M)) == []


def test_an_estimate_with_errors_stays_within_a_metre_per_second_on_average() -> None:
    bench = Bench(EstimateErrors(), wind_ms=5.0, wind_from_deg=0.0, seed=3).airborne(UP_M).run(60)
    north = [-m.speed * np.cos(np.radians(m.direction)) for m in reported(bench)[-60:]]
    assert np.mean(north) == pytest.approx(-5.0 * wind_profile(UP_M), abs=1.0)
