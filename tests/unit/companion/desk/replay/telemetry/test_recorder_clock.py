"""Steps of the clock of the program that recorded a log."""

from __future__ import annotations

import pytest

from companion.desk.replay.telemetry.recorder_clock import RecorderClock
from tests.unit.companion.flight.link.messages import attitude, heartbeat

MS, S = 1_000_000, 1_000_000_000
BEGIN = 1_750_000_000 * S


def steps_of(step_ns: int, silent_ms: int = 0) -> list[tuple[int, int]]:
    """Return the steps found in ten seconds with one step, after a silence of the autopilot, at the fifth."""
    clock = RecorderClock()
    for ms in range(0, 10_000, 40):
        later = ms >= 5000
        at_ns = BEGIN + (ms + silent_ms * later) * MS + step_ns * later
        if ms % 1000 == 0:
            clock.note(heartbeat(), at_ns)
        clock.note(attitude(60_000 + ms + silent_ms * later), at_ns)
    return clock.steps


@pytest.mark.parametrize("step_ns", [-2 * S, 3 * 3600 * S, 25 * 365 * 86_400 * S, -3600 * S])
def test_a_clock_that_was_set_is_found_with_its_size(step_ns: int) -> None:
    ((at_ns, found_ns),) = steps_of(step_ns)
    assert at_ns == BEGIN + 4960 * MS
    assert found_ns == pytest.approx(step_ns, abs=50 * MS)


@pytest.mark.parametrize("silent_ms", [0, 5000, 3_600_000])
def test_a_silence_is_no_step(silent_ms: int) -> None:
    assert steps_of(0, silent_ms) == []
