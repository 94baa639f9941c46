"""From points to cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

# Fields of one cell's epoch, see `slz.evidence`.
COUNT, MEAN, NOISE, LOW, LOW2, HIGH, HIGH2, TIME = range(8)


@kernel("int64[:](float64[:, :], float64, float64, float64, int64, int64, float64, float64)")
def box_of(
    points: NDArray[np.float64],
    west: float,
    south: float,
    cell: float,
    rows: int,
    cols: int,
    low: float,
    high: float,
) -> NDArray[np.int64]:
    """Return row0, row1, col0, col1 (half open) of the cells hit, and how many points lie in the grid."""
    r0, r1, c0, c1, inside = rows, -1, cols, -1, 0
    for i in range(points.shape[0]):
        z = points[i, 2]
        if not (low <= z <= high):
            continue
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if c < 0 or r < 0 or c >= cols or r >= rows:
            continue
        inside += 1
        r0, r1, c0, c1 = min(r0, r), max(r1, r), min(c0, c), max(c1, c)
    return np.array([r0, r1 + 1, c0, c1 + 1, inside], np.int64)


@kernel(
    "void(float64[:, :], float64, float64, float64, int64, int64, float64, float64,"
    " float64[:, :], int32[:, :])"
)
def sum_and_count(
    points: NDArray[np.float64],
    west: float,
    south: float,
    cell: float,
    row0: int,
    col0: int,
    low: float,
    high: float,
    total: NDArray[np.float64],
    count: NDArray[np.int32],
) -> None:
    """Add up heights and points of every cell of a box (SLZ paper Eq. 3-5)."""
    rows, cols = total.shape
    for i in range(points.shape[0]):
        z = points[i, 2]
        if not (low <= z <= high):
            continue
        c = int(np.floor((points[i, 0] - west) / cell)) - col0
        r = int(np.floor((points[i, 1] - south) / cell)) - row0
        if c < 0 or r < 0 or c >= cols or r >= rows:
            continue
        total[r, c] += z
        count[r, c] += 1


@kernel(
    "int64(float64[:, :], float64[:], float64, float64, float64, float64, float64, float64, float64,"
    " float32, float32, float32[:, :, :, :])"
)
def gather_evidence(
    points: NDArray[np.float64],
    sensor: NDArray[np.float64],
    range_noise_m: float,
    angle_noise_rad: float,
    west: float,
    south: float,
    cell: float,
    low: float,
    high: float,
    now_s: float,
    hold_s: float,
    evidence: NDArray[np.float32],
) -> int:
    """Add points to the per-cell statistics; return how many were used.

    A cell has a current and a previous epoch. When the current one has lasted `hold_s` and new points
    arrive, it becomes the previous one, so that everything seen counts for at least `hold_s` and at most
    until two epochs of newer observations have replaced it. NOISE is the mean variance of the heights that
    the sensor's noise explains: of the range along the ray, of the angle across it.
    """
    rows, cols = evidence.shape[0], evidence.shape[1]
    used = 0
    for i in range(points.shape[0]):
        z = points[i, 2]
        if not (low <= z <= high):
            continue
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if c < 0 or r < 0 or c >= cols or r >= rows:
            continue
        used += 1
        dx, dy, dz = points[i, 0] - sensor[0], points[i, 1] - sensor[1], z - sensor[2]
        across = dx * dx + dy * dy
        noise = range_noise_m**2 * dz * dz / max(across + dz * dz, 1e-6) + angle_noise_rad**2 * across
        if np.isnan(noise):  # the sensor's place is not known
            noise = range_noise_m**2
        variance = np.float32(noise)
        now = evidence[r, c, 0]
        if now[COUNT] > 0 and now_s - now[TIME] > hold_s:
            for f in range(8):
                evidence[r, c, 1, f] = now[f]
            now[COUNT] = 0
        h = np.float32(z)
        if now[COUNT] == 0:
            now[COUNT], now[MEAN], now[NOISE], now[TIME] = 1, h, variance, now_s
            now[LOW] = now[LOW2] = now[HIGH] = now[HIGH2] = h
        else:
            n = now[COUNT] + 1
            now[COUNT] = n
            now[MEAN] += (h - now[MEAN]) / n
            now[NOISE] += (variance - now[NOISE]) / n
            if n == 2:  # of two points the lower is second highest, the higher second lowest
                now[LOW2], now[HIGH2] = max(now[LOW], h), min(now[HIGH], h)
                now[LOW], now[HIGH] = min(now[LOW], h), max(now[HIGH], h)
            else:
                if h < now[LOW]:
                    now[LOW2], now[LOW] = now[LOW], h
                elif h < now[LOW2]:
                    now[LOW2] = h
                if h > now[HIGH]:
                    now[HIGH2], now[HIGH] = now[HIGH], h
                elif h > now[HIGH2]:
                    now[HIGH2] = h
        evidence[r, c, 1, TIME] = now_s
    return used


@kernel("float64[:, :](float64[:, :], float64, float64, float64, float32[:, :, :, :])")
def differences(
    points: NDArray[np.float64], west: float, south: float, cell: float, evidence: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return (m, 3) east, north and height above the mean of the cell, of the points over known cells."""
    rows, cols = evidence.shape[0], evidence.shape[1]
    out = np.empty((len(points), 3))
    m = 0
    for i in range(len(points)):
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if c < 0 or r < 0 or c >= cols or r >= rows or evidence[r, c, 0, COUNT] == 0:
            continue
        now, before = evidence[r, c, 0], evidence[r, c, 1]
        mean = (now[COUNT] * now[MEAN] + before[COUNT] * before[MEAN]) / (now[COUNT] + before[COUNT])
        out[m, 0], out[m, 1], out[m, 2] = points[i, 0], points[i, 1], points[i, 2] - mean
        m += 1
    return out[:m].copy()
