"""Zone tracking from window to window: IDs by greatest overlap (SLZ paper, section 3.4.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from slz.grid import Box, Grid
from slz.kernels.raster.bitmap import Bits, packed, unpacked
from slz.kernels.raster.zonal_sums import common
from slz.zone import Zone
from slz.zones.detection import Candidate

Describe = Callable[[Candidate, int], Zone]
MOST_GONE = 256


class ZoneTracker:
    """Default tracking rule: zones are always those of the present map; only their IDs are carried over.

    A zone keeps the ID of the old zone with which it shares the most cells. Of two that claim one ID, the
    larger overlap wins and the other zone gets a new ID. So a shrunken zone shrinks at once, and a vanished
    one is removed at once. A zone that appears where one vanished gets its ID back.
    """

    def __init__(self, numbers: Iterator[int]) -> None:
        self._numbers = numbers
        self._held: list[Held] = []
        self._gone: list[Held] = []

    def update(self, candidates: Iterable[Candidate], describe: Describe) -> list[Zone]:
        """Assign IDs to the zones found in the total map; return their descriptions."""
        found = list(candidates)
        names: dict[int, int] = {}
        for old_zones in (self._held, self._gone):
            claims = [
                (_common(candidate, old), position, old.id)
                for position, candidate in enumerate(found)
                for old in old_zones
                if position not in names and candidate.box.touches(old.box)
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

    def regrid(self, old: Grid, new: Grid) -> None:
        """Re-index the zones in a new grid, or at another level of the pyramid."""
        self._held = [regridded(held, old, new) for held in self._held]
        self._gone = [regridded(held, old, new) for held in self._gone]


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Cells of a zone in a grid, as a bitmap from the box's first row and column `col0` on."""

    id: int
    box: Box
    bits: Bits
    col0: int


def regridded(held: Held, old: Grid, new: Grid) -> Held:
    """Return the cells of a zone in another grid; a new cell belongs to it where its centre does."""
    box = held.box
    if old.cell_m == new.cell_m:
        down, right = old.shift_to(new)
        return replace(held, box=box.shifted(down, right), col0=held.col0 + right)
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


def _common(candidate: Candidate, old: Held) -> int:
    wide = candidate.words_box
    down, right = wide.row0 - old.box.row0, wide.col0 - old.col0
    return int(common(candidate.own_bits, old.bits, down, right))
