"""Report and zones in source mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from slz.grid import Grid
from slz.landing_point.obstacles import Obstacle
from slz.report import Report
from slz.zone import Zone

T = TypeVar("T")


class PaperReport(Report):
    """Report whose zones are those of the map chosen by height and speed (SLZ thesis, section 4.3.1)."""

    __slots__ = ()

    @property
    def grid(self) -> Grid:
        """Grid of the chosen map."""
        return self.far.grid if self.choice.far else self.near.grid

    @property
    def zones(self) -> tuple[Zone, ...]:
        """Zones of the chosen map."""
        return self.far.zones if self.choice.far else self.near.zones


def chosen_map(report: Report | None) -> Literal["near", "far"]:
    """Return the map of a report's `zones`: the far one only where source mode chose it."""
    return "far" if isinstance(report, PaperReport) and report.choice.far else "near"


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


class Lazy(Generic[T]):
    """Descriptor of a field set to its value, or to a `Deferred` for the first read."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, holder: object, owner: type | None = None) -> T:
        if holder is None:
            raise AttributeError(self._name)
        held: T | Deferred[T] = vars(holder)[self._name]
        return held.value() if isinstance(held, Deferred) else held

    def __set__(self, holder: object, value: T | Deferred[T]) -> None:
        vars(holder)[self._name] = value


@dataclass(frozen=True)
class PaperZone(Zone):
    """Zone whose cells, corners and obstacles are computed on first read, from the maps of its description.

    Its cells are all those inside the contour.
    """

    cells: Lazy[NDArray[np.uint8]] = Lazy()
    corners_enu_m: Lazy[NDArray[np.float64]] = Lazy()
    obstacles: Lazy[Sequence[Obstacle]] = Lazy()
