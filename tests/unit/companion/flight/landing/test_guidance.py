"""Velocity guidance of a vehicle whose velocity follows late."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.landing.guidance import towards

STEP_S, SPEED_MS = 0.05, 4.0
LAG_S = 0.5  # of the velocity, as ArduCopter's


def track(offset_m: tuple[float, float], delay_s: float, seconds: float = 20.0) -> np.ndarray:
    """Return the offsets (n, 2) that are left to a vehicle with a lag, over a link with a delay each way."""
    left, velocity = np.array(offset_m), np.zeros(2)
    late = round(2 * delay_s / STEP_S)
    commands = deque([np.zeros(2)] * (late + 1), maxlen=late + 1)
    seen = []
    for _ in range(round(seconds / STEP_S)):
        commands.append(towards(left, SPEED_MS, velocity))
        velocity = velocity + (commands[0] - velocity) * STEP_S / LAG_S
        left = left - velocity * STEP_S
        seen.append(left)
    return np.array(seen)


@pytest.mark.parametrize(("delay_s", "over_m"), [(0.0, 0.02), (0.1, 0.05), (0.2, 0.5)])
@pytest.mark.parametrize("away_m", [1.0, 6.0, 40.0])
def test_the_point_is_reached_without_overshoot(away_m: float, delay_s: float, over_m: float) -> None:
    left = track((away_m, 0.0), delay_s)
    assert -left[:, 0].min() < over_m
    assert abs(left[-1, 0]) < 0.05


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(0.0, 6.3))
def test_the_way_turns_with_the_offset(east_m: float, north_m: float, turn_rad: float) -> None:
    turn = np.array([[math.cos(turn_rad), -math.sin(turn_rad)], [math.sin(turn_rad), math.cos(turn_rad)]])
    offset, velocity = np.array([east_m, north_m]), np.array([1.0, -2.0])
    turned = towards(turn @ offset, SPEED_MS, turn @ velocity)
    np.testing.assert_allclose(turned, turn @ towards(offset, SPEED_MS, velocity), atol=1e-9)


@given(st.floats(-50.0, 50.0), st.floats(-5.0, 5.0))
def test_the_speed_keeps_its_limit(away_m: float, velocity_ms: float) -> None:
    command = towards(np.array([away_m, 0.0]), SPEED_MS, np.array([velocity_ms, 0.0]))
    assert np.hypot(*command) <= SPEED_MS + 1e-9
