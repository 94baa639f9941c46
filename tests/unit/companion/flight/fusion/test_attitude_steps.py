"""Attitudes that come too seldom for the turns of the vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from companion.flight.fusion.attitude_steps import AttitudeSteps

S = 1_000_000_000


def roll_rad(t: np.ndarray) -> np.ndarray:
    """Return a roll of 35 degrees within 0.12 s at the second second, and back at the third."""
    return np.radians(35) * (np.clip((t - 2) / 0.12, 0, 1) - np.clip((t - 3) / 0.12, 0, 1))


def flown(hz: float, roll: object = roll_rad) -> tuple[AttitudeSteps, float]:
    """Return the steps, and the true greatest error (degrees) of attitudes between them."""
    steps, at = AttitudeSteps(), np.arange(0, 5, 1 / hz)

    def attitudes(t: np.ndarray) -> Rotation:
        return Rotation.from_euler("ZX", np.column_stack([0.5 * t, roll(t)]))  # type: ignore[operator]

    for t, (x, y, z, w) in zip(at, attitudes(at).as_quat(), strict=True):
        steps.add(round(t * S), np.array([w, x, y, z]), S // 2)
    fine = np.arange(0, at[-1], 0.001)
    errors = (attitudes(fine).inv() * Slerp(at, attitudes(at))(fine)).magnitude()
    return steps, float(np.degrees(errors.max()))


@pytest.mark.parametrize(("hz", "coarse"), [(50, False), (25, False), (10, True), (4, True)])
def test_attitudes_too_slow_for_a_turn_are_counted(hz: float, coarse: bool) -> None:
    steps, error_deg = flown(hz)
    assert (steps.coarse > 0) is coarse
    assert steps.worst_deg > error_deg / 6


@pytest.mark.parametrize("hz", [50, 4])
def test_a_steady_turn_needs_no_more_attitudes(hz: float) -> None:
    steps, _ = flown(hz, lambda t: 0 * t)
    assert steps.worst_deg < 0.01


def test_nothing_is_said_of_a_gap() -> None:
    steps = AttitudeSteps()
    for at_s, half in ((0, 0.0), (1, 0.4), (2, 0.0), (3, 0.4)):
        steps.add(at_s * S, np.array([np.cos(half), np.sin(half), 0, 0]), S // 2)
    assert steps.coarse == 0


def test_an_attitude_that_is_reset_at_once_is_no_turn() -> None:
    steps = AttitudeSteps()
    for k in range(100):
        half = 0.3 * (k >= 50)
        assert not steps.add(k * S // 25, np.array([np.cos(half), 0, 0, np.sin(half)]), S // 2)
    assert steps.coarse == 0


def test_attitudes_at_uneven_times_follow_a_steady_turn() -> None:
    """A radio passes some of them on: the turns between them differ, their rate does not."""
    steps = AttitudeSteps()
    for at_s in (0, 0.05, 0.45, 0.5, 0.98, 1.0):
        assert not steps.add(round(at_s * S), np.array([np.cos(at_s), 0, 0, np.sin(at_s)]), S // 2)
    assert steps.worst_deg < 1e-6


def test_a_turn_that_two_attitudes_halve_is_steady_in_neither_interval() -> None:
    """A roll of 35 degrees within 0.12 s, with one attitude in its middle: both intervals turn alike."""
    steps, coarse = AttitudeSteps(), []
    for at_s in np.arange(0, 5, 0.25):
        half = np.radians(17.5) * np.clip((at_s - 1.94) / 0.12, 0, 1)
        if steps.add(round(at_s * S), np.array([np.cos(half), np.sin(half), 0, 0]), S // 2):
            coarse.append(float(at_s))
    assert coarse == [2.0, 2.25, 2.5, 2.75]
