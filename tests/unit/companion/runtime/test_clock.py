"""Time of day relative to the companion's clock."""

from __future__ import annotations

import pytest

from companion.runtime.clock import WallOffset, now_ns


async def test_a_time_of_day_that_is_set_in_flight_does_not_move_what_was_recorded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    offset = WallOffset()
    monkeypatch.setattr("time.time_ns", lambda: now_ns() + 5_000)
    first = offset()
    monkeypatch.setattr("time.time_ns", lambda: now_ns() + 3_600_000_000_000)
    assert offset() == first <= 5_000
