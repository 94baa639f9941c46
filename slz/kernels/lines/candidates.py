"""Candidates of wires: raised returns of one window, and those that are stored."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, ReadOnly1D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.lines.line_votes import (
    CANDIDATE_FIELDS,
    EAST,
    NORTH,
    SEEN,
    SENSOR,
    SIGMA,
    UP,
)
from slz.kernels.lines.voxel_occupancy import height_over_floor, is_thin_at

NEAREST_M, FARTHEST_M = 4.0, 60.0  # from the sensor; dust near it is a line along the way flown
PLACE_SD_M, PLACE_SD_SHARE = 0.05, 0.003  # of the vehicle, and of its attitude by range, beside the ray's own
PLACE_M = 0.25  # cells in which one return of a window is kept
MOST_OF_WINDOW = 384
MOST = 1536  # returns stored
MAX_AGE_S = 120.0
SHARES = 4  # of the stored returns, one of which is compared with the air around in a window


@kernel
def candidates_of(
    points: Array2D[np.float64],
    raised: Array1D[np.int64],
    sensor: ReadOnly1D[np.float64],
    angle_noise_rad: float,
    range_noise_m: float,
    seen_s: float,
) -> Array2D[np.float64]:
    """Return candidates from the raised returns of a window, rows of (n, 3) points.

    One return for each cell of `PLACE_M` is taken, the first, and of these every so-manieth, so that they are
    no more than `MOST_OF_WINDOW`.
    """
    size = 64
    while size < 2 * len(raised):
        size *= 2
    slots, keys = np.full(size, -1, np.int32), np.empty(len(raised), np.int64)
    rows, n = np.empty(len(raised), np.int64), 0
    for i in raised:
        x, y, z = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        if not NEAREST_M <= math.sqrt(x * x + y * y + z * z) <= FARTHEST_M:
            continue
        key = int(np.floor(points[i, 0] / PLACE_M)) * 73856093
        key ^= int(np.floor(points[i, 1] / PLACE_M)) * 19349663
        key ^= int(np.floor(points[i, 2] / PLACE_M)) * 83492791
        slot = (key * 0x5851F42D4C957F2D >> 24) & (size - 1)
        while slots[slot] >= 0 and keys[slots[slot]] != key:
            slot = slot + 1 & (size - 1)
        if slots[slot] < 0:
            slots[slot], keys[n], rows[n] = n, key, i
            n += 1
    step = max(1, (n + MOST_OF_WINDOW - 1) // MOST_OF_WINDOW)
    out = np.empty(((n + step - 1) // step, CANDIDATE_FIELDS))
    for k in range(len(out)):
        i, own = rows[k * step], out[k]
        x, y, z = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        away = math.sqrt(x * x + y * y + z * z)
        of_ray = math.hypot(PLACE_SD_M + PLACE_SD_SHARE * away, angle_noise_rad * away)
        own[EAST], own[NORTH], own[UP] = points[i, 0], points[i, 1], points[i, 2]
        own[SIGMA], own[SEEN] = math.hypot(of_ray, range_noise_m), seen_s
        own[SENSOR], own[SENSOR + 1], own[SENSOR + 2] = sensor[0], sensor[1], sensor[2]
    return out


@kernel_part
def _copy(of: Array2D[np.float64], i: int, to: Array2D[np.float64], k: int) -> None:
    for f in range(CANDIDATE_FIELDS):
        to[k, f] = of[i, f]


@kernel
def renew(
    stored: Array2D[np.float64],
    n: int,
    new: Array2D[np.float64],
    now_s: float,
    window: int,
    fence_m: float,
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
    lowest: Array3D[np.float32],
    cell: Array3D[np.int32],
) -> tuple[int, int]:
    """Add the new candidates that are thin to the `n` stored ones; return how many are stored, how many new.

    Those too old go, and one in `SHARES` of the others is judged again: it goes where it is not thin by now,
    or lower over the floor than a fence. The oldest go where there are more than `MOST`.

    Parameters
    ----------
    stored
        (`MOST` + `MOST_OF_WINDOW`, CANDIDATE_FIELDS), changed.
    """
    fresh = m = 0
    scratch = np.empty((3, 5), np.int64)
    for i in range(n):
        if not now_s - stored[i, SEEN] <= MAX_AGE_S:
            continue
        fresh += 1
        if (fresh - 1) % SHARES == window % SHARES:
            e, north, u = stored[i, EAST], stored[i, NORTH], stored[i, UP]
            if not is_thin_at(e, north, u, scratch, epoch, oldest, occupied, column):
                continue
            if not height_over_floor(e, north, u, lowest, cell) >= fence_m:
                continue
        _copy(stored, i, stored, m)
        m += 1
    before = m
    for i in range(len(new)):
        if is_thin_at(new[i, EAST], new[i, NORTH], new[i, UP], scratch, epoch, oldest, occupied, column):
            _copy(new, i, stored, m)
            m += 1
    over = max(0, m - MOST)
    if over:
        for i in range(over, m):
            _copy(stored, i, stored, i - over)
    return m - over, m - before
