"""The true multirotor: gravity, thrust, attitude, wind, and the ground under it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.autopilot.cascade_control import attitude_for
from sitl.vehicle.ground_effect import ROTOR_OVER_FEET_M, ROTOR_RADIUS_M, ground_effect
from sitl.vehicle.multirotor import DRAG_PER_S, GRAVITY_MS2, Vehicle
from sitl.vehicle.pose_track import PoseTrack
from sitl.vehicle.rigid_body import rotate, to_euler
from sitl.vehicle.wind_field import GUST_TAU_S, WindField, wind_profile

DT_S = 0.0025
STILL = np.zeros(3)


def vehicle(up_m: float = 0.0, heading_rad: float = 0.0, wind_ms: float = 0.0, seed: int = 1) -> Vehicle:
    return Vehicle(np.random.default_rng(seed), (0.0, 0.0, up_m), heading_rad, wind_ms)


def fly(
    body: Vehicle, seconds: float, thrust_ms2: float, rates: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Vehicle:
    for tick in range(round(seconds / DT_S)):
        body.update(DT_S, round(tick * DT_S * 1e9), (np.array(rates), thrust_ms2), 0.0)
    return body


def test_it_stands_still_until_the_thrust_exceeds_its_weight() -> None:
    body = fly(vehicle(), 2.0, GRAVITY_MS2 - 0.5)
    np.testing.assert_array_equal(body.truth.pos_enu_m, STILL)
    assert body.on_ground
    fly(body, 2.0, GRAVITY_MS2 + 0.5)
    assert body.truth.pos_enu_m[2] > 0.5
    assert not body.on_ground


def test_it_falls_as_gravity_and_linear_drag_say() -> None:
    seconds = 2.0
    body = fly(vehicle(100.0), seconds, 0.0)
    terminal = GRAVITY_MS2 / DRAG_PER_S
    assert body.truth.vel_enu_ms[2] == pytest.approx(
        -terminal * (1 - math.exp(-DRAG_PER_S * seconds)), rel=2e-3
    )
    np.testing.assert_array_equal(body.truth.vel_enu_ms[:2], 0.0)


@pytest.mark.parametrize(
    ("rates", "heading_rad", "towards"),
    [
        ((0.0, -0.2, 0.0), 0.0, (0.0, 1.0)),  # nose down, facing north: north
        ((0.0, -0.2, 0.0), math.pi / 2, (1.0, 0.0)),  # nose down, facing east: east
        ((0.2, 0.0, 0.0), 0.0, (1.0, 0.0)),  # right side down, facing north: east
        ((0.2, 0.0, 0.0), math.pi / 2, (0.0, -1.0)),  # right side down, facing east: south
    ],
)
def test_it_goes_where_its_thrust_leans(
    rates: tuple[float, float, float], heading_rad: float, towards: tuple[float, float]
) -> None:
    body = fly(vehicle(50.0, heading_rad), 1.0, GRAVITY_MS2, rates)
    velocity = body.truth.vel_enu_ms[:2]
    assert float(np.hypot(*velocity)) > 0.3
    np.testing.assert_allclose(velocity / np.hypot(*velocity), towards, atol=1e-6)


def test_a_positive_yaw_rate_turns_clockwise_seen_from_above() -> None:
    body = fly(vehicle(50.0, 0.5), 1.0, GRAVITY_MS2, (0.0, 0.0, 0.4))
    assert to_euler(body.truth.quat_wxyz)[2] == pytest.approx(0.5 + 0.4 * (1.0 - 0.05), abs=0.01)


def test_wind_carries_a_level_vehicle_towards_its_own_speed() -> None:
    body = fly(vehicle(500.0, wind_ms=4.0), 60.0, GRAVITY_MS2)
    assert 2.0 < float(np.hypot(*body.truth.vel_enu_ms[:2])) < 6.0


def test_touchdown_is_recorded_with_place_and_speeds() -> None:
    before = fly(vehicle(1.0), 0.2, GRAVITY_MS2)
    assert before.contact is None
    body = fly(vehicle(1.0), 2.2, GRAVITY_MS2 - 2.0)
    assert body.on_ground
    assert body.contact is not None
    assert body.contact["u"] == 0.0
    assert 1.0 < body.contact["sink_ms"] < 2.0
    assert body.contact["drift_ms"] == pytest.approx(0.0, abs=1e-9)
    assert body.contact["tilt_deg"] == pytest.approx(0.0, abs=1e-6)
    assert body.contact["heading_deg"] == pytest.approx(0.0, abs=1e-6)


def test_the_attitude_stays_a_unit_quaternion() -> None:
    body = fly(vehicle(500.0), 5.0, GRAVITY_MS2, (1.5, -2.0, 0.7))
    assert float(np.linalg.norm(body.truth.quat_wxyz)) == pytest.approx(1.0, abs=1e-12)


def test_the_same_seed_blows_the_same_wind_and_another_does_not() -> None:
    flights = [fly(vehicle(500.0, wind_ms=5.0, seed=s), 3.0, GRAVITY_MS2).truth.pos_enu_m for s in (4, 4, 5)]
    np.testing.assert_array_equal(flights[0], flights[1])
    assert not np.array_equal(flights[0], flights[2])


@given(
    side=st.tuples(st.floats(-4, 4), st.floats(-4, 4)),
    up=st.floats(-3, 3),
    yaw_rad=st.floats(-math.pi, math.pi),
)
def test_the_attitude_wanted_gives_the_acceleration_wanted(
    side: tuple[float, float], up: float, yaw_rad: float
) -> None:
    wanted = np.array([*side, up])
    quat, thrust = attitude_for(wanted, yaw_rad)
    push_ned = rotate(quat, np.array([0.0, 0.0, -thrust]))
    got = np.array([push_ned[1], push_ned[0], -push_ned[2] - GRAVITY_MS2])
    assert got[2] == pytest.approx(up, abs=1e-9)
    length = float(np.hypot(*side))
    limit = (GRAVITY_MS2 + up) * math.tan(math.radians(28.0))
    np.testing.assert_allclose(got[:2], wanted[:2] * (min(1.0, limit / length) if length else 1.0), atol=1e-9)
    # The heading is projected on the tilted plane: at full tilt the nose is off by up to 7.12 degrees.
    nose = rotate(quat, np.array([1.0, 0.0, 0.0]))
    off = math.remainder(math.atan2(nose[1], nose[0]) - yaw_rad, 2 * math.pi)
    assert abs(off) < math.radians(8.0)


def test_a_slope_flown_into_is_a_collision() -> None:
    body = fly(vehicle(5.0), 1.0, GRAVITY_MS2 + 0.4, (0.3, 0.0, 0.0))  # leans to the east
    for tick in range(1200):
        hill = max(0.0, 1.5 * (float(body.truth.pos_enu_m[0]) - 2.0))
        body.update(DT_S, tick, (STILL, GRAVITY_MS2 + 0.2), hill)
    assert body.collision is not None
    assert body.contact is None
    assert body.truth.pos_enu_m[2] < 6.0


def test_a_fall_is_no_touchdown() -> None:
    body = fly(vehicle(10.0), 3.0, 0.0)
    assert body.on_ground
    assert body.contact is None
    assert body.collision is not None
    assert body.collision["speed_ms"] > 10.0


def test_a_new_flight_forgets_the_last_touchdown() -> None:
    body = fly(vehicle(1.0), 2.2, GRAVITY_MS2 - 2.0)
    first = body.contact
    assert first is not None
    fly(body, 2.5, GRAVITY_MS2 + 1.0)
    assert body.truth.pos_enu_m[2] > 2.0
    assert body.contact is None


# Ground effect of the simulated rotors.


def test_thrust_one_radius_over_the_ground_rises_by_a_fifteenth() -> None:
    assert ground_effect(ROTOR_RADIUS_M - ROTOR_OVER_FEET_M) == pytest.approx(16 / 15)


def test_the_effect_fades_with_height_and_is_bounded_below() -> None:
    heights = (-5.0, -0.2, 0.0, 0.5, 1.0, 5.0, 1e6)
    factors = [ground_effect(height) for height in heights]
    assert factors == sorted(factors, reverse=True)
    assert factors[0] < 1.34
    assert factors[4] < 1.002
    assert factors[-1] == pytest.approx(1.0)


def test_a_vehicle_near_the_ground_is_accelerated_upwards_by_the_additional_thrust() -> None:
    near, far = (Vehicle(np.random.default_rng(1), (0.0, 0.0, up), 0.0, 0.0) for up in (0.4, 50.0))
    for body in (near, far):
        for tick in range(160):  # until the motors have their speed
            body.update(DT_S, tick * 2_500_000, (np.zeros(3), GRAVITY_MS2), 0.0)
    additional = near.truth.acc_enu_ms2[2] - far.truth.acc_enu_ms2[2]
    share = ground_effect(near.truth.pos_enu_m[2]) - 1
    assert share > 0.005
    assert additional == pytest.approx(GRAVITY_MS2 * share, rel=0.15)


# Poses between ticks against NumPy's interpolation.


def test_poses_between_ticks_are_interpolated_and_kept_beyond_the_ends() -> None:
    rng, track = np.random.default_rng(3), PoseTrack()
    stamps = 5_000_000_000 + np.cumsum(rng.integers(1, 4_000_000, 6))
    quats = rng.normal(1.0, 0.1, (6, 4))
    quats /= np.linalg.norm(quats, axis=1)[:, np.newaxis]
    positions = rng.normal(0.0, 9.0, (6, 3))
    for k, stamp in enumerate(stamps.tolist()):
        track.add(stamp, positions[k], quats[k] if k % 2 else -quats[k])  # the same attitude
    when = np.sort(np.concatenate([stamps, rng.integers(stamps[0] - 99, stamps[-1] + 99, 300)]))
    position, quat = track.at(when)
    for found, true in ((position, positions), (quat, -quats)):
        lines = np.column_stack([np.interp(when, stamps, true[:, i]) for i in range(true.shape[1])])
        if found is quat:
            lines /= np.linalg.norm(lines, axis=1)[:, np.newaxis]
        np.testing.assert_allclose(found, lines, rtol=0, atol=1e-12)


# True wind: direction, profile over height, and gusts.


STEP_S = 0.05


def field(seed: int = 1, **how: float) -> WindField:
    return WindField(np.random.default_rng(seed), **how)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("from_deg", "towards"), [(0.0, (0, -1)), (90.0, (-1, 0)), (180.0, (0, 1)), (270.0, (1, 0))]
)
def test_it_blows_away_from_where_it_comes(from_deg: float, towards: tuple[float, float]) -> None:
    mean = field(mean_ms=5.0, from_deg=from_deg).mean_enu_ms
    np.testing.assert_allclose(mean, [5.0 * towards[0], 5.0 * towards[1], 0.0], atol=1e-9)


def test_the_stated_mean_is_that_ten_metres_over_the_ground() -> None:
    calm = field(mean_ms=8.0, from_deg=270.0, gust_ms=0.0)
    assert calm.advance(STEP_S, 10.0)[0] == pytest.approx(8.0)
    assert (
        calm.advance(STEP_S, 2.0)[0] == pytest.approx(8.0 * wind_profile(2.0)) == pytest.approx(5.8, abs=0.01)
    )


def test_wind_is_less_near_the_ground_and_none_on_it() -> None:
    shares = [wind_profile(height) for height in (-1.0, 0.0, 0.5, 2.0, 10.0, 30.0, 100.0, 500.0)]
    assert shares[:2] == [0.0, 0.0]
    assert shares == sorted(shares)
    assert shares[3] == pytest.approx(math.log(1 + 2 / 0.03) / math.log(1 + 10 / 0.03))
    assert shares[5] == pytest.approx(1.19, abs=0.01)
    assert shares[6] == shares[7]


def test_gusts_have_the_stated_deviation_and_a_third_of_the_mean_by_default() -> None:
    for how, deviation in (({"gust_ms": 2.0}, 2.0), ({}, 3.0)):
        blowing = field(mean_ms=9.0, from_deg=0.0, **how)
        seen = np.array([blowing.advance(STEP_S, 10.0) for _ in range(round(2000 * GUST_TAU_S / STEP_S))])
        assert np.std(seen[:, :2], axis=0) == pytest.approx([deviation] * 2, rel=0.1)
        assert np.std(seen[:, 2]) == pytest.approx(0.3 * deviation, rel=0.1)


def test_a_given_direction_leaves_the_gusts_of_a_seed_as_they_are() -> None:
    drawn, given = field(mean_ms=6.0), field(mean_ms=6.0, from_deg=120.0)
    gusts = [f.advance(STEP_S, 10.0) - f.mean_enu_ms for f in (drawn, given)]
    np.testing.assert_allclose(gusts[0], gusts[1])
