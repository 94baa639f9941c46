"""Air around the vehicle that raised returns occupy, and the floor below it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.air.seen_air import SeenAir
from slz.kernels.lines.candidates import renew
from slz.kernels.lines.voxel_occupancy import (
    AGREED_M,
    DIRECTIONS,
    DOWN,
    LEVELS,
    NOWHERE,
    RING_M,
    SIDE,
    VOXEL_M,
    add_returns,
    are_thin,
    around_curve,
    first_support,
    floor_below,
    vacate,
)
from slz.wires.detected_wire import SaggingCurve

EPOCH_S = 10.0
EPOCHS, KEPT = 250, 13  # after `EPOCHS` all is forgotten; `KEPT` are looked at
BELOW_SENSOR_M = 3.0  # from which a return may be ground that was not seen yet
UNDER_M, FEWEST_BELOW = (
    3.0,
    50,
)  # distance over ground from the sensor, and returns, that show the ground
FENCE_M = 2.5  # over the floor, or the ground below the sensor where no floor is known: lower is no wire
HIGH_SHARE = 0.8  # least share of the places of a curve that are high over the floor
LOOKED_AT = 0.1  # least share of the air below a curve
LEAST_OVER_M = 1.5  # of a wire over the ground, lower than which it is not followed

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Surrounding:
    """Numbers of voxels around a curve, (directions, rings): occupied, and high over the floor.

    seen_below: voxels below it that were looked at.
    """

    occupied: NDArray[np.int64]
    above: NDArray[np.int64]
    seen_below: int

    def is_high(self, places: int) -> bool:
        """Return whether a curve of this many places is high over the floor nearly everywhere."""
        return bool(self.above[3 * DIRECTIONS // 4, 0] >= HIGH_SHARE * places)

    @property
    def below_is_seen(self) -> bool:
        """True if the air below the curve was observed."""
        return bool(self.seen_below >= LOOKED_AT * self.above[slice(*DOWN)].sum())


def _ground_below_m(points_m: Floats, sensor_m: Floats) -> float:
    """Return the height of the ground right below the sensor, by its returns (n, 3); -inf where unknown.

    Returns of dust below the sensor are at many heights, those of ground at one.
    """
    way = points_m - sensor_m
    heights = points_m[(way[:, 2] < 0) & (np.hypot(way[:, 0], way[:, 1]) < UNDER_M), 2]
    if len(heights) < FEWEST_BELOW:
        return -np.inf
    low, middle = np.percentile(heights, (10, 50)).tolist()
    return float(low) if middle - low <= AGREED_M else -np.inf


class OccupiedAir:
    """Voxels of 0.5 m that hold returns, within 64 m, and a floor of cells of 2 m within 256 m: 8 MB.

    Parameters
    ----------
    rays
        Air that rays passed; None where no ray is known: then all air counts as looked at.
    """

    def __init__(self, rays: SeenAir | None = None) -> None:
        self._rays = rays
        self._lowest = np.full((SIDE, SIDE, 2), np.inf, np.float32)
        self._cell = np.full((SIDE, SIDE, 2), NOWHERE, np.int32)
        self._below = np.empty((SIDE, SIDE), np.float32)
        self._below_of, self._windows = np.zeros((SIDE, SIDE), np.int32), 0
        self._occupied = np.zeros((SIDE, SIDE, LEVELS), np.uint8)
        self._column = np.full((SIDE, SIDE, 2), NOWHERE, np.int32)
        self._started_s: float | None = None
        self._epoch = 1

    def add(self, points_m: Floats, rows: Rows, sensor_m: Floats, now_s: float) -> Rows:
        """Add some rows of a window's returns (n, 3); return those higher than a fence, or over no floor."""
        if self._started_s is None:
            self._started_s = now_s
        epoch = 1 + int((now_s - self._started_s) // EPOCH_S)
        if epoch > EPOCHS:
            self._started_s, epoch = now_s, 1
            self._occupied[:] = 0
        self._epoch = epoch
        east, north, up = sensor_m.tolist()
        floor_m = floor_below(east, north, self._lowest, self._cell)
        if not np.isfinite(floor_m):
            floor_m = _ground_below_m(points_m[rows], sensor_m)
        ceiling_m = max(up - BELOW_SENSOR_M, floor_m + FENCE_M)
        self._windows += 1
        air = self._occupied, self._column, self._lowest, self._cell
        scratch = self._windows, self._below, self._below_of
        return add_returns(points_m, rows, ceiling_m, FENCE_M, epoch, *air, *scratch)

    def is_thin(self, candidates: Floats) -> NDArray[np.bool_]:
        """Return which candidates are not part of a surface or a volume: the air beside them is free."""
        return are_thin(candidates, *self._epochs, self._occupied, self._column)

    def renew(self, stored: Floats, n: int, new: Floats, now_s: float, window: int) -> tuple[int, int]:
        """Renew stored candidates, see `slz.kernels.lines.candidates.renew`."""
        epoch, oldest = self._epochs
        air = self._occupied, self._column, self._lowest, self._cell
        return renew(stored, n, new, now_s, window, FENCE_M, epoch, oldest, *air)

    def around(self, curve: SaggingCurve, start_m: float, stop_m: float) -> Surrounding:
        """Return what is known of the air around a curve, from one place along it to another."""
        s = np.arange(start_m, stop_m + VOXEL_M / 2, VOXEL_M)
        place = (*self._epochs, self._occupied, self._column, self._lowest, self._cell)
        held, above = np.zeros((2, DIRECTIONS, len(RING_M)), np.int64)
        free = np.empty((len(s) * (DOWN[1] - DOWN[0]) * len(RING_M), 3))
        n = around_curve(s, curve.place_m, curve.along, curve.heights, held, above, free, *place)
        seen = n if self._rays is None else np.count_nonzero(self._rays.rays_through(free[:n]))
        return Surrounding(held, above, int(held[slice(*DOWN)].sum() + seen))

    def vacate(self, curve: SaggingCurve, start_m: float, stop_m: float) -> None:
        """Make the air at a known wire unoccupied, so that it hides no other wire."""
        s = np.arange(start_m, stop_m + VOXEL_M / 2, VOXEL_M)
        vacate(curve.points_enu_m(s), self._occupied, self._column)

    def support_m(self, curve: SaggingCurve, from_m: float, to_m: float) -> tuple[float, bool]:
        """Return how far to follow a curve from a place along it, and whether a support is there."""
        step = VOXEL_M if to_m > from_m else -VOXEL_M
        s = np.arange(from_m, to_m + step / 2, step)
        place = (*self._epochs, self._occupied, self._column, self._lowest, self._cell)
        found = first_support(curve.points_enu_m(s), *place, LEAST_OVER_M)
        if found < 0:
            return float(s[max(0, -1 - found - 1)]), False
        return (float(s[found]), True) if found < len(s) else (to_m, False)

    @property
    def _epochs(self) -> tuple[int, int]:
        return self._epoch, max(1, self._epoch - KEPT)
