"""Kernel that georeferences returns, each with the pose at its own stamp."""

from __future__ import annotations

import numpy as np

from companion.flight.fusion.motion import (
    SMALL_RAD,
    STRETCH,
    hermite_cubic,
    rotation_enu,
    segment,
    sine_versine,
    sine_versine_of_small,
    turn_between,
)
from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel, kernel_part

BLOCK = 256  # returns per block, without a branch, so that the compiler vectorises
SINE, VERSINE, X, Y, Z, SQUARE = range(6)
ONE = np.uint64(1)


@kernel_part
def _turns(
    stamp_ns: ReadOnly1D[np.int64],
    first: np.uint64,
    count: np.uint64,
    since: np.int64,
    share: float,
    angle: float,
    work: Array2D[np.float64],
) -> None:
    """Write sin and 1 - cos of the body's rotation angles since the beginning of a segment."""
    sine, versine = work[SINE], work[VERSINE]
    if angle > SMALL_RAD:
        for i in range(count):
            sine[i], versine[i] = sine_versine(share * (stamp_ns[first + i] - since))
        return
    for i in range(count):
        sine[i], versine[i] = sine_versine_of_small(share * (stamp_ns[first + i] - since))


@kernel_part
def _turned(
    xyz_m: ReadOnly2D[np.float32],
    first: np.uint64,
    count: np.uint64,
    m: Array2D[np.float64],
    lever: Array1D[np.float64],
    ax: float,
    ay: float,
    az: float,
    work: Array2D[np.float64],
) -> None:
    """Write returns in body axes at the beginning of a segment, rotated by Rodrigues' formula."""
    m00, m01, m02 = m[0, 0], m[0, 1], m[0, 2]
    m10, m11, m12 = m[1, 0], m[1, 1], m[1, 2]
    m20, m21, m22 = m[2, 0], m[2, 1], m[2, 2]
    lx, ly, lz = lever[0], lever[1], lever[2]
    sine, versine, square = work[SINE], work[VERSINE], work[SQUARE]
    tx, ty, tz = work[X], work[Y], work[Z]
    for i in range(count):  # separate loop: arithmetic on interleaved coordinates is not vectorised
        tx[i], ty[i], tz[i] = xyz_m[first + i, 0], xyz_m[first + i, 1], xyz_m[first + i, 2]
    for i in range(count):
        x, y, z = tx[i], ty[i], tz[i]
        square[i] = x * x + y * y + z * z
        tx[i] = m00 * x + m01 * y + m02 * z + lx
        ty[i] = m10 * x + m11 * y + m12 * z + ly
        tz[i] = m20 * x + m21 * y + m22 * z + lz
    for i in range(count):
        bx, by, bz = tx[i], ty[i], tz[i]
        s, c = sine[i], versine[i]
        along = c * (ax * bx + ay * by + az * bz)
        tx[i] = bx * (1 - c) + s * (ay * bz - az * by) + along * ax
        ty[i] = by * (1 - c) + s * (az * bx - ax * bz) + along * ay
        tz[i] = bz * (1 - c) + s * (ax * by - ay * bx) + along * az


@kernel_part
def _moved(
    stamp_ns: ReadOnly1D[np.int64],
    first: np.uint64,
    count: np.uint64,
    since: np.int64,
    share: float,
    r: Array2D[np.float64],
    cubic: Array2D[np.float64],
    work: Array2D[np.float64],
) -> None:
    """Convert returns from body to map coordinates: rotate, then add the body's position."""
    r00, r01, r02 = r[0, 0], r[0, 1], r[0, 2]
    r10, r11, r12 = r[1, 0], r[1, 1], r[1, 2]
    r20, r21, r22 = r[2, 0], r[2, 1], r[2, 2]
    x0, x1, x2, x3 = cubic[0, 0], cubic[1, 0], cubic[2, 0], cubic[3, 0]
    y0, y1, y2, y3 = cubic[0, 1], cubic[1, 1], cubic[2, 1], cubic[3, 1]
    z0, z1, z2, z3 = cubic[0, 2], cubic[1, 2], cubic[2, 2], cubic[3, 2]
    xs, ys, zs = work[X], work[Y], work[Z]
    for i in range(count):
        u = (stamp_ns[first + i] - since) * share
        tx, ty, tz = xs[i], ys[i], zs[i]
        xs[i] = x0 + u * (x1 + u * (x2 + u * x3)) + r00 * tx + r01 * ty + r02 * tz
        ys[i] = y0 + u * (y1 + u * (y2 + u * y3)) + r10 * tx + r11 * ty + r12 * tz
        zs[i] = z0 + u * (z1 + u * (z2 + u * z3)) + r20 * tx + r21 * ty + r22 * tz


