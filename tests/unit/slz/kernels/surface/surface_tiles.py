"""Tiles of surface cells for the kernels that fill them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slz.kernels.cells.cell_record import TILE
from slz.kernels.surface.add_returns import add_lost, add_returns
from slz.kernels.surface.surface_record import RECORD

Floats = NDArray[np.float64]
FOREVER_S = 1e6


@dataclass
class Tiles:
    """Two tiles side by side, of which the first of the table's three places has none."""

    west_m: float = -130.0
    south_m: float = 20.0
    cell_m: float = 1.0
    table: NDArray[np.int32] = field(default_factory=lambda: np.array([[-1, 1, 0]], np.int32))
    pool: NDArray[np.float32] = field(default_factory=lambda: np.zeros((2, TILE, TILE, RECORD), np.float32))

    def cell(self, east_m: float, north_m: float) -> NDArray[np.float32]:
        """Return the record of the cell at a place."""
        row, col = int((north_m - self.south_m) // self.cell_m), int((east_m - self.west_m) // self.cell_m)
        slot = self.table[row // TILE, col // TILE]
        assert slot >= 0
        record: NDArray[np.float32] = self.pool[slot, row % TILE, col % TILE]
        return record

    def add(
        self,
        points: Floats,
        sensor: Floats | None = None,
        near: NDArray[np.bool_] | None = None,
        intensity: Floats | None = None,
        echoes: NDArray[np.integer] | None = None,
        now_s: float = 0.0,
        max_age_s: float = FOREVER_S,
    ) -> None:
        """Add returns, by default all near and without anything else known."""
        n, known = len(points), sensor is not None
        add_returns(
            np.ascontiguousarray(points, np.float64),
            np.zeros(n if known else 0, np.uint16),
            np.zeros((0, 3)) if sensor is None else np.asarray(sensor, np.float64)[np.newaxis],
            np.ones(n, np.bool_) if near is None else near,
            np.empty(0, np.float32) if intensity is None else np.asarray(intensity, np.float32),
            np.empty(0, np.uint8) if echoes is None else np.asarray(echoes, np.uint8),
            now_s, max_age_s, self.west_m, self.south_m, self.cell_m, self.table, self.pool,
        )  # fmt: skip

    def lose(
        self, rays: Floats, sensor: Floats, weight: float = 1.0, ground_m: float = 0.0, now_s: float = 0.0
    ) -> int:
        """Add rays without a return, each through a point; return how many counted."""
        n = len(rays)
        return add_lost(
            np.ascontiguousarray(rays, np.float64),
            np.tile(np.asarray(sensor, np.float64), (n, 1)),
            np.full(n, weight, np.float32),
            ground_m, now_s, FOREVER_S, self.west_m, self.south_m, self.cell_m, self.table, self.pool,
        )  # fmt: skip


def seen_from(sensor: Floats, degrees: float, range_m: float, azimuth_deg: float = 0.0) -> Floats:
    """Return the point (3,) at a range and an angle off nadir."""
    tilt, turn = np.radians(degrees), np.radians(azimuth_deg)
    off = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
    return np.asarray(sensor + range_m * off)
