"""Ring buffer: the newest rows in order, in constant memory."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from companion.runtime.clock import WallOffset, now_ns
from companion.runtime.frozen_record import replaced
from companion.runtime.ring_buffer import RingBuffer


def test_the_newest_are_kept_the_oldest_of_them_first() -> None:
    recent = RingBuffer(3)
    assert not recent
    for value in range(5):
        recent.append(value)
        assert recent.last == value
    assert len(recent) == 3
    assert recent.array().tolist() == [2.0, 3.0, 4.0]
    assert recent.array(2).tolist() == [3.0, 4.0]
    assert recent.array(9).tolist() == [2.0, 3.0, 4.0]


def test_rows_are_places_and_what_is_given_out_is_a_copy() -> None:
    recent = RingBuffer(4, (3,))
    assert recent.array().shape == (0, 3)
    recent.append(np.array([1.0, 2.0, 3.0]))
    recent.last[:] = 9.0
    recent.array()[:] = 9.0
    assert recent.array().tolist() == [[1.0, 2.0, 3.0]]


def test_nothing_is_left_after_it_is_cleared() -> None:
    recent = RingBuffer(2)
    recent.append(1.0)
    recent.clear()
    assert not recent
    with pytest.raises(IndexError, match="nothing was appended"):
        _ = recent.last


# Time of day relative to the companion's clock.


async def test_a_time_of_day_that_is_set_in_flight_does_not_move_what_was_recorded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    offset = WallOffset()
    monkeypatch.setattr("time.time_ns", lambda: now_ns() + 5_000)
    first = offset()
    monkeypatch.setattr("time.time_ns", lambda: now_ns() + 3_600_000_000_000)
    assert offset() == first <= 5_000


# Copies of frozen records.


@dataclass(frozen=True, slots=True)
class Record:
    """Three fields."""

    number: int = 1
    name: str = "one"
    where: tuple[float, float] = (0.0, 1.0)


def test_a_copy_differs_in_what_changes_alone() -> None:
    before = Record(2, "two")
    after = replaced(before, name="other", number=3)
    assert after == replace(before, name="other", number=3)
    assert after.where is before.where
    assert before == Record(2, "two")


def test_a_copy_is_frozen_and_has_no_other_fields() -> None:
    with pytest.raises(AttributeError):
        replaced(Record(), place="here")
    with pytest.raises(AttributeError):
        replaced(Record(), number=2).number = 3  # type: ignore[misc]