@kernel
def place(
    xyz_sensor_m: ReadOnly2D[np.float32],
    stamp_ns: ReadOnly1D[np.int64],
    attitude_ns: Array1D[np.int64],
    attitudes: Array2D[np.float64],
    position_ns: Array1D[np.int64],
    positions: Array2D[np.float64],
    gap_ns: int,
    rotation_frd_from_sensor: Array2D[np.float64],
    lever_frd_m: Array1D[np.float64],
    least_m: float,
    most_m: float,
    points_enu_m: Array2D[np.float64],
    point_ns: Array1D[np.int64],
    number: Array1D[np.int64],
) -> tuple[int, int, int]:
    """Write the map coordinates of all returns that are in range and have a pose.

    Parameters
    ----------
    xyz_sensor_m, stamp_ns
        Returns (n, 3) and their stamps (n,).
    attitude_ns, attitudes, position_ns, positions, gap_ns
        `PoseHistory.samples()`.
    rotation_frd_from_sensor, lever_frd_m
        See `Mount`.
    least_m, most_m
        Range gate.
    points_enu_m, point_ns, number
        Outputs (n, 3), (n,) and (n,): position, stamp, and the return's index in `xyz_sensor_m`.

    Returns
    -------
    tuple of int
        Points written, returns out of range (including NaN), returns without a pose.
    """
    n, out_of_range, without_pose = np.uint64(0), 0, 0
    near, far = least_m * least_m, most_m * most_m
    r, cubic, work = np.empty((3, 3)), np.empty((4, 3)), np.empty((6, BLOCK))
    a = p = -1
    a_from = a_to = p_from = p_to = np.int64(0)  # the current segments, empty at first
    ax, ay, az, angle, a_share, p_share = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    first, total = np.uint64(0), np.uint64(len(stamp_ns))
    while first < total:
        t = stamp_ns[first]
        if a < 0 or t < a_from or t > a_to:
            a = segment(attitude_ns, t, a)
            if a >= 0:
                a_from, a_to = attitude_ns[a], attitude_ns[a + 1]
                if a_to - a_from > gap_ns:
                    a = -1
                else:
                    rotation_enu(attitudes[a], r)
                    ax, ay, az, angle = turn_between(attitudes[a], attitudes[a + 1])
                    a_share = angle / (a_to - a_from)
        if p < 0 or t < p_from or t > p_to:
            p = segment(position_ns, t, p)
            if p >= 0:
                p_from, p_to = position_ns[p], position_ns[p + 1]
                if p_to - p_from > gap_ns or positions[p, STRETCH] != positions[p + 1, STRETCH]:
                    p = -1
                else:
                    p_share = 1.0 / (p_to - p_from)
                    hermite_cubic(positions, p, (p_to - p_from) * 1e-9, cubic)
        placed = a >= 0 and p >= 0
        count, most = ONE, min(np.uint64(BLOCK), total - first)
        if placed:  # count the following returns in the same segments
            low, high = max(a_from, p_from), min(a_to, p_to)
            while count < most and low <= stamp_ns[first + count] <= high:
                count += ONE
            _turns(stamp_ns, first, count, a_from, a_share, angle, work)
        _turned(xyz_sensor_m, first, count, rotation_frd_from_sensor, lever_frd_m, ax, ay, az, work)
        if placed:
            _moved(stamp_ns, first, count, p_from, p_share, r, cubic, work)
        for i in range(count):
            if not (near <= work[SQUARE, i] <= far):
                out_of_range += 1
            elif not placed:
                without_pose += 1
            else:
                points_enu_m[n, 0], points_enu_m[n, 1] = work[X, i], work[Y, i]
                points_enu_m[n, 2] = work[Z, i]
                point_ns[n] = stamp_ns[first + i]
                number[n] = first + i
                n += ONE
        first += count
    return int(n), out_of_range, without_pose
