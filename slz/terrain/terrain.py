"""Terrain from per-cell evidence: the default, safer terrain model.

It differs from the sources where they are unsafe. Steep ground is written as evidence. A cell keeps count,
mean, expected noise and its two lowest and highest returns, so a pole inside a cell does not vanish in a
mean. Slope and relief come from a plane fitted over the vehicle's footprint. Everything seen is kept for at
least `hold_s` of newer observations. Ground not seen for `max_age_s` and ground never seen are unknown, and
unknown is not safe.

A cell is *safe* when the footprint centred on it is on seen ground, its plane slopes less than the limit with
2.5 standard errors added, nothing in it rises or falls by the relief limit, and the landing gear stands
there at some heading.

Evidence is kept at the finest cells. The maps may be derived at any level of a pyramid: cells of level k are
2^k times as wide, and their evidence is that of all their returns.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Edges, Grid
from slz.kernels.cells.cell_record import TILE
from slz.kernels.cells.cell_statistics import raise_tops, summary
from slz.kernels.cells.tile_boxes import blocks_around, or_boxes, or_hits, or_points, regions
from slz.kernels.footprint.patch import rows_of_patch
from slz.kernels.points.clutter import put_onto
from slz.kernels.raster.bitmap import ALL, Bits
from slz.kernels.raster.horizon import horizon_of_tiles
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere
from slz.terrain.arrivals import Arrivals
from slz.terrain.derive import CoveredCells, reach_of
from slz.terrain.footing import Footing, footing, footing_edge
from slz.terrain.layers import LAYERS, NAMED
from slz.terrain.terrain_maps import SAFE
from slz.terrain.terrain_view import UnboundedTerrain, cells_within
from slz.terrain.thin_objects import ThinObjects
from slz.terrain.tiled_raster import Pools, TiledLayers
from slz.terrain.tiles import SERIALS, Boxes, Change, Hits, Noise, Tiles, no_boxes
from slz.tile_slots import Key, boxes_of_tiles

AGEING = 0.1  # share of `max_age_s` for which a cell that became too old may still be shown
PATIENCE = 0.7  # share of that time before which no tile is derived again for its age
MORE = 4  # tiles prefaulted beyond those expected
DERIVED_BLOCK = 512  # cells along the side of a box that is derived at a time
MIB = 2.0**20
MOST_FOOTINGS = 256
BLOCK = 16  # cells along the side of what is derived again for a thin object
State = NDArray[np.uint8]


class Surface(Protocol):
    """Surface classes, and the cells that they refuse whatever their shape."""

    def refused(
        self, west_m: float, south_m: float, cell_m: float, rows: int, cols: int
    ) -> NDArray[np.bool_] | None:
        """Return which cells of a raster from a corner on are refused; None where none is."""

    def here(self, east_m: float, north_m: float, around_m: float) -> SurfaceHere:
        """Return what the ground within a distance of a place is."""


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """Finest cells whose evidence changed.

    hit, hits: boxes and bits of a `Change`. points_enu_m: (n, 3) each, places where an object drawn over the
    evidence has appeared or gone. altered: (n, 4) as `hit`, boxes within which anything may have changed.
    """

    hit: Boxes = field(default_factory=no_boxes)
    hits: Sequence[Hits] = ()
    points_enu_m: Sequence[NDArray[np.float64]] = ()
    altered: Boxes = field(default_factory=no_boxes)


@dataclass(frozen=True, slots=True)
class Tally:
    """Numbers of cells of the last window: hit by returns, derived, and with another state than before."""

    hit: int = 0
    derived: int = 0
    changed: int = 0

    def plus(self, hit: int = 0, derived: int = 0, changed: int = 0) -> Tally:
        """Return the numbers with more cells."""
        return Tally(self.hit + hit, self.derived + derived, self.changed + changed)


class EvidenceTerrain(UnboundedTerrain):
    """A window of the evidence, and the maps derived from it at one level of the pyramid.

    Parameters
    ----------
    grid
        The window, in cells of the level.
    tiles
        Evidence to use; by default new, with the south-west corner of the grid as its origin.
    level
        Level of the pyramid.

    Notes
    -----
    serial: number of the maps; it changes when all tiles must be read again. changed_tiles: tiles
    derived or dropped since the set was last emptied. surface: what refuses ground for its surface, None for
    nothing. arrivals: what has come to stand on the ground, drawn over the evidence, None for nothing.
    wires_m: (n, 3) points along wires, in stored heights, which are tops of the ground below.
    """

    def __init__(
        self, grid: Grid, parameters: Parameters, tiles: Tiles | None = None, level: int = 0
    ) -> None:
        if tiles is None:
            tiles = Tiles(grid.west_m, grid.south_m, grid.cell_m, parameters.memory_mb * MIB)
        self.tiles = tiles
        self.level = level
        self.grid = grid
        self.pinned: frozenset[Key] = frozenset()
        self.noise = Noise(parameters.range_noise_m, math.radians(parameters.angle_noise_deg))
        self._parameters = parameters
        self._maps = TiledLayers([layer.empty for layer in LAYERS], 2 * self.tiles.capacity >> 2 * level)
        self.serial = next(SERIALS)
        self.changed_tiles: set[Key] = set()
        self._seen = Box(0, 0, 0, 0)
        self._aged_s = 0.0
        self._tally = Tally()
        self._n_tiles, self._new = 0, [0]
        self._thin = ThinObjects()
        self.surface: Surface | None = None
        self.arrivals: Arrivals | None = None
        self.wires_m = np.empty((0, 3))
        self._footings: dict[Box, tuple[bytes, Footing]] = {}  # by digest of the cells; used last at the end
        self._reach = reach_of(parameters, grid.cell_m)
        self.radius, self._margin = self._reach.radius, self._reach.margin
        self._footing_edge = footing_edge(self.radius, grid.cell_m, parameters)

    # ---- boxes: in the window, and in all ground (counted from the tiles' corner) ---------------

    @property
    def _corner(self) -> tuple[int, int]:
        west, south, cell = self.tiles.west_m, self.tiles.south_m, self.grid.cell_m
        return round((self.grid.south_m - south) / cell), round((self.grid.west_m - west) / cell)

    def _everywhere(self, box: Box) -> Box:
        row, col = self._corner
        return Box(box.row0 + row, box.row1 + row, box.col0 + col, box.col1 + col)

    @property
    def seen(self) -> Box:
        """Box in the window of all ground derived."""
        row, col = self._corner
        s = self._seen
        box = Box(
            max(0, s.row0 - row),
            min(self.grid.rows, s.row1 - row),
            max(0, s.col0 - col),
            min(self.grid.cols, s.col1 - col),
        )
        return Box(0, 0, 0, 0) if box.empty else box

    @property
    def tally(self) -> Tally:
        """Numbers of cells of the last window."""
        return self._tally

    # ---- evidence in ----------------------------------------------------------------------------

    def add(
        self,
        points_enu_m: NDArray[np.float64],
        sensor_enu_m: NDArray[np.float64],
        stamp_s: float,
        isolated_enu_m: NDArray[np.float64] | None = None,
        reach_m: float = math.inf,
        altered_m: Iterable[Edges] = (),
    ) -> Change:
        """Add one window of points, in stored heights (over `tiles.datum_m`), and derive the changed maps.

        Points outside the window's grid are skipped. When the budget of tiles is used, the ground not
        seen for longest is evicted; where none can be, points are dropped and counted. Isolated returns are
        judged together with those of earlier windows, see `slz.terrain.thin_objects`; those beyond
        `reach_m` from the sensor are never ground. Within the edges of `altered_m` (west, south, east,
        north) the surface refuses other cells than before.
        """
        now_s = self.tiles.now_s(stamp_s)
        self._tally = Tally()
        change = self._accumulate(points_enu_m, sensor_enu_m)
        points: list[NDArray[np.float64]] = []
        if isolated_enu_m is not None:
            ground = self._thin.update(
                isolated_enu_m,
                sensor_enu_m,
                len(points_enu_m) + len(isolated_enu_m),
                self.tiles,
                self._parameters.max_age_s,
                reach_m,
            )
            if len(ground):
                change = change.together_with(self._accumulate(ground, sensor_enu_m))
            points.append(np.ascontiguousarray(self._thin.altered_enu_m))
        if self.arrivals is not None:
            points.append(np.ascontiguousarray(self.arrivals.altered_enu_m))
        edges = [self._box_within(*edges) for edges in altered_m]
        altered = np.concatenate([np.array(edges, np.int64).reshape(-1, 4), boxes_of_tiles(change.evicted)])
        self._derive_all(Changes(change.boxes, change.hits, points, altered))
        for key in self._aged(now_s):
            self._derive_all(Changes(altered=boxes_of_tiles([key])))
        if change.evicted:
            self.changed_tiles.update(self._maps.keep(lambda key: self.tiles.any_near(key, self.level)))
            if len(self.changed_tiles) > 2 * self.tiles.capacity:  # no reader
                self.serial, self.changed_tiles = next(SERIALS), set(self._maps.keys())
        return change

    def _accumulate(self, points_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64]) -> Change:
        p, now_s = self._parameters, self.tiles.latest_s
        change = self.tiles.add(
            points_enu_m,
            sensor_enu_m,
            self.noise,
            _scaled(self._everywhere(self.grid.everything), self.level),
            now_s,
            p.hold_s,
            self.pinned,
            p.max_age_s,
        )
        n_hit = sum(int(np.bitwise_count(words).sum()) for _, words in change.hits)
        self._tally = self._tally.plus(hit=n_hit)
        if len(change.boxes):
            row0, _, col0, _ = change.boxes.min(axis=0).tolist()
            _, row1, _, col1 = change.boxes.max(axis=0).tolist()
            self._seen = self._seen.union(_widened(Box(row0, row1, col0, col1), self.level, 0))
        return change

    def _box_within(self, west_m: float, south_m: float, east_m: float, north_m: float) -> Sequence[int]:
        """Return row0, row1, col0, col1 of the finest cells that a rectangle touches."""
        west, south, cell_m = self.tiles.west_m, self.tiles.south_m, self.tiles.cell_m
        row0, row1 = math.floor((south_m - south) / cell_m), math.floor((north_m - south) / cell_m) + 1
        return row0, row1, math.floor((west_m - west) / cell_m), math.floor((east_m - west) / cell_m) + 1

    def _aged(self, now_s: float) -> list[Key]:
        """Return the tiles to derive again as a whole because some of their cells became too old.

        Other tiles would not change. Tiles whose oldest cell has been too old for `PATIENCE` of the time that
        a map may show it are spread over the windows, the oldest first, at a rate that all are derived before
        the rest of that time is over.
        """
        too_old_s = (1 - AGEING) * self._parameters.max_age_s
        longest_s = AGEING * self._parameters.max_age_s
        share = min(1.0, (now_s - self._aged_s) / ((1 - PATIENCE) * longest_s))
        self._aged_s = now_s
        late = self.tiles.overdue(too_old_s)
        old = [(late_s, key) for late_s, key in late if late_s > PATIENCE * longest_s]
        some = math.ceil(share * len(self.tiles))
        due = [key for i, (late_s, key) in enumerate(old) if i < some or late_s > longest_s]
        for key in due:
            self.tiles.look_for_oldest(key, now_s - too_old_s)
        return due

    def pin(self, enu_m: NDArray[np.float64] | None, around_m: float = 0.0) -> None:
        """Pin the tiles around a point, and all tiles that its state depends on; the budget evicts none."""
        if enu_m is None:
            self.pinned = frozenset()
            return
        fine_m = self.tiles.cell_m
        cells = max(self._margin, self._footing_edge)
        reach = cells * 2**self.level + math.ceil(around_m / fine_m) + 1
        row = math.floor((enu_m[1] - self.tiles.south_m) / fine_m)
        col = math.floor((enu_m[0] - self.tiles.west_m) / fine_m)
        near = Box(row - reach, row + reach + 1, col - reach, col + reach + 1)
        self.pinned = frozenset(self.tiles.keys_over(near))

    def prepare(self) -> None:
        """Prefault memory for as many new tiles as either of the last two windows needed, and `MORE`.

        The first window is ignored, because all its tiles are new.
        """
        n_tiles = len(self._maps)
        self._new = [*self._new[-1:], max(0, n_tiles - self._n_tiles) if self._n_tiles else 0]
        self._n_tiles = n_tiles
        count = max(self._new) + MORE
        self.tiles.prepare(min(count, self.tiles.n_free))
        self._maps.prepare(count)

    # ---- maps out -------------------------------------------------------------------------------

    def _derive_all(self, changes: Changes) -> None:
        """Derive all maps that depend on changed finest cells."""
        tiles, margin, rows = self.tiles, self._margin, rows_of_patch(self.radius)
        place = tiles.west_m, tiles.south_m, tiles.cell_m
        around = [blocks_around(points, *place, BLOCK) for points in changes.points_enu_m if len(points)]
        boxes = np.concatenate([changes.hit, changes.altered, *around])
        for region in regions(boxes, self.level, margin, rows, DERIVED_BLOCK).tolist():
            self._derive(Box(*region), changes)

    def _cells(self, box: Box) -> NDArray[np.float32]:
        max_age_s = (1 - AGEING) * self._parameters.max_age_s  # so that no cell is shown beyond `max_age_s`
        if self.level == 0:
            cells = self.tiles.summary(box, max_age_s)
        else:
            cells = summary(self.tiles.read(box, self.level, max_age_s), self.tiles.latest_s, max_age_s)
        cell_m = self.grid.cell_m
        west_m, south_m = self.tiles.west_m + box.col0 * cell_m, self.tiles.south_m + box.row0 * cell_m
        if len(self._thin.found_enu_m):
            put_onto(self._thin.found_enu_m, west_m, south_m, cell_m, cells)
        if self.arrivals is not None and len(self.arrivals.points_enu_m):
            put_onto(self.arrivals.points_enu_m, west_m, south_m, cell_m, cells)
        if len(self.wires_m):
            raise_tops(self.wires_m, west_m, south_m, cell_m, self._reach.gap, cells)
        return cells

    def _derive(self, box: Box, changes: Changes) -> None:
        """Derive the maps of a box where the evidence of the box and its surroundings changed."""
        m = self._margin
        around = Box(box.row0 - m, box.row1 + m, box.col0 - m, box.col1 + m)
        cells = self._cells(around)
        refused = None
        if self.surface is not None:
            cell_m, (rows, cols) = self.grid.cell_m, cells.shape[1:]
            west_m, south_m = (
                self.tiles.west_m + (box.col0 - m) * cell_m,
                self.tiles.south_m + (box.row0 - m) * cell_m,
            )
            refused = self.surface.refused(west_m, south_m, cell_m, rows, cols)
        seen = CoveredCells.of(cells, self._reach, self.grid.cell_m, self._parameters, refused)
        keys, n, n_changed = self._maps.derive(box, seen, self._changed(around, changes))
        self.changed_tiles.update(keys)
        self._tally = self._tally.plus(derived=n, changed=n_changed)

    def _changed(self, around: Box, changes: Changes) -> Bits:
        """Return the cells of a box whose statistics may have changed.

        In coarser cells one of several finest cells may have aged unnoticed, so that all count as changed.
        """
        if self.level:
            return np.full((around.shape[0], (around.shape[1] + 63) >> 6), ALL)
        out = np.zeros((around.shape[0], (around.shape[1] + 63) >> 6), np.uint64)
        corner = around.row0, around.col0
        for tile, words in changes.hits:
            or_hits(words, *tile, *corner, out)
        for points in changes.points_enu_m:
            or_points(points, self.tiles.west_m, self.tiles.south_m, self.tiles.cell_m, *corner, out)
        or_boxes(changes.altered, self._margin, *corner, out)
        return out

    def moved(self, grid: Grid) -> EvidenceTerrain:
        """Return another window onto the same evidence (new zone of SLZ paper, section 3.2.5)."""
        new = copy.copy(self)
        new.grid = grid
        return new

    def at_level(self, level: int) -> EvidenceTerrain:
        """Return a window of the zone's size about the middle of this one, at another level."""
        whole = _scaled(self._everywhere(self.grid.everything), self.level)
        cell_m = self.tiles.cell_m * 2**level
        side = -(-max(3, round(self._parameters.zone_m / self.tiles.cell_m)) >> level)
        row0 = (((whole.row0 + whole.row1) >> 1) - (side << level >> 1)) >> level
        col0 = (((whole.col0 + whole.col1) >> 1) - (side << level >> 1)) >> level
        west_m, south_m = self.tiles.west_m + col0 * cell_m, self.tiles.south_m + row0 * cell_m
        new = EvidenceTerrain(Grid(west_m, south_m, cell_m, side, side), self._parameters, self.tiles, level)
        new.pinned, new._aged_s, new._thin = self.pinned, self._aged_s, self._thin
        new.surface, new.arrivals, new.wires_m = self.surface, self.arrivals, self.wires_m
        new._seen = _widened(_scaled(self._seen, self.level), level, 0)
        new._derive_all(Changes(altered=self.tiles.boxes))
        return new

    def maps_at_level(self, level: int) -> EvidenceTerrain:
        """Return the maps at a level of the pyramid: these, where it is theirs."""
        return self if level == self.level else self.at_level(level)

    def safe_bits(self, box: Box) -> tuple[Bits, int, int]:
        """Return the bitmap of the safe cells of a non-empty box, and row and column of its first bit.

        A margin around the box is clear. Words are rows of tiles, so that a word covers the same cells for
        every box.
        """
        there = self._everywhere(box)
        col0, col1 = (there.col0 - 1) // TILE * TILE, -(-(there.col1 + 1) // TILE) * TILE
        bits = self._maps.bits(Box(there.row0 - 1, there.row1 + 1, col0, col1), SAFE)
        bits[0] = bits[-1] = 0
        west, east = there.col0 - col0, col1 - there.col1
        bits[:, 0] &= np.uint64((1 << TILE) - (1 << west))
        bits[:, -1] &= np.uint64((1 << TILE - east) - 1)
        row, col = self._corner
        return bits, there.row0 - 1 - row, col0 - col

    def state(self, box: Box) -> NDArray[np.uint8]:
        """Return 0 unsafe, 1 safe, 255 unknown for a box; no footprint with unseen ground is safe."""
        return self._maps.states(self._everywhere(box))

    def footing_at(self, enu_m: NDArray[np.float64], error_m: float) -> Footing:
        """Return the footing at a point (3,) that may be missed by an error.

        It is computed again only where the cells that it depends on have changed.
        """
        box, cell_m, p = cells_within(self.grid, enu_m, error_m), self.grid.cell_m, self._parameters
        there, k = self._everywhere(box), self._footing_edge
        cells = self._cells(Box(there.row0 - k, there.row1 + k, there.col0 - k, there.col1 + k))
        before, digest = self._footings.pop(there, None), blake2b(cells.tobytes(), digest_size=16).digest()
        if before is None or before[0] != digest:
            before = digest, footing(cells, *box.shape, self.radius, cell_m, p)
        self._footings[there] = before
        if len(self._footings) > MOST_FOOTINGS:
            del self._footings[next(iter(self._footings))]
        return before[1]

    def horizon(
        self,
        enu_m: NDArray[np.float64],
        box: Box,
        near_m: float,
        far_m: float,
        sectors: int,
        towards: tuple[float, float],
    ) -> float:
        """Return the elevation angle (rad) of the horizon in a direction, of the cells of a box."""
        grid, there = self.grid, self._everywhere(box)
        row = (enu_m[1] - grid.south_m) / grid.cell_m - 0.5 - box.row0
        col = (enu_m[0] - grid.west_m) / grid.cell_m - 0.5 - box.col0
        cells = there.row0, there.row1, there.col0, there.col1
        place = row, col, float(enu_m[2]), grid.cell_m
        view = *self._maps.view, self.tiles.datum_m
        return horizon_of_tiles(*view, cells, *place, near_m, far_m, sectors, *towards)

    def surface_at(self, enu_m: NDArray[np.float64], around_m: float) -> SurfaceHere:
        """Return what the ground within a distance of a point (3,) is."""
        if self.surface is None:
            return UNKNOWN_SURFACE
        return self.surface.here(float(enu_m[0]), float(enu_m[1]), around_m)

    def tiles_within(self, box: Box) -> tuple[Box, NDArray[np.int32], NDArray[np.int64], Pools]:
        """Return a box in the tiling's rows and columns, and `TiledLayers.within` of it."""
        there = self._everywhere(box)
        return there, *self._maps.within(there)

    # ---- changes since the last read -------------------------------------------------------------

    @property
    def corner_m(self) -> tuple[float, float]:
        """West and south edge of tile (0, 0)."""
        return self.tiles.west_m, self.tiles.south_m

    def mark_all_changed(self) -> None:
        """Mark every tile as changed."""
        self.changed_tiles.update(self._maps.keys())

    def tile(self, key: Key, names: Sequence[str]) -> tuple[list[NDArray[np.float32]], State] | None:
        """Return copies of some of `LAYERS` of a tile, and its state; None where nothing is derived."""
        held = self._maps.tile(key)
        if held is None:
            return None
        maps, states = held
        datum_m = np.float32(self.tiles.datum_m)
        wanted = [NAMED[name] for name in names]
        layers = [maps[layer.at] + (datum_m if layer.is_height else 0) for layer in wanted]
        return layers, states[0].copy()

    def layer(self, name: str, box: Box) -> NDArray[np.float32]:
        """Return a copy of one of `LAYERS` over a box, NaN where unknown.

        The relief is also NaN where the slope alone makes the cell unsafe; the certainty is 0 where unknown.
        """
        values = self._maps.read(self._everywhere(box), NAMED[name].at)

        if NAMED[name].is_height:
            values += np.float32(self.tiles.datum_m)
        return values


def _scaled(box: Box, level: int) -> Box:
    """Return a box of cells of a level in finest cells."""
    return Box(box.row0 << level, box.row1 << level, box.col0 << level, box.col1 << level)


def _widened(fine: Box, level: int, margin: int) -> Box:
    """Return the cells of a level that a box of finest cells touches, with a margin."""
    if fine.empty:
        return fine
    return Box(
        (fine.row0 >> level) - margin,
        ((fine.row1 - 1) >> level) + 1 + margin,
        (fine.col0 >> level) - margin,
        ((fine.col1 - 1) >> level) + 1 + margin,
    )
