"""Surface map of a flight: evidence of surface cells in tiles, and what it says the ground is."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Edges
from slz.kernels.cells.cell_record import TILE
from slz.kernels.surface.add_returns import add_lost, add_returns
from slz.kernels.surface.surface_pool import claim, gather, median_height, read, read_refused, store
from slz.kernels.surface.surface_record import LAYERS, N_LAYERS, RECORD, SURFACE_FIELDS
from slz.surface.classification import SurfaceLayers, classify, refused_kinds
from slz.surface.surface_kinds import SurfaceHere

Points = NDArray[np.float64]
CELL_M = 1.0  # least side of a surface cell
AROUND_M = 16.0  # beyond the returns of a window, within which cells are classified with them
EVERY, FAR_AROUND_M = 4, 60.0  # updates, after which shores farther off are looked for
SHAPE_HOLD_S = 60.0  # time for which their evidence is kept
PART_M = 1024.0  # side of a square that is classified at a time
SHARE = 1 / 20  # of the memory for evidence
TILE_BYTES = TILE * TILE * 4 * RECORD
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
    """Surface classes in cells of about a metre that near cells divide evenly.

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
        self._pool = np.zeros((capacity, TILE, TILE, RECORD), np.float32)
        self._tiles = np.tile([0.0, 0.0, -np.inf, 0.0], (capacity, 1))
        self._n_updates = 0
        self._sees_obliquely = False
        self._place = west_m, south_m, self.cell_m
        self._refusal = parameters.water_suspicion, refused_kinds(parameters)

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
        hull, table, row, col, given_up = claim(
            points, is_near, grid_edges, self._place, now_s, self._tiles, self._pool
        )
        if not len(table):
            return []
        side, p = self.cell_m * TILE, self._parameters
        west, south = self.west_m + col * side, self.south_m + row * side
        add_returns(
            points, signal.origin, signal.origins_enu_m, is_near, signal.intensity, signal.echoes, now_s,
            p.max_age_s, west, south, self.cell_m, table, self._pool,
        )  # fmt: skip
        east, north, _ = sensor.tolist()
        if len(signal.lost_enu_m) and math.isfinite(east):
            ground_m = median_height(points, is_near, grid_edges, east, north, FOOT_M)
            add_lost(
                signal.lost_enu_m, signal.lost_origin_enu_m, signal.lost_weight, ground_m, now_s,
                p.max_age_s, west, south, self.cell_m, table, self._pool,
            )  # fmt: skip
        self._n_updates += 1
        changed = given_up.tolist()
        for part in _parts(*hull.tolist()):
            changed += self._classify(part, self._n_updates % EVERY == 1, now_s)
        return [(west, south, east, north) for west, south, east, north in changed]

    def _classify(self, part: Edges, far: bool, now_s: float) -> list[list[float]]:
        """Classify the cells in and around a part; return the edges of what is refused now or was before."""
        row, col, rows, cols = self._box(part, FAR_AROUND_M if far else AROUND_M)
        box, p = np.empty((SURFACE_FIELDS + 2, rows, cols), np.float32), self._parameters
        any_seen, obliquely, is_outdated = gather(
            self._tiles, self._pool, row, col, now_s, p.max_age_s, min(SHAPE_HOLD_S, p.max_age_s), box
        )
        if is_outdated and not far:  # a far look found the shores so long ago that it must be taken anew
            return self._classify(part, True, now_s)
        if not any_seen:
            return []
        self._sees_obliquely |= obliquely
        fields, shape = box[:SURFACE_FIELDS], None if far else box[SURFACE_FIELDS]
        found = classify(fields, self.cell_m, None, shape, self._sees_obliquely).values
        where = self._tiles, self._pool, row, col, self._place
        return list(store(*where, *self._refusal, now_s, far, found).tolist())

    def refused(
        self, west_m: float, south_m: float, cell_m: float, rows: int, cols: int
    ) -> NDArray[np.bool_] | None:
        """Return which cells of a raster are refused for their surface; None where none is."""
        out = np.empty((rows, cols), np.bool_)
        where = self._tiles, self._pool, self._place, *self._refusal
        any_refused = read_refused(*where, (west_m, south_m), cell_m, out)
        return out if any_refused else None

    def here(self, east_m: float, north_m: float, around_m: float) -> SurfaceHere:
        """Return what the ground within a distance of a place is, in a square."""
        row, col, rows, cols = self._box((east_m, north_m, east_m, north_m), around_m)
        out = np.empty((N_LAYERS, rows, cols), np.float32)
        read(self._tiles, self._pool, row, col, LAYERS, out)
        return _here(out.tobytes(), rows)

    def _box(self, part: Edges, around_m: float) -> tuple[int, int, int, int]:
        """Return first row and column of the cells in and around a part, and the number of both."""
        west, south, east, north = part
        row = math.floor((south - around_m - self.south_m) / self.cell_m)
        col = math.floor((west - around_m - self.west_m) / self.cell_m)
        last_row = math.floor((north + around_m - self.south_m) / self.cell_m)
        last_col = math.floor((east + around_m - self.west_m) / self.cell_m)
        return row, col, last_row - row + 1, last_col - col + 1


@functools.lru_cache(256)
def _here(values: bytes, rows: int) -> SurfaceHere:
    """Return `SurfaceLayers.here` of the bytes of its values: mostly those of the last window."""
    return SurfaceLayers(np.frombuffer(values, np.float32).reshape(N_LAYERS, rows, -1)).here()


def _parts(west: float, south: float, east: float, north: float) -> Iterator[Edges]:
    """Yield the edges of squares of at most `PART_M` that cover a rectangle."""
    for row in range(max(1, math.ceil((north - south) / PART_M))):
        for col in range(max(1, math.ceil((east - west) / PART_M))):
            x, y = west + col * PART_M, south + row * PART_M
            yield x, y, min(x + PART_M, east), min(y + PART_M, north)
