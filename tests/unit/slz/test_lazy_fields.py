"""Lazy fields: computed at first access, once."""

from __future__ import annotations

import pickle
from copy import deepcopy
from dataclasses import FrozenInstanceError, dataclass, replace

import pytest

from slz.lazy_fields import Deferred, Lazy


@dataclass(frozen=True)
class Holder:
    name: str
    value: Lazy[int] = Lazy()


def test_a_value_is_worked_out_at_the_first_reading_and_once() -> None:
    made: list[int] = []

    def make() -> int:
        made.append(1)
        return 5

    holder = Holder("a", Deferred(make))
    assert made == []
    assert (holder.value, holder.value, made) == (5, 5, [1])


def test_a_given_value_is_returned_as_it_is() -> None:
    assert Holder("a", 7).value == 7
    assert replace(Holder("a", 7), name="b").value == 7


def test_a_lazy_field_has_no_default_and_cannot_be_set() -> None:
    with pytest.raises(TypeError, match="value"):
        Holder("a")
    holder = Holder("a", 7)
    with pytest.raises(FrozenInstanceError):
        holder.value = 8  # type: ignore[misc]


def test_a_holder_is_sent_elsewhere_with_its_value() -> None:
    """As reports were, of which nothing was left to be worked out."""
    assert pickle.loads(pickle.dumps(Holder("a", Deferred(lambda: 5)))) == Holder("a", 5)
    assert deepcopy(Holder("a", Deferred(lambda: 5))) == Holder("a", 5)
