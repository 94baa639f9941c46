"""Surfel map: the planes of the surfaces seen, in voxels of several sizes, each where it was first seen.

A voxel of the coarsest size in which the points are flat is used: level ground and walls fill voxels of 2 m,
a parapet needs the finest. As in VoxelMap (Yuan et al., 2022, doi:10.1109/LRA.2022.3187250), but a plane does
not follow later points: the map must not drift with the vehicle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.flight.fusion.odometry.surfel_kernels import MOMENTS, PLANE, ROUGHNESS, SLOTS, insert, slot_of

Floats = NDArray[np.float64]
SIZES_M = np.array([2.0, 1.0, 0.5])
HOLD_NS = 5_000_000_000
MOST = 400  # points of a voxel
FULL = SLOTS // 2
REACH_M = 60.0  # farther voxels are forgotten when the map is full


class SurfelMap:
    """Voxels of three sizes in hash tables of bounded size.

    Attributes
    ----------
    keys, first_ns, counts, sums, planes
        Tables (3, slots, ...): key of each voxel (0: free), stamp of its first point, number of points, their
        moments about the voxel's middle, and the plane (normal, offset from the middle, roughness or -1).
    """

    def __init__(self) -> None:
        shape = len(SIZES_M), SLOTS
        self.keys = np.zeros(shape, np.int64)
        self.first_ns = np.zeros(shape, np.int64)
        self.counts = np.zeros(shape, np.int32)
        self.sums = np.zeros((*shape, MOMENTS), np.float32)
        self.planes = np.zeros((*shape, PLANE), np.float32)
        self._used = np.zeros(len(SIZES_M), np.int64)

    def clear(self) -> None:
        """Forget everything."""
        self.keys[:] = 0
        self._used[:] = 0

    def add(
        self, points_enu_m: Floats, known: NDArray[np.bool_], stamp_ns: int, around_enu_m: Floats
    ) -> None:
        """Add points (n, 3) of a scan that are not `known` (n,) yet; `around_enu_m` (3,) is the sensor."""
        for level, size_m in enumerate(SIZES_M):
            if self._used[level] + len(points_enu_m) > FULL:
                self._forget_far(level, around_enu_m)
            self._used[level] += insert(
                points_enu_m,
                known,
                stamp_ns,
                float(size_m),
                self.keys[level],
                self.first_ns[level],
                self.counts[level],
                self.sums[level],
                self.planes[level],
                HOLD_NS,
                MOST,
            )

    def _forget_far(self, level: int, around_enu_m: Floats) -> None:
        """Keep the voxels with a plane within reach; if they still fill the table, the nearest half of it."""
        keys = self.keys[level]
        taken = np.flatnonzero((keys != 0) & (self.planes[level, :, ROUGHNESS] >= 0))
        middle = (_indices(keys[taken]) + 0.5) * SIZES_M[level]
        away = np.linalg.norm(middle - around_enu_m, axis=1)
        nearest = np.argsort(away, kind="stable")[: FULL // 2]
        taken = taken[nearest[away[nearest] < REACH_M]]
        tables = self.first_ns[level], self.counts[level], self.sums[level], self.planes[level]
        kept, kept_keys = [table[taken].copy() for table in tables], keys[taken].copy()
        keys[:] = 0
        for i, key in enumerate(kept_keys):
            j = slot_of(keys, int(key))
            keys[j] = key
            for table, rows in zip(tables, kept, strict=True):
                table[j] = rows[i]
        self._used[level] = len(taken)


def _indices(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices (n, 3) of voxels by their keys."""
    packed = keys - 1
    parts = np.stack([packed >> 42, packed >> 21, packed], axis=1) & 0x1FFFFF
    return np.where(parts >= 1 << 20, parts - (1 << 21), parts)
