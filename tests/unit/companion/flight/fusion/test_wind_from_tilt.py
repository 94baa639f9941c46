"""Force balance of a multirotor in wind, on attitudes and velocities in closed form."""

import math

import numpy as np
import pytest

from companion.flight.fusion.wind_from_tilt import GRAVITY_MS2, TiltWind

DRAG_PER_S = 0.2
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
    tilt, winds = TiltWind(DRAG_PER_S), []
    for step in range(120):
        now = np.array([velocity[0], velocity[1], velocity[2] + rise_ms2 * step * 0.05])
        wind = tilt.add(step * 50 * MS, quat, now)
        if wind is not None:
            winds.append(wind)
    return winds


def test_a_hover_with_the_nose_down_is_in_a_wind_from_ahead() -> None:
    speed = GRAVITY_MS2 * math.tan(math.radians(7.0)) / DRAG_PER_S
    for yaw_deg, towards in ((0.0, (0, -1)), (90.0, (-1, 0)), (180.0, (0, 1))):
        winds = flown(pitched(7.0, yaw_deg), (0.0, 0.0, 0.0))
        np.testing.assert_allclose(winds, [[speed * towards[0], speed * towards[1]]] * len(winds), atol=1e-9)


def test_a_level_vehicle_drifts_with_the_wind() -> None:
    np.testing.assert_allclose(flown(pitched(0.0), (3.0, -2.0, 0.5))[-1], [3.0, -2.0], atol=1e-9)


def test_a_climb_needs_more_thrust_so_the_same_tilt_is_more_wind() -> None:
    still, rising = (flown(pitched(5.0), (0, 0, 0), rise)[-1][1] for rise in (0.0, 1.0))
    mean_rise_ms = 4.5  # of the last three of six seconds
    assert rising / still == pytest.approx(1 + (1.0 + DRAG_PER_S * mean_rise_ms) / GRAVITY_MS2, rel=0.01)


def test_nothing_is_known_before_three_seconds_in_fast_flight_and_at_large_angles() -> None:
    assert len(flown(pitched(3.0), (0.0, 0.0, 0.0))) == pytest.approx(30, abs=3)  # of six seconds, at 10 Hz
    assert flown(pitched(3.0), (9.0, 0.0, 0.0)) == []
    assert flown(pitched(50.0), (0.0, 0.0, 0.0)) == []
