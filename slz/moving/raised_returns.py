"""Returns over known ground that its map does not explain: of what moves, or was not seen before."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.frame import is_known
from slz.kernels.points.over_patch import find_raised
from slz.landing_point.local_heights import Nearby
from slz.landing_point.watched_ground import HeightPatch, highest_around
from slz.moving.common_shift import OverPatch
from slz.window import Scan

LEAST_M, MOST_M = 0.25, 5.0  # over the ground: dogs, and more than grass in the wind; lorries and branches
EVEN_M = 0.4  # between the highest and the lowest of 3 x 3 blocks
LEAST_RANGE_M = 1.5  # of a return; nearer is the vehicle itself, or dust of its rotors
BELOW_M = 3.0  # around the sensor, in which the ground is below it
LOWEST_M = 2.0  # of the sensor over the ground: lower it sees what stands far off at grazing angles
REACH_M = 28.0  # of the sensor over ground; the map beside a report ends at 30 m

Floats = NDArray[np.float64]
KEPT_NS = 8_000_000_000  # what stands for longer is part of the ground
ALIGNED = 1e-3  # of a block
Heights = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class RaisedReturns:
    """Returns (n, 3) in the map frame, their heights (n,) over the ground (m), and their stamps (n,)."""

    points_enu_m: Floats
    over_m: Floats
    stamp_ns: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ground(HeightPatch):
    """Blocks of `Nearby` around the vehicle, with the mean height of their ground."""

    ground_m: NDArray[np.float32]

    @classmethod
    def of(cls, nearby: Nearby) -> Ground:
        tops, even = highest_around(nearby.ground_m, nearby.top_m, EVEN_M)
        place = {"west_m": nearby.west_m, "south_m": nearby.south_m, "cell_m": nearby.cell_m}
        return cls(**place, top_m=tops, even=even, ground_m=nearby.ground_m)

    @property
    def even_top_m(self) -> NDArray[np.float32]:
        """Tops of even blocks, NaN elsewhere."""
        return np.where(self.even, self.top_m, np.float32(np.nan))

    @property
    def even_ground_m(self) -> NDArray[np.float32]:
        """Ground of even blocks, NaN elsewhere."""
        return np.where(self.even, self.ground_m, np.float32(np.nan))

    def below_m(self, enu_m: Floats) -> float:
        """Return the median of the ground within `BELOW_M` of a place; where unknown, of all ground."""
        row, col = (
            int((float(enu_m[i]) - corner) // self.cell_m)
            for i, corner in ((1, self.south_m), (0, self.west_m))
        )
        reach = math.ceil(BELOW_M / self.cell_m)
        part = self.ground_m[max(0, row - reach) : row + reach + 1, max(0, col - reach) : col + reach + 1]
        for heights in (part, self.ground_m):
            known = np.sort(heights[np.isfinite(heights)])
            if len(known):
                return float((known[(len(known) - 1) // 2] + known[len(known) // 2]) / 2)
        return math.nan


def raised_returns(scan: Scan, ground: Ground, angle_noise_rad: float) -> RaisedReturns | None:
    """Return the raised returns of a scan; None where there is none, or the sensor's place is unknown or low.

    A return is raised where it is higher over the ground of its block, and over what stands in the blocks
    around, than `LEAST_M` and noise explain. A common shift and tilt of all ground is taken off before.
    """
    if not len(scan) or not is_known(scan.sensor_enu_m):
        return None
    if not scan.sensor_enu_m[2] - ground.below_m(scan.sensor_enu_m) > LOWEST_M:
        return None
    points, sensor = np.ascontiguousarray(scan.points_enu_m), np.ascontiguousarray(scan.sensor_enu_m)
    around = float(sensor[0]), float(sensor[1]), -1.0, REACH_M
    over = OverPatch.of(points, ground, ground.ground_m, around)
    n = find_raised(
        points, sensor, over.index, over.cells, over.heights_m, over.shift_m(), ground.ground_m, ground.top_m,
        LEAST_M, MOST_M, angle_noise_rad, LEAST_RANGE_M, REACH_M,
    )  # fmt: skip
    which = over.index[:n]
    return RaisedReturns(points[which], over.heights_m[:n].copy(), scan.stamp_ns[which]) if n else None


class RecentGround:
    """Ground of the last seconds' reports: the lowest where it was even, elsewhere the newest."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, Ground]] = deque()

    def forget(self) -> None:
        """Drop all reports."""
        self._kept.clear()

    def add(self, nearby: Nearby, now_ns: int) -> Ground:
        """Take the heights of a report, with the time of the newest scan; return the ground."""
        newest = Ground.of(nearby)
        self._kept.append((now_ns, newest))
        while not (0 <= now_ns - self._kept[0][0] <= KEPT_NS and _is_like(self._kept[0][1], newest)):
            self._kept.popleft()
        tops, even, ground = newest.top_m.copy(), newest.even.copy(), newest.ground_m.copy()
        for _, before in list(self._kept)[:-1]:
            was_top, was_ground = (
                _moved(layer, before, newest) for layer in (before.even_top_m, before.even_ground_m)
            )
            lower = np.isfinite(was_top) & ~(tops <= was_top)
            tops[lower], even[lower] = was_top[lower], True
            lower = np.isfinite(was_ground) & ~(ground <= was_ground)
            ground[lower] = was_ground[lower]
        return dataclasses.replace(newest, top_m=tops, even=even, ground_m=ground)


def _is_like(one: Ground, other: Ground) -> bool:
    return one.cell_m == other.cell_m and one.top_m.shape == other.top_m.shape


def _moved(layer: Heights, before: Ground, after: Ground) -> Heights:
    """Return a layer on the blocks of another patch, the highest of those that each overlaps; NaN beyond."""
    out = layer
    for axis, offset_m in ((0, after.south_m - before.south_m), (1, after.west_m - before.west_m)):
        offset = offset_m / after.cell_m
        first = int(np.floor(offset + ALIGNED))
        part = _shifted(out, first, axis)
        if offset - first > ALIGNED:
            part = np.maximum(part, _shifted(out, first + 1, axis))  # NaN if one is
        out = part
    rows, cols = after.top_m.shape
    return out[:rows, :cols]


def _shifted(layer: Heights, by: int, axis: int) -> Heights:
    """Return a layer whose index k holds what k + by held, NaN where that was beyond."""
    count = layer.shape[axis]
    out = np.full_like(layer, np.nan)
    source = [slice(None), slice(None)]
    target = [slice(None), slice(None)]
    source[axis] = slice(min(max(by, 0), count), max(min(count + by, count), 0))
    target[axis] = slice(min(max(-by, 0), count), max(min(count - by, count), 0))
    out[tuple(target)] = layer[tuple(source)]
    return out
