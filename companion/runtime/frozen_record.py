"""Fast copies of frozen records with a few changed fields."""

from __future__ import annotations

import functools
from collections import deque
from collections.abc import Callable, Hashable
from itertools import repeat
from operator import attrgetter
from typing import Any, TypeVar, cast

R = TypeVar("R")
_set = object.__setattr__


def replaced(record: R, **changes: Any) -> R:
    """Return a frozen dataclass with slots in which some fields have other values.

    As `dataclasses.replace` in a third of its time, but without `__init__`: for records that check nothing.

    Raises
    ------
    AttributeError
        There is no field of such a name.
    """
    names, values = _fields(cast(Hashable, type(record)))
    copy = object.__new__(type(record))
    deque(map(_set, repeat(copy), names, values(record)), maxlen=0)
    for name, value in changes.items():
        _set(copy, name, value)
    return copy


@functools.cache
def _fields(kind: Hashable) -> tuple[tuple[str, ...], Callable[[Any], tuple[Any, ...]]]:
    """Return the names of a class's fields, two at least, and the getter of their values."""
    names: tuple[str, ...] = kind.__slots__  # type: ignore[attr-defined]
    return names, attrgetter(*names)
