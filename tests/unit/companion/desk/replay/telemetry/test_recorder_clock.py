"""Steps of the clock of the program that recorded a log."""

from __future__ import annotations

import pytest

from companion.desk.replay.recorder_clock import ClockStep, RecorderClock, continuous_time
from tests.unit.companion.flight.link.messages import attitude, heartbeat

MS, S = 1_000_000, 1_000_000_000
BEGIN = 1_750_000_000 * S


def steps_of(step_ns: int, silent_ms: int = 0) -> tuple[ClockStep, ...]:
    """Return the steps found in ten seconds with one step, after a silence of the autopilot, at the fifth."""
    clock = RecorderClock()
    for ms in range(0, 10_000, 40):
        later = ms >= 5000
        at_ns = BEGIN + (ms + silent_ms * later) * MS + step_ns * later
        if ms % 1000 == 0:
            clock.note(heartbeat(), at_ns)
        clock.note(attitude(60_000 + ms + silent_ms * later), at_ns)
    return clock.steps()


@pytest.mark.parametrize("step_ns", [-2 * S, 3 * 3600 * S, 25 * 365 * 86_400 * S, -3600 * S])
def test_a_clock_that_was_set_is_found_with_its_size(step_ns: int) -> None:
    (found,) = steps_of(step_ns)
    assert found.at_ns == BEGIN + 4960 * MS
    assert found.step_ns == step_ns


@pytest.mark.parametrize("silent_ms", [0, 5000, 3_600_000])
def test_a_silence_is_no_step(silent_ms: int) -> None:
    assert steps_of(0, silent_ms) == ()


def told(step_ns: int, first_ms: int = 0, last_ms: int = 10_000) -> list[int]:
    """Return times every 100 ms by a clock that is set at the fifth second."""
    return [BEGIN + ms * MS + step_ns * (ms >= 5000) for ms in range(first_ms, last_ms, 100)]


@pytest.mark.parametrize("step_ns", [-2 * S, 60 * S, 25 * 365 * 86_400 * S])
@pytest.mark.parametrize(("first_ms", "last_ms"), [(0, 10_000), (0, 4900), (0, 5500), (8000, 10_000)])
def test_times_are_those_of_the_clock_of_the_end(step_ns: int, first_ms: int, last_ms: int) -> None:
    times = told(step_ns, first_ms, last_ms)
    recorded = continuous_time([ClockStep(BEGIN + 4980 * MS, step_ns)], times)
    wanted = [BEGIN + ms * MS + step_ns for ms in range(first_ms, last_ms, 100)]
    assert [recorded(at_ns) for at_ns in times] == wanted


def test_two_steps_are_taken_in_their_order_and_one_of_another_clock_is_none() -> None:
    steps = [ClockStep(BEGIN + 4980 * MS, 3600 * S), ClockStep(BEGIN + 3600 * S + 7980 * MS, -2 * S)]
    times = [at_ns - 2 * S * (at_ns >= BEGIN + 3608 * S) for at_ns in told(3600 * S)]
    recorded = continuous_time(steps, times)
    assert [recorded(at_ns) for at_ns in times] == [
        BEGIN + 3598 * S + ms * MS for ms in range(0, 10_000, 100)
    ]
    own = told(0)
    recorded = continuous_time([ClockStep(BEGIN + 6980 * MS, -2 * S)], own)
    assert [recorded(at_ns) for at_ns in own] == own
