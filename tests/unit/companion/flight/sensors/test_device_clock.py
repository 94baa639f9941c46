"""Clock offset of a sensor: scripts of stamps and arrivals; nothing waits."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.sensors.device_clock import SensorClock

MS, S = 1_000_000, 1_000_000_000
PERIOD = 10 * MS


def feed(
    clock: SensorClock,
    seconds: float,
    *,
    arrival_ns: int = 100 * S,
    stamp_ns: int = 3 * S,
    drift: float = 0.0,
    seed: int = 1,
    most_late_ns: int = 5 * MS,
) -> tuple[int, int, int]:
    """Send packets at random delays; return the last stamp, its true time, and its arrival."""
    delays = random.Random(seed)
    stamp, true = stamp_ns, arrival_ns
    for i in range(round(seconds * S / PERIOD)):
        true = arrival_ns + i * PERIOD
        stamp = stamp_ns + round(i * PERIOD * (1 + drift))
        late = delays.randrange(200_000, most_late_ns) if most_late_ns else 0
        clock.observe(stamp, true + late)
    return stamp, true, true + late


def test_the_quickest_arrivals_tell_the_offset() -> None:
    clock = SensorClock()
    stamp, true, _ = feed(clock, 3)
    assert stamp + clock.offset_ns(stamp) == pytest.approx(true, abs=300_000)


@pytest.mark.parametrize("drift", [-100e-6, -20e-6, 20e-6, 100e-6])
def test_the_offset_follows_the_drift(drift: float) -> None:
    clock = SensorClock()
    stamp, true, _ = feed(clock, 60, drift=drift)
    assert stamp + clock.offset_ns(stamp) == pytest.approx(true, abs=600_000)
    assert clock.resets == 0


@pytest.mark.parametrize("silent_s", [4.0, 5.0, 9.0, 9.4, 9.6, 9.9, 30.0])
def test_after_a_silence_the_offset_is_what_it_was(silent_s: float) -> None:
    clock = SensorClock()
    stamp, true, _ = feed(clock, 1.2, drift=20e-6)
    silent = round(silent_s * S)
    stamp, true, _ = feed(clock, 20, stamp_ns=stamp + silent, arrival_ns=true + silent, drift=20e-6, seed=2)
    assert stamp + clock.offset_ns(stamp) == pytest.approx(true, abs=1 * MS)
    assert clock.resets == 0


def test_a_known_delay_is_taken_off() -> None:
    plain, delayed = SensorClock(), SensorClock(delay_ns=30 * MS)
    stamp, _, _ = feed(plain, 2)
    feed(delayed, 2)
    assert plain.offset_ns(stamp) - delayed.offset_ns(stamp) == 30 * MS


def test_a_synchronised_clock_is_only_an_offset() -> None:
    clock = SensorClock()
    epoch = 1_790_000_000 * S
    stamp, true, _ = feed(clock, 12, stamp_ns=epoch, most_late_ns=0)
    assert stamp + clock.offset_ns(stamp) == true


@pytest.mark.parametrize("new_stamp_s", [0.2, 40_000.0])
def test_a_sensor_that_starts_anew_or_is_synchronised_resets(new_stamp_s: float) -> None:
    clock = SensorClock()
    _, _, arrival = feed(clock, 12)
    stamp, true, _ = feed(clock, 1, arrival_ns=arrival + S // 20, stamp_ns=round(new_stamp_s * S))
    assert clock.resets == 1
    assert stamp + clock.offset_ns(stamp) == pytest.approx(true, abs=400_000)


def test_a_sensor_off_for_long_is_not_mistaken_for_late_packets() -> None:
    """Its new stamps may lie a little ahead of the last one, far behind the time that passed."""
    clock = SensorClock()
    last, _, arrival = feed(clock, 5)
    stamp, true, _ = feed(clock, 1, arrival_ns=arrival + 30 * S, stamp_ns=last + 7 * S)
    assert clock.resets == 1
    assert stamp + clock.offset_ns(stamp) == pytest.approx(true, abs=400_000)


def test_packets_held_up_for_seconds_keep_their_time() -> None:
    clock = SensorClock()
    last, true, _ = feed(clock, 5)
    held_until = true + 3 * S
    for i in range(1, 300):
        clock.observe(last + i * PERIOD, max(held_until, true + i * PERIOD))
        stamp = last + i * PERIOD
        assert stamp + clock.offset_ns(stamp) == pytest.approx(true + i * PERIOD, abs=600_000)
    assert clock.resets == 0


def test_overtaken_packets_do_not_reset() -> None:
    clock = SensorClock()
    last, _, arrival = feed(clock, 2)
    clock.observe(last - 2 * MS, arrival + MS)
    assert clock.resets == 0


def test_without_a_packet_there_is_no_offset() -> None:
    with pytest.raises(ValueError, match="no packet"):
        SensorClock().offset_ns(0)


@given(
    steps=st.lists(
        st.tuples(st.integers(-(10**10), 10**10), st.integers(0, 3 * 10**9)), min_size=1, max_size=60
    )
)
def test_no_stamp_maps_to_a_time_after_its_arrival(steps: list[tuple[int, int]]) -> None:
    clock, stamp, arrival = SensorClock(), 10**12, 10**12
    for forward, waited in steps:
        stamp, arrival = stamp + forward, arrival + waited
        clock.observe(stamp, arrival)
        assert stamp + clock.offset_ns(stamp) <= arrival


@given(seed=st.integers(0, 1000), drift=st.floats(-100e-6, 100e-6))
def test_times_of_a_steady_sensor_are_right_within_a_millisecond(seed: int, drift: float) -> None:
    clock = SensorClock()
    stamp, true, _ = feed(clock, 20, drift=drift, seed=seed)
    assert stamp + clock.offset_ns(stamp) == pytest.approx(true, abs=MS)


def waits_that_grow(period_ns: int, read_ns: int, seconds: int) -> SensorClock:
    """Return a clock whose packets are read at regular times, so that waits grow in a line and fall."""
    clock = SensorClock()
    for stamp in range(0, seconds * S, period_ns):
        clock.observe(3 * S + stamp, 100 * S - (-stamp // read_ns) * read_ns)
    return clock


def test_reading_at_regular_times_is_neither_drift_nor_step() -> None:
    for period_ns in (7_680_000, 9_990_000, 99_900_000 // 13):
        for seconds in range(3, 14):
            clock = waits_that_grow(period_ns, 100 * MS, seconds)
            assert abs(clock.drift_ppm or 0.0) < 300.0
            assert clock.steps == 0


@pytest.mark.parametrize("drift", [-2000e-6, 2000e-6])
def test_a_clock_that_runs_away_shows_its_drift(drift: float) -> None:
    clock = SensorClock()
    feed(clock, 12, drift=drift, most_late_ns=0)
    assert clock.drift_ppm == pytest.approx(1e6 * drift, rel=0.05)


def test_a_step_forward_counts_if_it_is_more_than_a_packet() -> None:
    clock = SensorClock()
    stamp, true, _ = feed(clock, 5, most_late_ns=0)
    feed(clock, 1, stamp_ns=stamp + PERIOD + 9 * MS, arrival_ns=true + PERIOD, most_late_ns=0)
    assert clock.steps == 0
    clock = SensorClock()
    stamp, true, _ = feed(clock, 5, most_late_ns=0)
    feed(clock, 1, stamp_ns=stamp + PERIOD + 12 * MS, arrival_ns=true + PERIOD, most_late_ns=0)
    assert (clock.steps, clock.last_step_ns) == (1, 12 * MS)


def test_delays_that_grow_nearly_in_a_line_on_a_busy_computer_are_no_drift() -> None:
    clock, told = SensorClock(), []
    for k, late_ms in enumerate((1, 1, 1, 1, 1, 4, 6.4, 10, 12.6, 16, 16, 16, 16)):
        for i in range(100):
            stamp = (k * 100 + i) * 5_000_000
            clock.observe(stamp, stamp + round(late_ms * 1e6))
            told.append(clock.drift_ppm)
    assert set(told) == {None}
