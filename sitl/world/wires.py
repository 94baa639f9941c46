"""Thin wires of a world, with the grid in which beams look for them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import REFLECTANCE, Solid, Wire
from sitl.world.tables import WireTable
from sitl.world.wire_cast import MARGIN_M, SLOTS, cast_wires

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

THIN_M = 0.015
"""Greatest radius of a wire that beams see by its share of their footprint; thicker ones are solids."""
CELL_M = 4.0


@dataclass(frozen=True, slots=True)
class Beam:
    """Width of a beam, level and upward in the sensor's frame, in full at half maximum.

    exit_m: at the sensor. divergence_rad: growth per range.
    """

    exit_m: tuple[float, float]
    divergence_rad: tuple[float, float]

    def width_m(self, range_m: float) -> tuple[float, float]:
        """Return the widths at a range."""
        level, upward = (e + d * range_m for e, d in zip(self.exit_m, self.divergence_rad, strict=True))
        return level, upward


@dataclass(frozen=True, slots=True)
class WireEchoes:
    """Echoes of beams from wires, (n, `SLOTS`).

    range_m: NaN for none. share: of the beam that the wire covers. bright: reflectance times cosine times the
    share that nearer wires leave of it. index: number of the solid, -2 for none.
    """

    range_m: F64
    share: F64
    bright: F64
    index: I64

    def of(self, beams: NDArray[np.bool_]) -> WireEchoes:
        """Return the echoes of some of the beams."""
        return WireEchoes(self.range_m[beams], self.share[beams], self.bright[beams], self.index[beams])

    @property
    def through(self) -> F64:
        """Share of each beam that passes all wires, (n,)."""
        passed: F64 = np.clip(1.0 - self.share.sum(axis=1), 0.0, 1.0)
        return passed


class Wires:
    """The wires among solids that are no thicker than `THIN_M`; it is false if there are none."""

    def __init__(self, solids: Sequence[Solid]) -> None:
        found = [(k, s) for k, s in enumerate(solids) if isinstance(s, Wire) and s.radius_m <= THIN_M]
        self._table = _table(found) if found else None

    def __bool__(self) -> bool:
        return self._table is not None

    def echoes(
        self, origins: F64, directions: F64, ups: F64, ends_m: F64, limit_m: float, beam: Beam
    ) -> WireEchoes:
        """Return the echoes of beams before the opaque surfaces at `ends_m`; see `cast_wires`."""
        shape = (len(origins), SLOTS)
        share, bright = np.zeros(shape), np.zeros(shape)
        range_m, index = np.full(shape, np.nan), np.full(shape, -2, np.int64)
        if self._table is not None:
            rays = [np.ascontiguousarray(a, np.float64) for a in (origins, directions, ups)]
            ends, limit = np.ascontiguousarray(ends_m, np.float64), float(limit_m)
            widths = np.array([*beam.exit_m, *beam.divergence_rad])
            found = (range_m, share, bright, index)
            cast_wires(self._table, rays[0], rays[1], rays[2], ends, limit, widths, np.empty(SLOTS), *found)
        return WireEchoes(range_m, share, bright, index)


def _table(wires: Sequence[tuple[int, Wire]]) -> WireTable:
    rows = np.array(
        [(*w.start_enu_m, *w.end_enu_m, w.radius_m, REFLECTANCE[w.kind]) for _, w in wires], np.float64
    )
    bounds = np.array([w.bounds() for _, w in wires])
    # A footprint reaches MARGIN_M aside of its axis, also beyond the ends of a piece.
    reach = 1.5 * MARGIN_M
    lower, upper = bounds[:, :3] - reach, bounds[:, 3:] + reach
    x0, y0, z0 = lower.min(axis=0)
    x1, y1, z1 = upper.max(axis=0)
    columns, lines = math.ceil((x1 - x0) / CELL_M), math.ceil((y1 - y0) / CELL_M)
    low, top = np.full((lines, columns), math.inf), np.full((lines, columns), -math.inf)
    listed: list[list[int]] = [[] for _ in range(lines * columns)]
    first = ((lower[:, :2] - (x0, y0)) // CELL_M).astype(int)
    last = np.minimum(((upper[:, :2] - (x0, y0)) // CELL_M).astype(int), (columns - 1, lines - 1))
    for k in range(len(rows)):
        for j in range(first[k, 1], last[k, 1] + 1):
            for i in range(first[k, 0], last[k, 0] + 1):
                listed[j * columns + i].append(k)
                low[j, i], top[j, i] = min(low[j, i], lower[k, 2]), max(top[j, i], upper[k, 2])
    start = np.zeros(lines * columns + 1, np.int32)
    start[1:] = np.cumsum([len(items) for items in listed])
    items = np.array([item for cell in listed for item in cell], np.int32)
    numbers = np.array([k for k, _ in wires], np.int64)
    return rows, numbers, np.array([CELL_M, x0, y0, z0, z1]), low, top, start, items
