"""Ring buffer: the newest rows in order, in constant memory."""

from __future__ import annotations

import numpy as np
import pytest

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
