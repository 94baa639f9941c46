"""Offset of a sensor clock that follows this computer's: scripts of stamps and arrivals."""

from __future__ import annotations

import random

import pytest

from companion.flight.sensors.synchronised_clock import SynchronisedClock

MS, S = 1_000_000, 1_000_000_000
WALL_NS = 1_763_000_000 * S + 123_456_789  # time of day less the companion's clock
HOUR = 3600 * S


def feed(
    clock: SynchronisedClock,
    seconds: float,
    *,
    begin_ns: int = 100 * S,
    ahead_ns: int = 0,
    most_late_ns: int = 5 * MS,
    drift: float = 0.0,
) -> list[int]:
    """Send packets at random delays; return how far each was placed from its true time."""
    delays = random.Random(1)
    errors = []
    for true in range(begin_ns, begin_ns + round(seconds * S), 10 * MS):
        stamp = true + WALL_NS + ahead_ns + round(drift * (true - begin_ns))
        clock.observe(stamp, true + delays.randrange(200_000, most_late_ns))
        errors.append(stamp + clock.offset_ns(stamp) - true)
    return errors


@pytest.mark.parametrize("ahead_s", [0, 18, 37, -WALL_NS // S // 3600 * 3600])
def test_utc_gps_time_tai_and_the_hour_are_one(ahead_s: int) -> None:
    clock = SynchronisedClock(lambda: WALL_NS)
    assert feed(clock, 3, ahead_ns=ahead_s * S) == [0] * 300
    assert clock.keeps


def test_packets_that_all_come_late_are_placed_right() -> None:
    """By arrivals alone they would be placed late by what the quickest of them takes."""
    clock = SynchronisedClock(lambda: WALL_NS)
    feed(clock, 2)
    errors = feed(clock, 0.9, begin_ns=102 * S, most_late_ns=300 * MS)
    assert errors == [0] * 90


def test_a_known_delay_is_taken_off() -> None:
    assert set(feed(SynchronisedClock(lambda: WALL_NS, delay_ns=2 * MS), 1)) == {-2 * MS}


@pytest.mark.parametrize("ahead_ns", [300 * MS, -300 * MS, 500 * MS, 15 * MS, -20 * MS])
def test_a_free_running_clock_is_mapped_by_arrivals_and_told(
    ahead_ns: int, caplog: pytest.LogCaptureFixture
) -> None:
    clock = SynchronisedClock(lambda: WALL_NS)
    errors = feed(clock, 5, ahead_ns=ahead_ns)
    assert all(0 <= error < 5 * MS for error in errors[:200])
    assert max(errors[200:]) < MS
    assert not clock.keeps
    assert caplog.text.count("is not this computer's") == 1


def test_a_clock_that_loses_its_master_is_noticed_before_it_is_20_ms_off() -> None:
    clock = SynchronisedClock(lambda: WALL_NS)
    errors = feed(clock, 200, drift=100e-6)
    assert not clock.keeps
    assert max(map(abs, errors)) < 20 * MS


def test_a_clock_that_is_set_right_is_followed_again() -> None:
    clock = SynchronisedClock(lambda: WALL_NS)
    feed(clock, 2, ahead_ns=-400 * MS - 5 * S)
    assert not clock.keeps
    errors = feed(clock, 3, begin_ns=102 * S)
    assert clock.keeps
    assert clock.resets == 1
    assert errors[150:] == [0] * 150
