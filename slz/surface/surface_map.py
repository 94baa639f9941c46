"""Surface map of a flight: evidence of surface cells in tiles, and what it says the ground is."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Edges, common, within
from slz.kernels.cells.cell_record import TILE
from slz.kernels.surface.add_returns import add_lost, add_returns, tiles_hit
from slz.kernels.surface.surface_record import COUNT, OBLIQUE, SURFACE_FIELDS, TIME
from slz.surface.classification import classify
from slz.surface.surface_cells import SurfaceCells
from slz.surface.surface_kinds import SurfaceHere
from slz.surface.surface_probabilities import N_LAYERS, SHAPE, SurfaceLayers
from slz.tile_keys import Key, box_of_tile, keys_over

Points = NDArray[np.float64]
CELL_M = 1.0  # least side of a surface cell
AROUND_M = 16.0  # beyond the returns of a window, within which cells are classified with them
EVERY, FAR_AROUND_M = 4, 60.0  # updates, after which shores farther off are looked for
SHAPE_S = 60.0  # time for which what they told is kept
PART_M = 1024.0  # side of a square that is classified at a time
SHARE = 1 / 20  # of the memory for evidence
TILE_BYTES = TILE * TILE * 4 * (SURFACE_FIELDS + N_LAYERS + 1)
LEAST_TILES = 16
OBLIQUE_SHARE = 0.2  # of the returns of a box, above which a sensor sees obliquely
FOOT_M = 10.0  # around the vehicle, in which the ground that lost rays met is sought


@dataclass(frozen=True, slots=True)
class Signal:
    """Evidence of a window's points beyond their place.

    origin, origins_enu_m: (n,) row of each point's sensor position in (k, 3), or empty where unknown.
    intensity: (n,) float32, share of the light of a white target, NaN where unknown, or empty.
    echoes: (n,) uint8, number of returns of the ray, 0 where unknown, or empty. lost_enu_m,
    lost_origin_enu_m: (m, 3), a point on each ray without a return and the sensor then, in stored heights;
    lost_weight: (m,), rays that each stands for.
    """

    origin: NDArray[np.uint16]
    origins_enu_m: Points
    intensity: NDArray[np.float32]
    echoes: NDArray[np.uint8]
    lost_enu_m: Points
    lost_origin_enu_m: Points
    lost_weight: NDArray[np.float32]


NO_SIGNAL = Signal(
    np.empty(0, np.uint16),
    np.empty((0, 3)),
    np.empty(0, np.float32),
    np.empty(0, np.uint8),
    np.empty((0, 3)),
    np.empty((0, 3)),
    np.empty(0, np.float32),
)


class SurfaceMap:
    """What the ground is, in cells of about a metre that near cells divide evenly.

    Parameters
    ----------
    west_m, south_m
        Corner of the near map's cells, from which surface cells count.
    """

    def __init__(self, west_m: float, south_m: float, parameters: Parameters) -> None:
        self.west_m, self.south_m = west_m, south_m
        self.cell_m = parameters.cell_m * max(1, round(CELL_M / parameters.cell_m))
        self._parameters = parameters
        capacity = max(LEAST_TILES, int(parameters.memory_mb * SHARE * 2**20 / TILE_BYTES))
        self._pool = np.zeros((capacity, TILE, TILE, SURFACE_FIELDS), np.float32)
        self._layers = np.zeros((capacity, N_LAYERS, TILE, TILE), np.float32)
        self._shape_s = np.full((capacity, TILE, TILE), -np.inf, np.float32)
        self._n_refused = np.zeros(capacity, np.int64)
        self._n_updates = 0
        self._sees_obliquely = False
        self._given_up: list[Edges] = []
        self._slot: dict[Key, int] = {}
        self._last_s: dict[Key, float] = {}
        self._free = list(range(capacity))[::-1]

    def update(
        self,
        points: Points,
        is_near: NDArray[np.bool_],
        sensor: Points,
        now_s: float,
        signal: Signal,
        grid_edges: Edges,
    ) -> list[Edges]:
        """Add a window's points and classify the ground they hit.

        Parameters
        ----------
        points, is_near
            (n, 3) in stored heights, and (n,) whether their heights are certain enough.
        sensor
            (3,) in stored heights, NaN where unknown.
        grid_edges
            West, south, east and north edge of the map.

        Returns
        -------
        West, south, east, north edges of the tiles in which other cells are refused now.
        """
        near = points[is_near & within_edges(points, grid_edges)]
        if not len(near):
            return []
        low, high = near[:, :2].min(axis=0), near[:, :2].max(axis=0)
        side = self.cell_m * TILE
        first = np.floor((low - (self.west_m, self.south_m)) / side).astype(np.int64)
        last = np.floor((high - (self.west_m, self.south_m)) / side).astype(np.int64)
        corner, shape = (int(first[1]), int(first[0])), (last - first + 1)[::-1]
        west, south = self.west_m + corner[1] * side, self.south_m + corner[0] * side
        hit = np.zeros(tuple(shape.tolist()), np.bool_)
        tiles_hit(np.ascontiguousarray(near), west, south, self.cell_m, hit)
        table = self._table(corner, hit, now_s)
        add_returns(
            points, signal.origin, signal.origins_enu_m, is_near, signal.intensity, signal.echoes, now_s,
            self._parameters.max_age_s, west, south, self.cell_m, table, self._pool,
        )  # fmt: skip
        if len(signal.lost_enu_m) and math.isfinite(sensor[0]):
            foot = near[np.hypot(*(near[:, :2] - sensor[:2]).T) < FOOT_M]
            ground_m = float(np.median(foot[:, 2] if len(foot) else near[:, 2]))
            add_lost(
                signal.lost_enu_m, signal.lost_origin_enu_m, signal.lost_weight,
                ground_m, now_s, self._parameters.max_age_s, west, south, self.cell_m, table, self._pool,
            )  # fmt: skip
        self._n_updates += 1
        due, changed = self._n_updates % EVERY == 1, self._given_up
        self._given_up = []
        for part in _parts(low, high):
            far = due or self._is_outdated(self._box(*part, AROUND_M), now_s)
            changed += self._classify(self._box(*part, FAR_AROUND_M if far else AROUND_M), far, now_s)
        return changed

    def refused(
        self, west_m: float, south_m: float, cell_m: float, rows: int, cols: int
    ) -> NDArray[np.bool_] | None:
        """Return which cells of a raster are refused for their surface; None where none is."""
        row = np.floor((south_m + (np.arange(rows) + 0.5) * cell_m - self.south_m) / self.cell_m).astype(
            np.int64
        )
        col = np.floor((west_m + (np.arange(cols) + 0.5) * cell_m - self.west_m) / self.cell_m).astype(
            np.int64
        )
        box = Box(int(row[0]), int(row[-1]) + 1, int(col[0]), int(col[-1]) + 1)
        keys = [key for key in keys_over(box) if key in self._slot]
        if not any(self._n_refused[self._slot[key]] for key in keys):
            return None
        out = self._read(box).refused(self._parameters)
        return out[np.ix_(row - box.row0, col - box.col0)]

    def here(self, east_m: float, north_m: float, around_m: float) -> SurfaceHere:
        """Return what the ground within a distance of a place is, in a square."""
        row0, col0 = self._cell(east_m - around_m, north_m - around_m)
        row1, col1 = self._cell(east_m + around_m, north_m + around_m)
        return self._read(Box(row0, row1 + 1, col0, col1 + 1)).here()

    def _cell(self, east_m: float, north_m: float) -> tuple[int, int]:
        return (
            math.floor((north_m - self.south_m) / self.cell_m),
            math.floor((east_m - self.west_m) / self.cell_m),
        )

    # ---- tiles ----------------------------------------------------------------------------------

    def _table(self, corner: Key, hit: NDArray[np.bool_], now_s: float) -> NDArray[np.int32]:
        """Return the slots of a rectangle of tiles; those hit get one, the oldest others give theirs up."""
        table = np.full(hit.shape, -1, np.int32)
        wanted = {(corner[0] + int(r), corner[1] + int(c)) for r, c in np.argwhere(hit)}
        for key in sorted(wanted):
            if key not in self._slot:
                if not self._free and not self._evict(wanted):
                    continue
                self._slot[key] = self._free.pop()
            self._last_s[key] = now_s
        for r, c in np.ndindex(*hit.shape):
            table[r, c] = self._slot.get((corner[0] + r, corner[1] + c), -1)
        return table

    def _evict(self, kept: set[Key]) -> bool:
        old = min(
            (key for key in self._slot if key not in kept),
            key=lambda key: (self._last_s[key], key),
            default=None,
        )
        if old is None:
            return False
        slot = self._slot.pop(old)
        if self._n_refused[slot]:
            side = self.cell_m * TILE
            west, south = self.west_m + old[1] * side, self.south_m + old[0] * side
            self._given_up.append((west, south, west + side, south + side))
        self._pool[slot], self._layers[slot], self._n_refused[slot] = 0, 0, 0
        self._shape_s[slot] = -np.inf
        del self._last_s[old]
        self._free.append(slot)
        return True

    def _box(self, low: Points, high: Points, around_m: float) -> Box:
        """Return the cells of a rectangle and around it."""
        row0, col0 = self._cell(*(low - around_m).tolist())
        row1, col1 = self._cell(*(high + around_m).tolist())
        return Box(row0, row1 + 1, col0, col1 + 1)

    def _is_outdated(self, box: Box, now_s: float) -> bool:
        """Return whether a far look told a SHAPE in a box so long ago that it must be told anew."""
        told = self._read(box).values[SHAPE] != 0
        return bool((told & (self._shape(box, now_s) == 0)).any())

    def _classify(self, box: Box, far: bool, now_s: float) -> list[Edges]:
        """Classify a box of cells; return the edges of the tiles in which other cells are refused now."""
        fields = np.zeros((*box.shape, SURFACE_FIELDS), np.float32)
        parts = [(key, *_overlap(key, box)) for key in keys_over(box) if key in self._slot]
        for key, here, there in parts:
            fields[there] = self._pool[self._slot[key]][here]
        fields[now_s - fields[..., TIME] > self._parameters.max_age_s] = 0
        if not fields[..., COUNT].any():
            return []
        shape = None if far else self._shape(box, now_s)
        cells = SurfaceCells(np.ascontiguousarray(np.moveaxis(fields, 2, 0)), self.cell_m)
        self._sees_obliquely |= bool(fields[..., OBLIQUE].sum() > OBLIQUE_SHARE * fields[..., COUNT].sum())
        found = classify(cells, None, shape, self._sees_obliquely)
        if shape is not None:  # only a far look is remembered
            found.values[SHAPE] = shape
        changed = []
        side = self.cell_m * TILE
        for key, here, there in parts:
            slot = self._slot[key]
            layers = SurfaceLayers(self._layers[slot])
            before = layers.refused(self._parameters)
            layers.values[(slice(None), *here)] = found.values[(slice(None), *there)]
            if shape is None:
                self._shape_s[slot][here] = now_s
            after = layers.refused(self._parameters)
            self._n_refused[slot] = np.count_nonzero(after)
            if (before != after).any():
                row, col = np.nonzero(before != after)
                west, south = self.west_m + key[1] * side, self.south_m + key[0] * side
                changed.append(
                    (
                        west + int(col.min()) * self.cell_m,
                        south + int(row.min()) * self.cell_m,
                        west + (int(col.max()) + 1) * self.cell_m,
                        south + (int(row.max()) + 1) * self.cell_m,
                    )
                )
        return changed

    def _shape(self, box: Box, now_s: float) -> NDArray[np.float32]:
        """Return the SHAPE that a far look told not long ago, 0 elsewhere."""
        out = np.zeros(box.shape, np.float32)
        longest_s = min(SHAPE_S, self._parameters.max_age_s)
        for key in keys_over(box):
            if key in self._slot:
                slot, (here, there) = self._slot[key], _overlap(key, box)
                young = now_s - self._shape_s[slot][here] <= longest_s
                out[there] = np.where(young, self._layers[slot][(SHAPE, *here)], 0)
        return out

    def _read(self, box: Box) -> SurfaceLayers:
        out = np.zeros((N_LAYERS, *box.shape), np.float32)
        for key in keys_over(box):
            if key in self._slot:
                here, there = _overlap(key, box)
                out[(slice(None), *there)] = self._layers[self._slot[key]][(slice(None), *here)]
        return SurfaceLayers(out)


def within_edges(points: Points, edges: Edges) -> NDArray[np.bool_]:
    """Return which points are within west, south, east and north edges."""
    west_m, south_m, east_m, north_m = edges
    x, y = points[:, 0], points[:, 1]
    return np.asarray((x >= west_m) & (x < east_m) & (y >= south_m) & (y < north_m))


def _parts(low: Points, high: Points) -> Iterator[tuple[Points, Points]]:
    """Yield the corners of squares of at most `PART_M` that cover a rectangle."""
    rows, cols = (max(1, math.ceil((high[k] - low[k]) / PART_M)) for k in (1, 0))
    for row, col in itertools.product(range(rows), range(cols)):
        corner = low + np.array([col, row]) * PART_M
        yield corner, np.minimum(corner + PART_M, high)


def _overlap(key: Key, box: Box) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the common cells of a tile and a box, in the tile and in the box."""
    own = box_of_tile(key)
    part = common(own, box)
    return within(part, own), within(part, box)
