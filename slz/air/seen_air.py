"""Seen air: where rays of the LiDAR passed, and met nothing. Air never seen is not clear."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.air.seen_columns import (
    LEVELS,
    NOWHERE,
    SIDE,
    follow_rays,
    rays_through,
    unseen_slopes,
)

MOST_RAYS = 4000  # of a window that are followed; each stands for the others
RAYS_PER_M2 = 10.0  # through a voxel that is seen: an obstacle of 0.5 m in it had two or three returns
LEAST_VOXEL_M = 1.0


class SeenAir:
    """Counts of rays through the voxels around the vehicle, in 4 MB whatever the flight.

    Voxels are half a footprint wide, 1 m or more: they reach 127 m from the vehicle or farther, and 48 m over
    the ground or more. They are kept in stored heights, as the maps' evidence.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.voxel_m = max(LEAST_VOXEL_M, parameters.footprint_m / 2)
        self._passed = np.zeros((SIDE, SIDE, LEVELS), np.uint8)
        self._column = np.full((SIDE, SIDE, 3), NOWHERE, np.int32)
        self._windows, self._datum_m = 0, 0.0

    @property
    def reach_m(self) -> float:
        """Horizontal distance from the vehicle within which air is remembered."""
        return (SIDE // 2 - 1) * self.voxel_m

    def add(
        self,
        points_m: NDArray[np.float64],
        origin: NDArray[np.uint16],
        origins_enu_m: NDArray[np.float64],
        datum_m: float,
        rows: NDArray[np.int64] | None = None,
    ) -> None:
        """Follow the rays of a window's returns.

        Parameters
        ----------
        points_m
            (n, 3) returns in stored heights, whose zero is at `datum_m` in the map frame.
        origin, origins_enu_m
            (n,) the scan of each return, and (k, 3) the sensor's position in each scan, in the map frame; not
            finite where it is unknown.
        rows
            (m,) returns to use; None for all.
        """
        self._datum_m = datum_m
        rows = np.arange(len(points_m)) if rows is None else rows
        stride = max(1, math.ceil(len(rows) / MOST_RAYS))
        first, self._windows = self._windows % stride, self._windows + 1
        origins = np.ascontiguousarray(origins_enu_m - (0.0, 0.0, datum_m))
        rays = points_m, rows, origin, origins, first, stride
        follow_rays(*rays, self.voxel_m, self._passed, self._column)

    def rays_through(self, points_m: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return (n,) the rays that passed the voxels of points (n, 3) in stored heights, up to 255."""
        return rays_through(np.ascontiguousarray(points_m), self.voxel_m, self._passed, self._column)

    def unseen(
        self,
        point_enu_m: NDArray[np.float64],
        ceiling_m: float,
        tangents: NDArray[np.float64],
        shape: tuple[float, float, float, float],
        blocked: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """Return (bearings, slopes) whether a corridor to a point is blocked or leads through unseen air.

        Parameters
        ----------
        point_enu_m, ceiling_m
            (3,) where corridors begin, and the height at which they end, in the map frame.
        tangents
            (slopes,) of the corridors, infinite for straight up.
        shape
            Radius, spread and height of what flies (`slz.kernels.air.seen_columns`), and reach.
        blocked
            (bearings, slopes) of the corridors that are known to be blocked: nothing else matters there.
        """
        out = blocked.copy()
        fewest = min(255, math.ceil(RAYS_PER_M2 * self.voxel_m**2))
        east, north, floor = point_enu_m.tolist()
        heights = floor - self._datum_m, ceiling_m - self._datum_m
        place = self._passed, self._column, self.voxel_m, east, north, *heights
        unseen_slopes(*place, tangents, *shape, fewest, out)
        return out
