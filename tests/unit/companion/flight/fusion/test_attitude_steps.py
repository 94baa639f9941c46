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
