"""Copies of frozen records."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from companion.runtime.frozen_record import replaced


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
