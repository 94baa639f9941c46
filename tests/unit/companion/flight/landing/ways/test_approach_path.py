"""Geometry and guidance of an approach path."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import params
from companion.flight.landing.ways.approach_path import ApproachPath, hover_height_m

PARAMETERS = params.load("helicopter")
STEP_S = 0.1


def path(bearing_deg: float = 90.0) -> ApproachPath:
    return ApproachPath(bearing_deg, slope_deg=math.degrees(math.atan(1 / 8)), hover_m=10.0, length_m=250.0)


def flown(at: ApproachPath, start_enu_m: np.ndarray, seconds: float) -> np.ndarray:
    """Return the positions (n, 3) of a vehicle that obeys the path's velocity."""
    position, velocity, track = start_enu_m.astype(float), np.zeros(3), []
    for _ in range(round(seconds / STEP_S)):
        velocity = at.velocity_enu_ms(position, velocity, np.zeros(3), PARAMETERS)
        position = position + velocity * STEP_S
        track.append(position.copy())
    return np.array(track)


def test_it_rises_one_metre_in_eight_from_the_hover() -> None:
    assert path().height_m(0.0) == 10.0
    assert path().height_m(80.0) == pytest.approx(20.0)


@pytest.mark.parametrize("bearing_deg", [0.0, 90.0, 215.0])
def test_from_its_beginning_the_vehicle_follows_it_to_the_hover(bearing_deg: float) -> None:
    one = path(bearing_deg)
    start = np.array([*(one.length_m * one.outward), one.height_m(one.length_m)])
    track = flown(one, start, 120.0)
    away = np.hypot(track[:, 0], track[:, 1])
    heights = np.array([one.height_m(a) for a in away])
    assert np.abs(track[:, 2] - heights).max() < 1.0
    np.testing.assert_allclose(track[-1], [0.0, 0.0, 10.0], atol=0.2)


@given(st.floats(30.0, 60.0), st.floats(0.0, 359.0))
def test_from_above_it_is_never_left_downwards(high_m: float, bearing_deg: float) -> None:
    one = path(bearing_deg)
    track = flown(one, np.array([*(one.length_m * one.outward), high_m + 15.0]), 60.0)
    below = [one.height_m(float(np.hypot(*at[:2]))) - at[2] for at in track]
    assert max(below) < 1.0


def test_the_wind_beside_it_is_corrected() -> None:
    one = path(90.0)
    track = flown(one, np.array([200.0, 15.0, one.height_m(200.0)]), 60.0)
    assert abs(track[-1, 1]) < 0.5
    assert one.aside_m(np.array([200.0, 15.0, 0.0]), np.zeros(3)) == pytest.approx(15.0)


def test_the_sink_rate_stays_within_its_limit() -> None:
    steep = ApproachPath(0.0, 60.0, 3.5, 20.0)
    parameters = params.load("quadcopter")
    for height in (38.0, 20.0, 8.0):
        away = (height - 3.5) / steep.rise
        position = np.array([0.0, away, height])
        velocity = steep.velocity_enu_ms(position, np.zeros(3), np.zeros(3), parameters)
        assert -parameters.descent_speed_ms - 1e-9 <= velocity[2] < 0


def test_it_ends_above_the_height_at_which_the_ground_is_not_judged() -> None:
    assert hover_height_m(PARAMETERS) == PARAMETERS.dust_height_m + 2
    low = params.load("quadcopter", ["final_height_m=2", "dust_height_m=1", "commit_height_m=1"])
    assert hover_height_m(low) == 2
