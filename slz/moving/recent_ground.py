"""Ground as it was before what moves came: the lowest of the last seconds' reports.

A report shows who walks by where he was in its window, and around it the highest of 3 x 3 blocks counts. Who
walks slowly would never be higher than himself.
"""

from __future__ import annotations

import dataclasses
from collections import deque

import numpy as np
from numpy.typing import NDArray

from slz.landing_point.local_heights import Nearby
from slz.moving.raised_returns import Ground

KEPT_NS = 8_000_000_000  # what stands for longer is part of the ground
ALIGNED = 1e-3  # of a block

Heights = NDArray[np.float32]


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
