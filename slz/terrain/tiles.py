"""Tiles of per-cell evidence: memory follows the ground seen, within a budget."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.array_memory import prefault_range
from slz.kernels.cells.accumulate import (
    accumulate,
    cells_of,
    contradicts,
    count_by_tile,
    differences,
    mark_above,
    sorted_by_tile,
)
from slz.kernels.cells.cell_record import COUNT, FIELDS, TILE, TIME
from slz.kernels.cells.cell_statistics import stretches, summarise
from slz.kernels.cells.resolution_pyramid import coarse_evidence
from slz.kernels.points.clutter import ground_and_rays
from slz.tile_slots import Key, TileStore, boxes_of_tiles, keys_over, tiles_over

TILE_BYTES = TILE * TILE * 2 * FIELDS * 4
LINE_BYTES = 64  # of a cache line; the size of a cell's evidence
LEAP_S = 100_000.0
TIME_ROUNDING = 1e-6  # relative, of a time plus 1,000 s: more than the error of single precision
LEAST_CAPACITY = 16  # tiles, however small the budget
SERIALS = itertools.count(1)  # serial numbers of maps, so that a follower notices a replacement
Boxes = NDArray[np.int64]
Hits = tuple[Key, NDArray[np.uint64]]
"""First tile of a rectangle of tiles, and (rows, columns, TILE) words: a bit for each cell hit."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of one return: along its ray (m) and of the ray's direction (rad)."""

    range_m: float
    angle_rad: float


