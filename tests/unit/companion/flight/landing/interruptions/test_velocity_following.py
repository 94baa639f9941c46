"""Departure from the velocities asked: vehicles that obey slowly or in gusts, and those that do not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from companion.flight.landing.interruptions.velocity_following import VelocityFollowing
from tests.unit.companion.flight.landing.flight import Flight

STEP_S = 0.05
Motion = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


class Watched:
    """A vehicle of some motion, asked a velocity at every time."""

    def __init__(self, asked: Callable[[float], list[float]], motion: Motion) -> None:
        self.following, self.velocity, self.time_s = VelocityFollowing(), np.zeros(3), 0.0
        self._asked, self._motion = asked, motion
        self._situation = Flight([]).situation()

    def breach_s(self, limit_s: float, **other: object) -> float | None:
        """Return the time until a departure is too large, None if it never is."""
        while self.time_s < limit_s:
            self.fly(self.time_s + STEP_S / 2, **other)
            if self.following.departs or self.following.sinks:
                return self.time_s - STEP_S
        return None

    def fly(self, until_s: float, **other: object) -> None:
        while self.time_s < until_s:
            asked = np.array(self._asked(self.time_s))
            self.velocity = self._motion(self.time_s, self.velocity, asked)
            s = replace(self._situation, now_ns=round(self.time_s * 1e9), asked_enu_ms=asked)
            self.following.update(replace(s, velocity_enu_ms=self.velocity, **other))  # type: ignore[arg-type]
            self.time_s += STEP_S


def accelerating(most_ms2: float, delay_s: float = 0.0, most_ms: float = np.inf) -> Motion:
    """A vehicle that reaches what is asked by an acceleration, after a delay, up to a speed."""
    asked_before: list[np.ndarray] = []

    def motion(_: float, velocity: np.ndarray, asked: np.ndarray) -> np.ndarray:
        asked_before.append(asked)
        late = asked_before[max(0, len(asked_before) - 1 - round(delay_s / STEP_S))]
        speed = float(np.linalg.norm(late))
        change = late * min(1.0, most_ms / max(speed, 1e-9)) - velocity
        for axes in (slice(0, 2), slice(2, 3)):
            change[axes] *= min(1.0, most_ms2 * STEP_S / max(float(np.linalg.norm(change[axes])), 1e-9))
        return velocity + change

    return motion


def corners(time_s: float) -> list[float]:
    """A square survey at 4 m/s, a turn each six seconds, and steps up and down."""
    east, north = [(4.0, 0.0), (0.0, 4.5), (-4.0, 0.0), (0.0, -4.0)][int(time_s / 6) % 4]
    return [east, north, [0.0, 2.0, 0.0, -1.5][int(time_s / 9) % 4]]


def ring(time_s: float) -> list[float]:
    """A look from aside, at 4 m/s around a point 13 m away."""
    return [4.0 * np.cos(0.3 * time_s), 4.0 * np.sin(0.3 * time_s), 0.0]


def test_a_vehicle_lags_behind_a_velocity_that_turns() -> None:
    assert Watched(ring, accelerating(2.5, delay_s=0.7)).breach_s(120) is None


@pytest.mark.parametrize(
    "motion",
    [
        accelerating(5.0),
        accelerating(2.5, delay_s=0.7),
        accelerating(1.0, delay_s=0.5),  # a heavy vehicle
        accelerating(2.5, delay_s=0.3, most_ms=2.0),  # its own limit of speed: half of what is asked
    ],
)
def test_a_vehicle_that_obeys_late_or_slowly_does_not_depart(motion: Motion) -> None:
    assert Watched(corners, motion).breach_s(300) is None


def test_gusts_and_a_swaying_estimate_leave_nothing() -> None:
    """0.8 m/s beside, 0.3 m/s in height, for two seconds each way."""

    def gusty(time_s: float, _velocity: np.ndarray, asked: np.ndarray) -> np.ndarray:
        wave = np.sin(2 * np.pi * time_s / 4.0)
        return asked + np.array([0.6 * wave, 0.6 * wave, 0.3 * wave])

    assert Watched(corners, gusty).breach_s(300) is None


@pytest.mark.parametrize(
    ("asked", "flown", "within_s"),
    [
        ([4.0, 0.0, 0.0], [0.0, 0.0, 0.0], 5.0),  # held at a fence; the reference needs a second and a third
        ([4.0, 0.0, 0.0], [9.6, 0.0, -0.16], 4.5),  # on the wing
        ([2.0, 0.0, 0.0], [-2.0, 0.0, 0.0], 4.5),  # by another's hand
        ([0.0, 0.0, 0.0], [0.0, 3.0, 0.0], 4.5),
        ([0.0, 0.0, 0.0], [0.0, 0.0, -0.5], 4.5),
        ([0.0, 0.0, 0.0], [0.0, 0.0, -0.16], 13.0),  # a minute passed without a word
        ([0.0, 0.0, -1.5], [0.0, 0.0, -2.5], 4.5),
        ([0.0, 0.0, 2.0], [0.0, 0.0, 0.0], 4.5),
        ([0.0, 0.0, -1.5], [0.0, 0.0, 0.5], 4.5),
    ],
)
def test_a_vehicle_that_does_not_obey_departs(
    asked: list[float], flown: list[float], within_s: float
) -> None:
    found_s = Watched(lambda _: asked, lambda *_: np.array(flown)).breach_s(60)
    assert found_s is not None
    assert 2.9 < found_s <= within_s


def test_a_departure_is_over_soon_after_the_vehicle_obeys() -> None:
    watched = Watched(
        lambda _: [0.0, 0.0, 0.0], lambda time_s, *_: np.array([0.0, 0.0, -2.0 * (time_s < 30)])
    )
    watched.fly(30)
    assert watched.following.sinks
    watched.fly(34.5)
    assert not watched.following.sinks


def test_a_jump_of_the_estimate_and_a_pause_of_the_steps_begin_anew() -> None:
    def sinking() -> Watched:
        return Watched(lambda _: [0.0, 0.0, 0.0], lambda *_: np.array([0.0, 0.0, -2.0]))

    assert 2 < (sinking().breach_s(10) or 0) < 5
    jumping, pausing = sinking(), sinking()
    for k in range(1, 6):
        assert jumping.breach_s(2.0 * k, epoch=k) is None
        assert pausing.breach_s(pausing.time_s + 2.0) is None
        pausing.time_s += 8.0


@pytest.mark.parametrize("other", [{"guided": False}, {"heard": False}, {"asked_enu_ms": None}])
def test_without_a_setpoint_that_arrives_nothing_departs(other: dict[str, object]) -> None:
    def asked(_: float) -> list[float]:
        return [0.0, 0.0, 0.0]

    watched = Watched(asked, lambda *_: np.array([5.0, 0.0, -2.0]))
    if "asked_enu_ms" in other:
        s = replace(Flight([]).situation(), velocity_enu_ms=np.array([5.0, 0.0, -2.0]), asked_enu_ms=None)
        for step in range(200):
            watched.following.update(replace(s, now_ns=step * 50_000_000))
        assert not watched.following.departs
        assert not watched.following.sinks
    else:
        assert watched.breach_s(10, **other) is None
