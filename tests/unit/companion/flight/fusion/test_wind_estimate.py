"""Wind from the autopilot's messages, and from the tilt of the simulator's vehicle."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.wind_estimate import WindAverage, WindEstimate
from companion.flight.fusion.wind_from_tilt import GRAVITY_MS2, TiltWind
from companion.flight.geometry.wind import Wind
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.vehicle_state import VehicleState
from sitl.autopilot.estimator import EstimateErrors
from sitl.vehicle.multirotor import DRAG_PER_S
from sitl.vehicle.wind_field import wind_profile
from tests.unit.companion.flight.link.messages import received
from tests.unit.sitl.bench_flight import Bench

S = 1_000_000_000
UP_M = 20.0
FLYING = VehicleState(
    sysid=1,
    autopilot=ARDUPILOT,
    vehicle_type=mavlink.MAV_TYPE_QUADROTOR,
    armed=True,
    reported_landed="in_air",
)
ON_GROUND = replace(FLYING, armed=False, reported_landed="on_ground")


def watched(bench: Bench, seconds: float, estimate: WindEstimate, vehicle: VehicleState = FLYING) -> None:
    """Let an estimate see attitudes and velocities of a flight, 50 times a second."""

    def look() -> None:
        seen = bench.autopilot.estimate
        assert seen is not None
        east, north, up = (float(v) for v in seen.vel_enu_ms)
        w, x, y, z = (float(v) for v in seen.quat_wxyz)
        estimate.on_attitude((w, x, y, z))
        estimate.on_velocity(bench.now_ns, (north, east, -up), vehicle)

    bench.run(seconds, look, 0.02)


def known(estimate: WindEstimate, now_ns: int) -> Wind:
    wind = estimate.at(now_ns)
    assert wind is not None
    return wind


def off_deg(wind: Wind, from_deg: float) -> float:
    return abs(math.degrees(math.remainder(wind.from_rad - math.radians(from_deg), 2 * math.pi)))


def wind_message(from_deg: float, speed_ms: float) -> Any:
    return received(mavlink.MAVLink_wind_message(from_deg, speed_ms, 0.0))


# ---- tilt ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("wind_ms", "from_deg"), [(0.0, 0.0), (3.0, 40.0), (5.0, 250.0), (10.0, 130.0)])
def test_the_tilt_of_a_steady_hover_tells_the_wind_within_a_twentieth(
    wind_ms: float, from_deg: float
) -> None:
    bench = Bench(wind_ms=wind_ms, wind_from_deg=from_deg, gust_ms=0.0).airborne(UP_M)
    estimate = WindEstimate(DRAG_PER_S)
    watched(bench, 20, estimate)
    wind = known(estimate, bench.now_ns)
    aloft_ms = wind_ms * wind_profile(UP_M)
    assert wind.source == "tilt"
    assert wind.speed_ms == pytest.approx(aloft_ms, rel=0.05, abs=0.1)
    assert wind_ms == 0 or off_deg(wind, from_deg) < 3


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.bench) for seed in (2, 3))])
def test_with_gusts_and_errors_of_attitude_and_velocity_it_follows_the_true_wind(seed: int) -> None:
    """Further seeds on request, for their time."""
    bench = Bench(EstimateErrors(), wind_ms=8.0, wind_from_deg=300.0, seed=seed).airborne(UP_M)
    estimate, true = WindEstimate(DRAG_PER_S), WindAverage("tilt")
    blown = []
    for tenth in range(600):
        watched(bench, 0.1, estimate)
        blown.append(bench.vehicle.wind.now_enu_ms[:2])
        if tenth > 30:
            true.add(np.mean(blown[-30:], axis=0), bench.now_ns)
    wind, truth = known(estimate, bench.now_ns), true.at(bench.now_ns)
    assert truth is not None
    assert np.hypot(*(wind.towards_enu_ms - truth.towards_enu_ms)) < 0.5
    assert wind.gust_ms == wind.speed_ms  # the tilt tells none: it tilts in manoeuvres as well


def test_a_drag_that_is_off_makes_the_speed_off_by_the_same_share() -> None:
    bench = Bench(wind_ms=6.0, wind_from_deg=90.0, gust_ms=0.0).airborne(UP_M)
    estimate = WindEstimate(0.8 * DRAG_PER_S)
    watched(bench, 20, estimate)
    wind = known(estimate, bench.now_ns)
    assert wind.speed_ms == pytest.approx(6.0 * wind_profile(UP_M) / 0.8, rel=0.05)
    assert off_deg(wind, 90) < 3


def test_flight_through_still_air_is_no_wind_nor_are_turns_and_braking() -> None:
    bench = Bench(wind_ms=0.0).airborne(UP_M)
    estimate = WindEstimate(DRAG_PER_S)
    for east, north in ((5.0, 0.0), (0.0, 5.0), (-5.0, 0.0), (0.0, 0.0)):
        bench.velocity(east, north, 0.0)
        for _ in range(4):
            bench.velocity(east, north, 0.0)
            watched(bench, 1.5, estimate)
    wind = known(estimate, bench.now_ns)
    assert wind.speed_ms < 0.4
    assert wind.gust_ms < 1.0


def test_the_tilt_tells_nothing_on_the_ground_of_a_helicopter_or_without_a_drag() -> None:
    bench = Bench(wind_ms=6.0).airborne(UP_M)
    helicopter = replace(FLYING, vehicle_type=mavlink.MAV_TYPE_HELICOPTER)
    for vehicle, drag_per_s in ((ON_GROUND, 0.25), (helicopter, 0.25), (FLYING, 0.0)):
        estimate = WindEstimate(drag_per_s)
        watched(bench, 12, estimate, vehicle)
        assert estimate.at(bench.now_ns) is None


def test_after_the_landing_the_wind_of_the_flight_is_over() -> None:
    bench = Bench(wind_ms=6.0).airborne(UP_M)
    estimate = WindEstimate(DRAG_PER_S)
    watched(bench, 12, estimate)
    assert estimate.at(bench.now_ns) is not None
    watched(bench, 0.1, estimate, ON_GROUND)
    assert estimate.at(bench.now_ns) is None
    assert estimate.summary()["source"] == "tilt"


# ---- the autopilot's own -------------------------------------------------------------------------


def told(estimate: WindEstimate, seconds: int, from_deg: float, speed_ms: float, begin_s: int = 0) -> int:
    """Let the autopilot tell a wind twice a second; return the time of the last."""
    now_ns = begin_s * S
    for step in range(2 * seconds):
        now_ns = begin_s * S + step * S // 2
        estimate.on_message(wind_message(from_deg, speed_ms), FLYING, now_ns)
    return now_ns


def test_the_autopilots_wind_goes_before_that_of_the_tilt() -> None:
    bench = Bench(wind_ms=6.0, wind_from_deg=90.0, gust_ms=0.0).airborne(UP_M)
    estimate = WindEstimate(DRAG_PER_S)
    watched(bench, 12, estimate)
    assert known(estimate, bench.now_ns).source == "tilt"
    for back in range(12, -1, -1):
        estimate.on_message(wind_message(200.0, 4.0), FLYING, bench.now_ns - back * S // 2)
    wind = known(estimate, bench.now_ns)
    assert (wind.source, wind.speed_ms) == ("autopilot", pytest.approx(4.0))
    assert off_deg(wind, 200.0) < 0.1


def test_a_silent_autopilot_leaves_the_wind_unknown_after_five_seconds() -> None:
    estimate = WindEstimate(0.0)
    last_ns = told(estimate, 10, 30.0, 7.0)
    assert known(estimate, last_ns + 5 * S).speed_ms == pytest.approx(7.0)
    assert estimate.at(last_ns + 5 * S + 1) is None


def test_impossible_messages_are_counted_and_change_nothing() -> None:
    estimate = WindEstimate(0.0)
    last_ns = told(estimate, 10, 30.0, 7.0)
    before = estimate.at(last_ns)
    for direction, speed in ((math.nan, 5.0), (30.0, math.inf), (30.0, -2.0), (30.0, 200.0)):
        estimate.on_message(wind_message(direction, speed), FLYING, last_ns)
    assert estimate.at(last_ns) == before
    assert estimate.summary()["implausible"] == 4


def test_one_second_of_a_gust_counts_as_the_mean_of_three() -> None:
    estimate = WindEstimate(0.0)
    last_ns = told(estimate, 20, 0.0, 6.0)
    for half in (1, 2):
        estimate.on_message(wind_message(0.0, 12.0), FLYING, last_ns + half * S // 2)
    wind = known(estimate, last_ns + S)
    assert 7.0 < wind.gust_ms < 9.0


def test_a_reboot_forgets_the_wind() -> None:
    estimate = WindEstimate(DRAG_PER_S)
    last_ns = told(estimate, 10, 30.0, 7.0)
    estimate.clear()
    assert estimate.at(last_ns) is None


def test_a_flight_unwatched_for_a_second_and_a_velocity_of_no_number_do_no_harm() -> None:
    bench = Bench(wind_ms=4.0, wind_from_deg=0.0, gust_ms=0.0).airborne(UP_M)
    estimate = WindEstimate(DRAG_PER_S)
    watched(bench, 10, estimate)
    estimate.on_velocity(bench.now_ns, (math.nan, 0.0, 0.0), FLYING)
    bench.run(1.0)
    watched(bench, 8, estimate)
    assert known(estimate, bench.now_ns).speed_ms == pytest.approx(4.0 * wind_profile(UP_M), rel=0.06)
    assert np.isfinite(known(estimate, bench.now_ns).gust_ms)


# Force balance of a multirotor in wind, on attitudes and velocities in closed form.


MULTIROTOR_DRAG_PER_S = 0.2
MS = 1_000_000


def pitched(down_deg: float, yaw_deg: float = 0.0) -> tuple[float, float, float, float]:
    """Return the quaternion of a nose that points down by an angle, at a heading."""
    pitch, yaw = math.radians(-down_deg) / 2, math.radians(yaw_deg) / 2
    cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
    return cp * cy, -sp * sy, sp * cy, cp * sy


def flown(
    quat: tuple[float, float, float, float], velocity: tuple[float, float, float], rise_ms2: float = 0.0
) -> list[np.ndarray]:
    """Return the winds of six seconds at a constant attitude, at 20 Hz."""
    tilt, winds = TiltWind(MULTIROTOR_DRAG_PER_S), []
    for step in range(120):
        now = np.array([velocity[0], velocity[1], velocity[2] + rise_ms2 * step * 0.05])
        wind = tilt.add(step * 50 * MS, quat, now)
        if wind is not None:
            winds.append(wind)
    return winds


def test_a_hover_with_the_nose_down_is_in_a_wind_from_ahead() -> None:
    speed = GRAVITY_MS2 * math.tan(math.radians(7.0)) / MULTIROTOR_DRAG_PER_S
    for yaw_deg, towards in ((0.0, (0, -1)), (90.0, (-1, 0)), (180.0, (0, 1))):
        winds = flown(pitched(7.0, yaw_deg), (0.0, 0.0, 0.0))
        np.testing.assert_allclose(winds, [[speed * towards[0], speed * towards[1]]] * len(winds), atol=1e-9)


def test_a_level_vehicle_drifts_with_the_wind() -> None:
    np.testing.assert_allclose(flown(pitched(0.0), (3.0, -2.0, 0.5))[-1], [3.0, -2.0], atol=1e-9)


def test_a_climb_needs_more_thrust_so_the_same_tilt_is_more_wind() -> None:
    still, rising = (flown(pitched(5.0), (0, 0, 0), rise)[-1][1] for rise in (0.0, 1.0))
    mean_rise_ms = 4.5  # of the last three of six seconds
    assert rising / still == pytest.approx(
        1 + (1.0 + MULTIROTOR_DRAG_PER_S * mean_rise_ms) / GRAVITY_MS2, rel=0.01
    )


def test_nothing_is_known_before_three_seconds_in_fast_flight_and_at_large_angles() -> None:
    assert len(flown(pitched(3.0), (0.0, 0.0, 0.0))) == pytest.approx(30, abs=3)  # of six seconds, at 10 Hz
    assert flown(pitched(3.0), (9.0, 0.0, 0.0)) == []
    assert flown(pitched(50.0), (0.0, 0.0, 0.0)) == []


# Mean and gust of a wind.


def blown(*speeds_ms: float, east: float = -1.0, north: float = 0.0) -> WindAverage:
    """Return the average of one wind a second."""
    average = WindAverage("tilt")
    for second, speed in enumerate(speeds_ms):
        average.add(speed * np.array([east, north]), second * S)
    return average


def at_end(average: WindAverage, seconds: float) -> Wind:
    wind = average.at(round(seconds * S))
    assert wind is not None
    return wind


def test_a_steady_wind_is_its_mean_and_its_gust_and_comes_from_behind_its_motion() -> None:
    wind = at_end(blown(*[6.0] * 40), 39)
    assert (wind.speed_ms, wind.gust_ms) == pytest.approx((6.0, 6.0))
    assert math.degrees(wind.from_rad) == pytest.approx(90)
    np.testing.assert_allclose(wind.towards_enu_ms, [-6.0, 0.0], atol=1e-9)


def test_it_is_unknown_in_the_first_five_seconds_and_five_after_the_last() -> None:
    average = blown(*[6.0] * 6)
    assert blown(*[6.0] * 5).at(4 * S) is None
    assert average.at(5 * S) is not None
    assert average.at(10 * S) is not None
    assert average.at(10 * S + 1) is None


def test_all_of_a_short_time_counts_alike_and_thirty_seconds_of_a_long_one() -> None:
    assert at_end(blown(*[2.0] * 5, *[8.0] * 5), 9).speed_ms == pytest.approx(5.0, abs=0.7)
    long = at_end(blown(*[2.0] * 200, *[8.0] * 30), 229)
    assert long.speed_ms == pytest.approx(8.0 - 6.0 * math.exp(-1), abs=0.2)


def test_the_gust_is_the_greatest_of_the_last_minute() -> None:
    speeds = [5.0] * 20 + [11.0] + [5.0] * 100
    assert at_end(blown(*speeds[:70]), 69).gust_ms == 11.0
    assert at_end(blown(*speeds), 120).gust_ms == pytest.approx(5.0, abs=0.5)


def test_a_gap_or_a_clock_that_goes_back_begins_anew() -> None:
    for later in (100, 2):
        average = blown(*[9.0] * 20)
        for second in range(later, later + 8):
            average.add(np.array([0.0, -3.0]), second * S)
        assert at_end(average, later + 7).speed_ms == pytest.approx(3.0)
        assert at_end(average, later + 7).gust_ms == pytest.approx(3.0)
