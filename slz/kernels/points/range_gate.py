"""Range gate: points near enough to the sensor, finite, and of plausible height."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel

THREE = np.uint64(3)
CHUNK = 64  # points tested together before any of them is tested alone


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
def mark_usable(
    points: Array2D[np.float64],
    sensor: Array1D[np.float64],
    reach2: float,
    most_height: float,
    flags: Array1D[np.uint16],
    usable: int,
) -> None:
    """Set a flag of the finite points within range whose height is below `most_height` in magnitude."""
    flag = np.uint16(usable)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        dx, dy = x - sensor[0], y - sensor[1]
        beyond = dx * dx + dy * dy > reach2
        if not beyond and abs(z) < most_height and x - x == 0.0 and y - y == 0.0:
            flags[i] |= flag


@kernel
def heights_and_ranges(
    points: Array2D[np.float64], sensor: ReadOnly1D[np.float64], every: int
) -> Array2D[np.float64]:
    """Return (2, m) heights, and horizontal ranges from the sensor, of every so-manieth point."""
    out = np.empty((2, (len(points) + every - 1) // every))
    for k in range(out.shape[1]):
        i = k * every
        out[0, k] = points[i, 2]
        out[1, k] = math.hypot(points[i, 0] - sensor[0], points[i, 1] - sensor[1])
    return out


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
