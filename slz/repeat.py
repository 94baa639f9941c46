"""Which zone is which from window to window (SLZ paper §3.4.3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Grid
from slz.kernels.bits import Bits, packed, unpacked
from slz.kernels.measure import inside_count
from slz.kernels.tally import common
from slz.search import Candidate
from slz.source_search import Part
from slz.zone import Zone

Describe = Callable[[Candidate, int], Zone]
MOST_GONE = 256


@dataclass(frozen=True, slots=True)
class _Content:
    """What lies inside a zone's contour, as bits, and the row and column of the first."""

    bits: NDArray[np.uint64]
    row0: int
    col0: int

    @classmethod
    def of(cls, part: Part) -> _Content:
        return cls(part.content, part.box.row0, 64 * part.words.start)

    def moved(self, down: int, right: int) -> _Content:
        return replace(self, row0=self.row0 + down, col0=self.col0 + right)


class RepeatFilter:
    """The source's rule: a zone found again is ignored, a morphed one replaces the old and keeps its ID.

    RR, the share of the new boundary inside an old zone (Eq. 18), of 1 means the same zone: the new one is
    ignored, even one that shrank because something drove in. That is unsafe; `ZoneTracker` is the default.

    changed: whether the last update added or replaced a zone.
    """

    def __init__(self, parameters: Parameters, numbers: Iterator[int]) -> None:
        self._parameters = parameters
        self._numbers = numbers
        self._zones: list[Zone] = []
        self._contents: list[_Content] = []
        self._since: list[int] = []  # count of changes at which each zone came
        self._ignored: dict[Part, tuple[int, int]] = {}  # by which zone, and the count then
        self._changes = 0
        self.changed = False

    def update(self, parts: Iterable[Part], describe: Callable[[Part, int], Zone]) -> list[Zone]:
        """Take the zones found in the total map; return those in effect."""
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
        """Return what was kept of a part compared before, if the zones it was compared with are the same."""
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
            if not _touch(box, other):
                continue
            large = part.n_cells > p.area_ratio * (old.n_safe + old.n_unsafe + old.n_uncertain)
            if not (large or _within(box, other)):
                continue  # it can neither be the same nor replace it
            allowed = n - math.ceil(p.repeat_ratio * n) if large else 0
            held = self._contents[position]
            inside = inside_count(part.boundary_cells, held.bits, held.row0, held.col0, allowed)
            if inside == n:
                return "ignore", position
            if large and inside / n > p.repeat_ratio:
                return "replace", position
        return "add", -1

    def moved(self, old: Grid, new: Grid) -> None:
        """Follow the map to a new zone; zones that lie outside it stay in effect."""
        self._contents = [content.moved(*old.shift_to(new)) for content in self._contents]
        self._zones = [_moved(zone, *old.shift_to(new)) for zone in self._zones]
        self._ignored = {}
        self.changed = True


def _moved(zone: Zone, down: int, right: int) -> Zone:
    """Return a zone with its cells counted from another corner."""
    boundary_cells = zone.boundary_cells + np.array([down, right], np.int32)
    return replace(zone, box=_shifted(zone.box, down, right), boundary_cells=boundary_cells)


class ZoneTracker:
    """The default rule: zones are always those of the present map; only their IDs are carried over.

    A zone keeps the ID of the old zone it shares most cells with; of two that claim one ID, the larger share
    wins and the other is new. So a shrunken zone shrinks at once and a vanished one is gone at once. One that
    appears where a vanished one was is that one again.
    """

    def __init__(self, numbers: Iterator[int]) -> None:
        self._numbers = numbers
        self._held: list[Held] = []
        self._gone: list[Held] = []

    def update(self, candidates: Iterable[Candidate], describe: Describe) -> list[Zone]:
        """Take the zones found in the total map and name them."""
        found = list(candidates)
        names: dict[int, int] = {}
        for old_zones in (self._held, self._gone):
            claims = [
                (_common(candidate, old), position, old.id)
                for position, candidate in enumerate(found)
                for old in old_zones
                if position not in names and _touch(candidate.box, old.box)
            ]
            for cells, position, zone_id in sorted(claims, key=lambda claim: (-claim[0], claim[2], claim[1])):
                if cells and position not in names and zone_id not in names.values():
                    names[position] = zone_id
        zones = [
            describe(candidate, names[position] if position in names else next(self._numbers))
            for position, candidate in enumerate(found)
        ]
        present = {zone.id for zone in zones}
        gone = [old for old in (*self._gone, *self._held) if old.id not in present]
        self._held = [
            Held(zone.id, candidate.box, candidate.own_bits, candidate.words_box.col0)
            for zone, candidate in zip(zones, found, strict=True)
        ]
        self._gone = gone[-MOST_GONE:]
        return zones

    def moved(self, old: Grid, new: Grid) -> None:
        """Follow the map to a new zone, or to another level of the pyramid."""
        self._held = [regridded(held, old, new) for held in self._held]
        self._gone = [regridded(held, old, new) for held in self._gone]


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """The cells of a zone in a grid, as bits from the box's first row and some column on."""

    id: int
    box: Box
    bits: Bits
    col0: int


def _shifted(box: Box, down: int, right: int) -> Box:
    return Box(box.row0 + down, box.row1 + down, box.col0 + right, box.col1 + right)


def regridded(held: Held, old: Grid, new: Grid) -> Held:
    """Return cells counted in another grid; one of its cells belongs to them where its centre does."""
    box = held.box
    if old.cell_m == new.cell_m:
        down, right = old.shift_to(new)
        return replace(held, box=_shifted(box, down, right), col0=held.col0 + right)
    low, high = old.centre(box.row0 - 0.5, box.col0 - 0.5), old.centre(box.row1 - 0.5, box.col1 - 0.5)
    (row0, col0), (row1, col1) = new.index(*low), new.index(*high)
    box = Box(row0, row1 + 1, col0, col1 + 1)
    centres = new.centres(np.argwhere(np.ones(box.shape, bool)) + np.array([row0, col0]))
    corner = np.array([old.south_m, old.west_m])
    at = np.floor((centres[:, ::-1] - corner) / old.cell_m).astype(np.int64) - (held.box.row0, held.col0)
    inside = ((at >= 0) & (at < (len(held.bits), 64 * held.bits.shape[1]))).all(axis=1)
    cells = np.zeros(len(at), np.uint8)
    cells[inside] = unpacked(held.bits, 0, 64 * held.bits.shape[1])[*at[inside].T]
    return Held(held.id, box, packed(cells.reshape(box.shape)), box.col0)


def _touch(a: Box, b: Box) -> bool:
    return a.row0 < b.row1 and b.row0 < a.row1 and a.col0 < b.col1 and b.col0 < a.col1


def _within(a: Box, b: Box) -> bool:
    return b.row0 <= a.row0 and a.row1 <= b.row1 and b.col0 <= a.col0 and a.col1 <= b.col1


def _common(candidate: Candidate, old: Held) -> int:
    wide = candidate.words_box
    down, right = wide.row0 - old.box.row0, wide.col0 - old.col0
    return int(common(candidate.own_bits, old.bits, down, right))