def no_boxes() -> Boxes:
    """Return no boxes, (0, 4)."""
    return np.empty((0, 4), np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """Effect of a window: tiles evicted for it, and points without a tile.

    boxes: (n, 4) row0, row1, col0, col1 (half open) of the cells hit in each tile. hits: which these are.
    """

    boxes: Boxes = field(default_factory=no_boxes)
    evicted: tuple[Key, ...] = ()
    n_dropped: int = 0
    hits: tuple[Hits, ...] = ()

    def together_with(self, other: Change) -> Change:
        """Return the effect of both."""
        return Change(
            np.concatenate([self.boxes, other.boxes]),
            self.evicted + other.evicted,
            self.n_dropped + other.n_dropped,
            self.hits + other.hits,
        )


class Tiles:
    """Evidence of cells, in tiles that are made when first hit and evicted when the budget is used.

    Rows and columns count from the corner (west_m, south_m) and may be negative. A cell holds a current
    and a previous epoch of `FIELDS` numbers, see `slz.kernels.cells.accumulate`.

    Parameters
    ----------
    budget_bytes
        Bound on the memory for evidence. The tile not seen for longest is evicted first, a pinned one never.
    """

    def __init__(self, west_m: float, south_m: float, cell_m: float, budget_bytes: float) -> None:
        self.west_m, self.south_m, self.cell_m = west_m, south_m, cell_m
        capacity = max(LEAST_CAPACITY, int(budget_bytes // TILE_BYTES))
        self._pool = _aligned((capacity, TILE, TILE, 2, FIELDS))
        self._store = TileStore(capacity)
        self._last_s: dict[Key, float] = {}
        self._oldest_s = np.full(capacity, np.inf)  # last seen time of each tile's cell not seen for longest
        self.datum_m = 0.0
        """Height of the zero of the stored heights: not included in them, added on output."""
        self.latest_s = 0.0
        self._epoch_s: float | None = None

    def __len__(self) -> int:
        return len(self._store)

    @property
    def capacity(self) -> int:
        return len(self._pool)

    @property
    def n_free(self) -> int:
        """Number of tiles left in the budget."""
        return self._store.n_free

    @property
    def boxes(self) -> Boxes:
        """Boxes of all tiles held, as those of a change."""
        return boxes_of_tiles(self._store.slot)

    def now_s(self, stamp_s: float) -> float:
        """Return the time since the first stamp; single precision keeps it to milliseconds for hours.

        When a clock steps back, time continues from where it was, so nothing becomes younger. When it leaps
        ahead, time advances by `LEAP_S` only: longer than any age limit, and small enough for single
        precision.
        """
        if self._epoch_s is None:
            self._epoch_s = stamp_s
        elif stamp_s - self._epoch_s < self.latest_s:
            self._epoch_s = stamp_s - self.latest_s
        elif stamp_s - self._epoch_s > self.latest_s + LEAP_S:
            self._epoch_s = stamp_s - self.latest_s - LEAP_S
        self.latest_s = stamp_s - self._epoch_s
        return self.latest_s

    def add(
        self,
        points_enu_m: NDArray[np.float64],
        sensor_enu_m: NDArray[np.float64],
        noise: Noise,
        within: Box,
        now_s: float,
        hold_s: float,
        pinned: Collection[Key] = (),
        max_age_s: float = math.inf,
    ) -> Change:
        """Add the points in a box to the evidence of their cells; evidence too old is cleared first."""
        edges = np.array([within.row0, within.row1, within.col0, within.col1])
        points_enu_m = np.ascontiguousarray(points_enu_m)
        at, found = cells_of(points_enu_m, self.west_m, self.south_m, self.cell_m, edges)
        *hit, inside = found.tolist()
        if not inside:
            return Change()
        corner, shape = tiles_over(Box(*hit))
        count = count_by_tile(at, *corner, *shape)
        wanted = np.argwhere(count) + np.array(corner)
        evicted = self._make_room([(r, c) for r, c in wanted.tolist()], sensor_enu_m, now_s, pinned)
        cells, samples = sorted_by_tile(
            points_enu_m, at, sensor_enu_m, noise.range_m, noise.angle_rad, *corner, count
        )
        table, hit_boxes = self._store.table(Box(*hit)), np.zeros((*shape, 4), np.int64)
        slots = table[(count > 0) & (table >= 0)]
        self._oldest_s[slots] = np.minimum(self._oldest_s[slots], now_s)
        hits = np.zeros((*shape, TILE), np.uint64)
        used = accumulate(
            cells, samples, count, *corner, now_s, hold_s, max_age_s, self._pool, table, hit_boxes, hits
        )
        boxes = hit_boxes[hit_boxes[..., 0] < hit_boxes[..., 1]]
        return Change(boxes, evicted, inside - int(used), ((corner, hits),))

    def _make_room(
        self, wanted: list[Key], sensor_enu_m: NDArray[np.float64], now_s: float, pinned: Collection[Key]
    ) -> tuple[Key, ...]:
        """Allocate the wanted tiles, the nearest to the sensor first; return the evicted tiles."""
        store = self._store
        here = [key for key in wanted if key in store.slot]
        for key in here:
            self._last_s[key] = now_s
        new = [key for key in wanted if key not in store.slot]
        old: Iterator[Key] = iter(())
        if len(new) > store.n_free:
            new.sort(key=lambda key: self._distance_m(key, sensor_enu_m))
            kept = set(here) | set(pinned)
            old = iter(sorted((k for k in store.slot if k not in kept), key=lambda k: (self._last_s[k], k)))
        evicted = []
        for key in new:
            if not store.n_free:
                victim = next(old, None)
                if victim is None:
                    break
                evicted.append(victim)
                slot = store.drop(victim)
                self._pool[slot], self._oldest_s[slot] = 0, np.inf
                del self._last_s[victim]
            store.take(key)
            self._last_s[key] = now_s
        return tuple(evicted)

    def prepare(self, count: int) -> None:
        """Prefault the memory of `count` more tiles."""
        rows = self._pool.reshape(self.capacity, TILE * TILE, -1)
        for slot in self._store.next_free(count):
            prefault_range(rows, slice(slot, slot + 1), slice(0, TILE * TILE))

    def _distance_m(self, key: Key, sensor_enu_m: NDArray[np.float64]) -> tuple[float, Key]:
        east = self.west_m + (key[1] + 0.5) * TILE * self.cell_m - sensor_enu_m[0]
        north = self.south_m + (key[0] + 0.5) * TILE * self.cell_m - sensor_enu_m[1]
        distance = math.hypot(east, north)
        return (0.0 if math.isnan(distance) else distance), key

    def read(self, box: Box, level: int = 0, max_age_s: float = math.inf) -> NDArray[np.float32]:
        """Return a copy (rows, cols, 2, FIELDS) of the evidence of a box; zero where nothing was seen.

        Parameters
        ----------
        level
            The box and the result are in cells 2^level times as wide; then evidence older than `max_age_s` is
            left out.
        """
        cells = box.row0, box.row1, box.col0, box.col1
        table = self._store.table(Box(*(edge << level for edge in cells)))
        return coarse_evidence(self._pool, table, cells, level, self.latest_s, max_age_s)

    def summary(self, box: Box, max_age_s: float) -> NDArray[np.float32]:
        """Return `slz.kernels.cells.cell_statistics.summarise` of the cells of a box at the latest stamp."""
        places = stretches(self._store.table(box), box.row0, box.row1)
        cols = box.col0 % TILE, box.shape[1]
        return summarise(self._pool.reshape(-1), places, *cols, self.latest_s, max_age_s)

    def overdue(self, most_s: float) -> list[tuple[float, Key]]:
        """Return how much longer than `most_s` the oldest cell of each tile was not seen, the most first.

        Tiles where that is no time are left out.
        """
        late_s = self.latest_s - most_s - self._oldest_s
        if not (late_s > 0).any():
            return []
        return sorted(((float(late_s[slot]), key) for key, slot in self._store.slot.items()), reverse=True)

    def look_for_oldest(self, key: Key, since_s: float) -> None:
        """Look anew for the tile's cell not seen for longest.

        Parameters
        ----------
        since_s
            Cells last seen before this time, by more than rounding, do not count.
        """
        slot = self._store.slot.get(key)
        if slot is None:
            return
        seen_s = self._pool[slot, :, :, 1, TIME][self._pool[slot, :, :, 0, COUNT] > 0]
        young = seen_s[seen_s >= since_s - TIME_ROUNDING * (abs(since_s) + 1000)]
        self._oldest_s[slot] = young.min(initial=np.inf)

    def differences(
        self, points_enu_m: NDArray[np.float64], rows: NDArray[np.int64] | None = None, lower_m: float = 0.0
    ) -> NDArray[np.float64]:
        """Return (m, 4) of the points over known cells: east, north, height above the mean, and index.

        Parameters
        ----------
        rows, lower_m
            Points to compare, to whose indices the result refers, by default all; and by how much to lower
            them.
        """
        rows = np.arange(len(points_enu_m)) if rows is None else rows
        place = (*self._place, self._pool, self._store.directory)
        return differences(points_enu_m, rows, lower_m, *place)

    def contradicted_by(
        self,
        points_enu_m: NDArray[np.float64],
        sensor_enu_m: NDArray[np.float64],
        noise: Noise,
        least_m: float,
    ) -> NDArray[np.bool_]:
        """Return which points are higher over known ground than noise and `least_m` explain."""
        limits, held = (least_m, noise.angle_rad), (self._pool, self._store.directory)
        return contradicts(points_enu_m, sensor_enu_m, *limits, *self._place, *held)

    def mark_above(
        self,
        points_enu_m: NDArray[np.float64],
        flags: NDArray[np.uint16],
        asked: tuple[int, int, int],
        sensor_enu_m: NDArray[np.float64],
        noise: Noise,
        least_m: float,
    ) -> None:
        """Set a flag of such points; asked: all flags of theirs, none of theirs, and the flag to set."""
        limits, held = (least_m, noise.angle_rad), (self._pool, self._store.directory)
        mark_above(points_enu_m, flags, *asked, sensor_enu_m, *limits, *self._place, *held)

    def ground_and_rays(self, points_enu_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 2) of `slz.kernels.points.clutter.ground_and_rays`."""
        return ground_and_rays(points_enu_m, *self._place, self._pool, self._store.directory)

    @property
    def _place(self) -> tuple[float, float, float]:
        return self.west_m, self.south_m, self.cell_m

    def any_near(self, key: Key, level: int) -> bool:
        """Return whether a tile of a level's maps covers a tile held, or one next to it."""
        rows, cols = (range((k << level) - 1, ((k + 1) << level) + 1) for k in key)
        return any((row, col) in self._store.slot for row in rows for col in cols)

    def keys_over(self, box: Box) -> tuple[Key, ...]:
        """Return the keys of the tiles that a box of cells touches, held or not."""
        return keys_over(box)


def _aligned(shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return zeros aligned to a cache line; unused pages are not backed by memory."""
    size = math.prod(shape)
    whole = np.zeros(size + LINE_BYTES // 4, np.float32)
    first = -whole.ctypes.data % LINE_BYTES // 4
    return whole[first : first + size].reshape(shape)
