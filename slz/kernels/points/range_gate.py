"""Range gate: points near enough to the sensor, finite, and of plausible height."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel

THREE = np.uint64(3)
CHUNK = 64  # points tested together before any of them is tested alone
Heights = Array1D[np.float64]


@kernel
def within_reach(
    points: ReadOnly2D[np.float64], sensor: ReadOnly1D[np.float64], reach2: float
) -> Array1D[np.bool_]:
    """Return which points are within a horizontal range (given squared); all where the sensor is unknown."""
    out = np.empty(len(points), np.bool_)
    for i in range(len(points)):
        dx, dy = points[i, 0] - sensor[0], points[i, 1] - sensor[1]
        out[i] = not dx * dx + dy * dy > reach2
    return out


@kernel
def usable(
    points: ReadOnly2D[np.float64], sensor: ReadOnly1D[np.float64], reach2: float, most_height: float
) -> Array2D[np.float64]:
    """Return the finite points within range whose height is below `most_height` in magnitude."""
    out, n = np.empty((len(points), 3)), 0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        dx, dy = x - sensor[0], y - sensor[1]
        out[n, 0], out[n, 1], out[n, 2] = x, y, z
        beyond = dx * dx + dy * dy > reach2
        n += not beyond and abs(z) < most_height and x - x == 0.0 and y - y == 0.0
    return out[:n]


@kernel
def are_usable(
    points: ReadOnly2D[np.float64], sensor: ReadOnly1D[np.float64], reach2: float, most_height: float
) -> tuple[Heights, bool]:
    """Return all heights, and whether `usable` returns all points; if not, the heights are incomplete."""
    height, flat = np.empty(len(points)), points.ravel()
    for start in range(0, len(points), CHUNK):
        first, unfit = np.uint64(start), 0
        for i in range(np.uint64(min(CHUNK, len(points) - start))):  # vectorised
            at = THREE * (first + i)
            x, y, z = flat[at], flat[at + np.uint64(1)], flat[at + np.uint64(2)]
            dx, dy = x - sensor[0], y - sensor[1]
            height[first + i] = z
            unfit += (
                (dx * dx + dy * dy > reach2) | (x - x != 0.0) | (y - y != 0.0) | (not abs(z) < most_height)
            )
        if unfit:
            return height, False
    return height, True


@kernel
def picked(points: ReadOnly2D[np.float64], which: ReadOnly1D[np.bool_]) -> Array2D[np.float64]:
    """Return the points to keep, as `points[which]` does."""
    out, n = np.empty((np.count_nonzero(which), 3)), 0
    for i in range(len(points)):
        if which[i]:
            out[n, 0], out[n, 1], out[n, 2] = points[i, 0], points[i, 1], points[i, 2]
            n += 1
    return out


@kernel
def heights_of(height: Heights, which: Array1D[np.bool_]) -> Heights:
    """Return the heights to keep, as `height[which]` does."""
    out, n = np.empty(len(height)), 0
    for i in range(len(height)):
        out[n] = height[i]
        n += which[i]
    return out[:n]


@kernel
def beyond(height: Heights, which: Array1D[np.bool_], low: float, high: float) -> Array1D[np.int64]:
    """Return the indices of the selected points below or above an interval."""
    out, m = np.empty(CHUNK, np.int64), 0
    for start in range(0, len(height), CHUNK):
        first, count, any_ = np.uint64(start), min(CHUNK, len(height) - start), 0
        for k in range(np.uint64(count)):  # vectorised
            any_ += (height[first + k] < low) | (height[first + k] > high)
        if not any_:
            continue
        for i in range(start, start + count):
            if which[i] and (height[i] < low or height[i] > high):
                if m == len(out):
                    out = np.append(out, np.empty_like(out))
                out[m] = i
                m += 1
    return out[:m].copy()


@kernel
def extent(points: Array2D[np.float64]) -> tuple[float, float, float, float]:
    """Return the least and greatest east, and the least and greatest north, of at least one point."""
    low, high, flat = np.empty(3 * CHUNK), np.empty(3 * CHUNK), points.ravel()
    for k in range(3 * CHUNK):
        low[k] = high[k] = flat[k % 3]
    whole = len(flat) // len(low) * len(low)
    for start in range(0, whole, 3 * CHUNK):
        first = np.uint64(start)
        for k in range(np.uint64(3 * CHUNK)):  # vectorised
            value = flat[first + k]
            low[k] = value if value < low[k] else low[k]
            high[k] = value if value > high[k] else high[k]
    for i in range(whole, len(flat)):
        low[i % 3], high[i % 3] = min(low[i % 3], flat[i]), max(high[i % 3], flat[i])
    return low[::3].min(), high[::3].max(), low[1::3].min(), high[1::3].max()
