"""Zone tracking by the source's rule: repeated SLZ filtering (SLZ paper, section 3.4.3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Grid
from slz.kernels.paper.zone_statistics import inside_count
from slz.paper.paper_detection import Part
from slz.zone import Zone


@dataclass(frozen=True, slots=True)
class _Content:
    """Bitmap of the cells inside a zone's contour, and row and column of its first bit."""

    bits: NDArray[np.uint64]
    row0: int
    col0: int

    @classmethod
    def of(cls, part: Part) -> _Content:
        return cls(part.content, part.box.row0, 64 * part.words.start)

    def moved(self, down: int, right: int) -> _Content:
        return replace(self, row0=self.row0 + down, col0=self.col0 + right)


class RepeatFilter:
    """Filter of repeated zones: a zone found again is ignored, a morphed one replaces the old under its ID.

    A repetition ratio RR of 1 means the same zone: the new one is ignored, even one that shrank because
    something drove in. That is unsafe; the default is `slz.zones.tracking.ZoneTracker`.

    changed: whether the last update added or replaced a zone.
    """

    def __init__(self, parameters: Parameters, numbers: Iterator[int]) -> None:
        self._parameters = parameters
        self._numbers = numbers
        self._zones: list[Zone] = []
        self._contents: list[_Content] = []
        self._since: list[int] = []  # count of changes at which each zone was added or replaced
        self._ignored: dict[Part, tuple[int, int]] = {}  # index of the same zone, and count of changes then
        self._changes = 0
        self.changed = False

    def update(self, parts: Iterable[Part], describe: Callable[[Part, int], Zone]) -> list[Zone]:
        """Update with the zones found in the total map; return those in effect."""
        self.changed = False
        ignored = {}
        for part in parts:
            known = self._still_ignored(part)
            action, position = ("ignore", known[0]) if known else self._compare(part)
            if action == "ignore":
                ignored[part] = known or (position, self._changes)
                continue
            self.changed = True
            self._changes += 1
            if action == "replace":
                self._zones[position] = describe(part, self._zones[position].id)
                self._contents[position] = _Content.of(part)
                self._since[position] = self._changes
            else:
                self._zones.append(describe(part, next(self._numbers)))
                self._contents.append(_Content.of(part))
                self._since.append(self._changes)
        self._ignored = ignored
        return list(self._zones)

    def _still_ignored(self, part: Part) -> tuple[int, int] | None:
        """Return the result of an earlier comparison of a part, if the zones compared are unchanged."""
        known = self._ignored.get(part)
        if known is None or len(self._zones) > self._parameters.repeat_depth:
            return None
        position, changes = known
        return known if max(self._since[: position + 1]) <= changes else None

    def _compare(self, part: Part) -> tuple[str, int]:
        p, box, n = self._parameters, part.box, len(part.boundary_cells)
        first = max(0, len(self._zones) - p.repeat_depth)
        for position, old in enumerate(self._zones[first:], start=first):
            other = old.box
            if not box.touches(other):
                continue
            # SLZ paper, Eq. (19)
            large = part.n_cells > p.area_ratio * (old.n_safe + old.n_unsafe + old.n_uncertain)
            if not (large or other.holds(box)):
                continue  # can neither be the same zone nor replace it
            allowed = n - math.ceil(p.repeat_ratio * n) if large else 0
            held = self._contents[position]
            inside = inside_count(part.boundary_cells, held.bits, held.row0, held.col0, allowed)
            if inside == n:
                return "ignore", position
            if large and inside / n > p.repeat_ratio:  # SLZ paper, Eq. (18)
                return "replace", position
        return "add", -1

    def regrid(self, old: Grid, new: Grid) -> None:
        """Re-index the zones in a new grid; zones outside it stay in effect."""
        self._contents = [content.moved(*old.shift_to(new)) for content in self._contents]
        self._zones = [_moved(zone, *old.shift_to(new)) for zone in self._zones]
        self._ignored = {}
        self.changed = True


def _moved(zone: Zone, down: int, right: int) -> Zone:
    """Return a zone with its cells shifted."""
    boundary_cells = zone.boundary_cells + np.array([down, right], np.int32)
    return replace(zone, box=zone.box.shifted(down, right), boundary_cells=boundary_cells)
