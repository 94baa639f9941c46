"""Stop before obstacles in the vehicle's way."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.landing.guidance import BRAKING_MS2
from companion.flight.landing.look_ahead import ASIDE_M, LEVEL_M, MARGIN_M, limit_velocity


def wall(distance_m: float, bearing_rad: float = 0.0) -> np.ndarray:
    """Returns of a wall 10 m wide and 10 m high, `bearing_rad` to the right of forward."""
    side, up = np.meshgrid(np.linspace(-5, 5, 21), np.linspace(-5, 5, 21))
    c, s = math.cos(bearing_rad), math.sin(bearing_rad)
    return np.column_stack(
        [(distance_m * c - side * s).ravel(), (distance_m * s + side * c).ravel(), up.ravel()]
    )


@pytest.mark.parametrize("bearing_rad", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("distance_m", [30.0, 8.0, 4.0])
def test_the_speed_left_stops_before_the_wall(distance_m: float, bearing_rad: float) -> None:
    way = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    wanted = np.array([*(9.0 * way), 0.0])
    velocity = limit_velocity(wanted, wall(distance_m, bearing_rad), 0.6).velocity_frd_ms
    speed = float(np.hypot(*velocity[:2]))
    assert speed**2 / (2 * BRAKING_MS2) <= distance_m - MARGIN_M + 1e-9
    assert speed == pytest.approx(min(9.0, math.sqrt(2 * BRAKING_MS2 * (distance_m - MARGIN_M))))
    np.testing.assert_allclose(velocity[:2], speed * way)


def test_flown_at_a_wall_it_stops_before_it_and_says_so() -> None:
    at, blocked = np.zeros(3), False
    for _ in range(400):
        limited = limit_velocity(np.array([4.0, 0.0, 0.0]), wall(40.0) - at, 0.6)
        blocked = limited.blocked
        at = at + limited.velocity_frd_ms * 0.05
    assert at[0] == pytest.approx(40 - MARGIN_M, abs=0.3)
    assert blocked


@pytest.mark.parametrize(
    "offset",
    [(0, ASIDE_M + 0.1, 0), (0, 0, LEVEL_M + 0.1), (0, 0, -LEVEL_M - 0.1), (-20, 0, 0), (-9.6, 0, 0)],
)
def test_what_is_beside_above_behind_or_the_vehicle_itself_holds_nothing_back(
    offset: tuple[float, float, float],
) -> None:
    post = np.full((20, 3), [10.0, 0.0, 0.0]) + offset
    limited = limit_velocity(np.array([4.0, 0.0, 0.0]), post, 0.6)
    np.testing.assert_array_equal(limited.velocity_frd_ms, [4.0, 0.0, 0.0])
    assert not limited.blocked


def test_a_few_specks_of_dust_hold_nothing_back() -> None:
    limited = limit_velocity(np.array([4.0, 0.0, 0.0]), np.full((2, 3), [4.0, 0.0, 0.0]), 0.6)
    assert limited.velocity_frd_ms[0] == 4.0


def test_it_climbs_into_nothing_and_sinks_as_told() -> None:
    roof = np.full((20, 3), [0.2, 0.3, -4.0])
    climbing, sinking = np.array([0.0, 0.0, -3.0]), np.array([0.0, 0.0, 2.0])
    assert limit_velocity(climbing, roof, 0.6).velocity_frd_ms[2] >= -math.sqrt(2 * BRAKING_MS2)
    assert limit_velocity(sinking, -roof, 0.6).velocity_frd_ms[2] == 2.0


def test_what_is_close_above_stops_a_climb_and_says_so() -> None:
    roof = np.full((20, 3), [0.2, 0.3, -MARGIN_M])
    limited = limit_velocity(np.array([0.0, 0.0, -3.0]), roof, 0.6)
    assert limited.velocity_frd_ms[2] == 0.0
    assert limited.blocked_above
    assert not limited.blocked
    assert not limit_velocity(np.array([0.0, 0.0, 3.0]), roof, 0.6).blocked_above


def test_a_wider_vehicle_stops_before_what_a_narrow_one_passes() -> None:
    post = np.full((20, 3), [6.0, ASIDE_M + 1.0, 0.0])
    ahead = np.array([4.0, 0.0, 0.0])
    assert limit_velocity(ahead, post, 0.6).velocity_frd_ms[0] == 4.0
    assert limit_velocity(ahead, post, 0.6, aside_m=3.0).velocity_frd_ms[0] < 3.0


def test_nothing_around_leaves_the_velocity() -> None:
    limited = limit_velocity(np.array([4.0, -2.0, 1.0]), np.zeros((0, 3)), 0.6)
    np.testing.assert_allclose(limited.velocity_frd_ms, [4.0, -2.0, 1.0])
    assert not limited.blocked


@given(st.integers(0, 2**32 - 1))
def test_more_returns_never_make_it_faster(seed: int) -> None:
    rng = np.random.default_rng(seed)
    around = rng.uniform(-12, 12, (60, 3))
    wanted = rng.uniform(-6, 6, 3)
    fewer = limit_velocity(wanted, around[:30], 0.6).velocity_frd_ms
    more = limit_velocity(wanted, around, 0.6).velocity_frd_ms
    assert np.hypot(*more[:2]) <= np.hypot(*fewer[:2]) + 1e-12
    assert more[2] >= fewer[2] - 1e-12
