"""Automatic start: the height that counts is the one over ground, and each reason to wait is told once."""

import numpy as np
import pytest

from companion.flight.landing.situation import Phase, Severity
from tests.unit.companion.flight.landing.flight import Flight, zone


def waiting(text: str, flight: Flight) -> bool:
    """Return whether only this reason is told, once, and nothing begins."""
    flight.run(120)
    told = [text for text in flight.texts if text.endswith(": waiting")]
    return told == [f"SLZ: {text}: waiting"] and flight.executive.phase is Phase.IDLE


def test_too_low_over_ground_the_pilot_is_told_why_nothing_begins() -> None:
    flight = Flight([zone(1, 0, 0)], height=2.8)
    assert waiting("lower than 5 m over ground", flight)
    flight.position[2] = 6.0
    flight.fly_to(Phase.SURVEY)


@pytest.mark.parametrize("home_m", [17.0, -20.0])
def test_the_height_above_home_does_not_count(home_m: float) -> None:
    """Home on a hill or in a valley: 19 m over the ground it begins, at 3 m it does not."""
    flight = Flight([zone(1, 0, 0)], height=19.0)
    flight.having(home_m=home_m).fly_to(Phase.SURVEY)
    low = Flight([zone(1, 0, 0)], height=3.0).having(home_m=home_m)
    assert waiting("lower than 5 m over ground", low)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("fits", False, "autopilot's parameters"),
        ("gps_lost", True, "GPS lost"),
        ("estimate_lost", "position", "position lost"),
        ("blind", True, "no position"),
        ("landed_state_known", False, "landed state unknown"),
        ("lidar_ok", False, "LiDAR lost"),
        ("sees_ground", False, "no ground seen"),
        ("flown", np.array([0.0, 0.0, -0.35]), "not level"),
    ],
)
def test_each_reason_to_wait_is_told_once(name: str, value: object, reason: str) -> None:
    flight = Flight([zone(1, 0, 0)], height=60.0)
    setattr(flight, name, value)
    assert waiting(reason, flight)
    assert flight.severities[flight.texts.index(f"SLZ: {reason}: waiting")] is Severity.WARNING


@pytest.mark.parametrize(("height_m", "reason"), [(12.0, "not level"), (1.0, "lower than 5 m over ground")])
def test_a_climb_is_no_reason_to_warn(height_m: float, reason: str) -> None:
    """It ends by itself; what the pilot would have to mend is a warning in the climb, too."""
    flight = Flight([zone(1, 0, 0)], height=height_m)
    flight.having(flown=np.array([0.0, 0.0, 0.4])).run(8)
    assert list(zip(flight.texts, flight.severities, strict=True)) == [
        (f"SLZ: {reason}: waiting", Severity.INFO)
    ]
    flight.having(lidar_ok=False).run(6)
    assert (flight.texts[-1], flight.severities[-1]) == ("SLZ: LiDAR lost: waiting", Severity.WARNING)


def test_what_lasts_after_the_climb_is_a_warning() -> None:
    flight = Flight([zone(1, 0, 0)], height=1.0)
    flight.having(flown=np.array([0.0, 0.0, 0.31])).run(6)
    flight.having(flown=np.zeros(3)).run(6)
    assert flight.texts == ["SLZ: lower than 5 m over ground: waiting"] * 2
    assert flight.severities == [Severity.INFO, Severity.WARNING]


def test_nothing_is_told_to_who_does_not_hand_over() -> None:
    flight = Flight([zone(1, 0, 0)], height=2.0)
    assert flight.having(mode="LOITER").run(30).texts == []


def test_a_reason_of_a_moment_is_not_told_and_is_told_again_after_the_next_hand_over() -> None:
    flight = Flight([zone(1, 0, 0)], height=2.0)
    assert flight.run(4).texts == []
    flight.run(10)
    flight.having(mode="LOITER").run(1)
    flight.having(mode="GUIDED").run(10)
    assert flight.texts == ["SLZ: lower than 5 m over ground: waiting"] * 2


def test_what_is_waited_for_is_known_as_long_as_it_is() -> None:
    """So that a text which the link swallowed is said again while it is true."""
    flight = Flight([zone(1, 0, 0)], height=3.0)
    assert flight.run(8).commands[-1][3].lasting == "SLZ: lower than 5 m over ground: waiting"
    flight.position[2] = 8.0
    assert flight.fly_to(Phase.APPROACH).commands[-1][3].lasting == ""
    assert flight.having(lidar_ok=False).run(1).commands[-1][3].lasting == "SLZ: LiDAR lost: holding"
    assert flight.having(lidar_ok=True).run(0.3).commands[-1][3].lasting == ""
