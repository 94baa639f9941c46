"""The true multirotor: gravity, thrust, attitude, wind, and the ground under it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.autopilot.cascade_control import attitude_for
from sitl.vehicle.multirotor import DRAG_PER_S, GRAVITY_MS2, Vehicle
from sitl.vehicle.rigid_body import rotate, to_euler

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
