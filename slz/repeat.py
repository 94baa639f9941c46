"""Which zone is which from window to window (SLZ paper §3.4.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from params import Parameters
from slz.grid import Box, Grid
from slz.search import Candidate
from slz.zone import Zone

Describe = Callable[[Candidate, int], Zone]


class RepeatFilter:
    """The source's rule: a zone found again is ignored, a morphed one replaces the old and keeps its ID.

    RR, the share of the new boundary inside an old zone (Eq. 18), of 1 means the same zone: the new one is
    ignored, even one that shrank because something drove in. That is unsafe; `ZoneTracker` is the default.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._zones: list[Zone] = []
        self._next_id = 1

    def update(self, candidates: Iterable[Candidate], grid: Grid, describe: Describe) -> list[Zone]:
        """Take the zones found in the total map; return those in effect."""
        for candidate in candidates:
            action, position = self._compare(candidate)
            if action == "ignore":
                continue
            if action == "replace":
                self._zones[position] = describe(candidate, self._zones[position].id)
            else:
                self._zones.append(describe(candidate, self._next_id))
                self._next_id += 1
        return list(self._zones)

    def _compare(self, candidate: Candidate) -> tuple[str, int]:
        p = self._parameters
        first = max(0, len(self._zones) - p.repeat_depth)
        for position, old in enumerate(self._zones[first:], start=first):
            if not _touch(candidate.box, old.box):
                continue
            share = _share_inside(candidate, old)
            if share == 1:
                return "ignore", position
            if share > p.repeat_ratio and candidate.content.sum() > p.area_ratio * old.cells.sum():
                return "replace", position
        return "add", -1

    def moved(self, old: Grid, new: Grid) -> None:
        """Follow the map to a new zone; zones that lie outside it stay in effect."""
        self._zones = [shifted(zone, old, new) for zone in self._zones]


class ZoneTracker:
    """The default rule: zones are always those of the present map; only their IDs are carried over.

    A zone keeps the ID of the old zone it shares most cells with; of two that claim one ID, the larger share
    wins and the other is new. So a shrunken zone shrinks at once and a vanished one is gone at once.
    """

    def __init__(self) -> None:
        self._zones: list[Zone] = []
        self._next_id = 1

    def update(self, candidates: Iterable[Candidate], grid: Grid, describe: Describe) -> list[Zone]:
        """Take the zones found in the total map and name them."""
        found = list(candidates)
        claims = sorted(
            (
                (_common(candidate, old), position, old.id)
                for position, candidate in enumerate(found)
                for old in self._zones
                if _touch(candidate.box, old.box)
            ),
            key=lambda claim: (-claim[0], claim[2], claim[1]),
        )
        names: dict[int, int] = {}
        for cells, position, zone_id in claims:
            if cells and position not in names and zone_id not in names.values():
                names[position] = zone_id
        for position in range(len(found)):
            if position not in names:
                names[position] = self._next_id
                self._next_id += 1
        self._zones = [describe(candidate, names[position]) for position, candidate in enumerate(found)]
        return list(self._zones)

    def moved(self, old: Grid, new: Grid) -> None:
        """Follow the map to a new zone."""
        self._zones = [shifted(zone, old, new) for zone in self._zones]


def shifted(zone: Zone, old: Grid, new: Grid) -> Zone:
    """Return a zone with its cells counted in another grid."""
    from dataclasses import replace

    down, right = old.shift_to(new)
    box = zone.box
    return replace(
        zone,
        box=Box(box.row0 + down, box.row1 + down, box.col0 + right, box.col1 + right),
        boundary_cells=zone.boundary_cells + np.array([down, right], np.int32),
    )


def _touch(a: Box, b: Box) -> bool:
    return a.row0 < b.row1 and b.row0 < a.row1 and a.col0 < b.col1 and b.col0 < a.col1


def _share_inside(candidate: Candidate, old: Zone) -> float:
    """RR of Eq. 18: the share of the new boundary points that lie in the old zone."""
    local = candidate.boundary_cells - np.array([old.box.row0, old.box.col0], np.int32)
    within = ((local >= 0) & (local < np.array(old.cells.shape))).all(axis=1)
    n = int(old.cells[local[within, 0], local[within, 1]].sum())
    return n / len(local)


def _common(candidate: Candidate, old: Zone) -> int:
    a, b = candidate.box, old.box
    row0, row1 = max(a.row0, b.row0), min(a.row1, b.row1)
    col0, col1 = max(a.col0, b.col0), min(a.col1, b.col1)
    mine = candidate.component[row0 - a.row0 : row1 - a.row0, col0 - a.col0 : col1 - a.col0]
    theirs = old.cells[row0 - b.row0 : row1 - b.row0, col0 - b.col0 : col1 - b.col0]
    return int(np.count_nonzero(mine & theirs))
