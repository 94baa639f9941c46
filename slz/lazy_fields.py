"""Dataclass fields computed on first read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Deferred(Generic[T]):
    """Deferred value: computed once, on first read; the function that computes it is released then."""

    __slots__ = ("_make", "_value")

    def __init__(self, make: Callable[[], T]) -> None:
        self._make: Callable[[], T] | None = make

    def value(self) -> T:
        make = self._make
        if make is not None:  # two threads may both compute it, with equal results
            self._value = make()
            self._make = None
        return self._value

    def __reduce__(self) -> tuple[Callable[[T], T], tuple[T]]:
        """Pickle the value: the function that computes it cannot be pickled."""
        return _itself, (self.value(),)


def _itself(value: T) -> T:
    return value


class Lazy(Generic[T]):
    """Descriptor of a dataclass field (no slots) set to its value, or to a `Deferred` for the first read."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, holder: Any, owner: type | None = None) -> T:
        if holder is None:
            raise AttributeError(self._name)  # a field without a default
        held: T | Deferred[T] = vars(holder)[self._name]
        return held.value() if isinstance(held, Deferred) else held

    def __set__(self, holder: Any, value: T | Deferred[T]) -> None:
        vars(holder)[self._name] = value
