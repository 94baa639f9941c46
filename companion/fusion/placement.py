"""Kernel that places every return with the pose of its own moment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.fusion.motion import (
    EPOCH,
    Floats,
    Stamps,
    hermite_cubic,
    rotation_enu,
    segment,
    sine_versine,
    turn_between,
)
from slz.kernels.jit import kernel


@kernel(
    "UniTuple(int64, 3)(Array(float32, 2, 'C', True), Array(int64, 1, 'C', True), int64[::1],"
    " float64[:, ::1], int64[::1], float64[:, ::1], int64, float64[:, ::1], float64[::1], float64, float64,"
    " float64[:, ::1], int64[::1])"
)
def place(
    xyz_sensor_m: NDArray[np.float32],
    stamp_ns: Stamps,
    attitude_ns: Stamps,
    attitudes: Floats,
    position_ns: Stamps,
    positions: Floats,
    gap_ns: int,
    rotation_frd_from_sensor: Floats,
    lever_frd_m: Floats,
    least_m: float,
    most_m: float,
    points_enu_m: Floats,
    point_ns: Stamps,
) -> tuple[int, int, int]:
    """Write the map coordinates of all returns that are in range and have a pose.

    Parameters
    ----------
    xyz_sensor_m, stamp_ns
        Returns (n, 3) and their stamps (n,).
    attitude_ns, attitudes, position_ns, positions, gap_ns
        `PoseHistory.samples()`.
    rotation_frd_from_sensor, lever_frd_m
        `Mount`.
    least_m, most_m
        Range gate.
    points_enu_m, point_ns
        Outputs (n, 3) and (n,).

    Returns
    -------
    tuple of int
        Points written, returns out of range (NaN among them), returns without a pose.
    """
    n = out_of_range = without_pose = 0
    near, far = least_m * least_m, most_m * most_m
    m, lever = rotation_frd_from_sensor, lever_frd_m
    r = np.empty((3, 3))
    cubic = np.empty((4, 3))
    a = p = -1
    a_from = a_to = p_from = p_to = np.int64(0)  # the segments under way, empty at first
    ax, ay, az, angle, a_share, p_share = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(stamp_ns)):
        x, y, z = (
            np.float64(xyz_sensor_m[j, 0]),
            np.float64(xyz_sensor_m[j, 1]),
            np.float64(xyz_sensor_m[j, 2]),
        )
        square = x * x + y * y + z * z
        if not (near <= square <= far):
            out_of_range += 1
            continue
        t = stamp_ns[j]
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
                if p_to - p_from > gap_ns or positions[p, EPOCH] != positions[p + 1, EPOCH]:
                    p = -1
                else:
                    p_share = 1.0 / (p_to - p_from)
                    hermite_cubic(positions, p, (p_to - p_from) * 1e-9, cubic)
        if a < 0 or p < 0:
            without_pose += 1
            continue
        # sensor to body at the segment's beginning
        bx = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + lever[0]
        by = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + lever[1]
        bz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + lever[2]
        # turned by the body's motion since, Rodrigues' formula
        s, c = sine_versine(a_share * (t - a_from))
        along = c * (ax * bx + ay * by + az * bz)
        tx = bx * (1 - c) + s * (ay * bz - az * by) + along * ax
        ty = by * (1 - c) + s * (az * bx - ax * bz) + along * ay
        tz = bz * (1 - c) + s * (ax * by - ay * bx) + along * az
        u = (t - p_from) * p_share
        at_x = cubic[0, 0] + u * (cubic[1, 0] + u * (cubic[2, 0] + u * cubic[3, 0]))
        points_enu_m[n, 0] = at_x + r[0, 0] * tx + r[0, 1] * ty + r[0, 2] * tz
        at_y = cubic[0, 1] + u * (cubic[1, 1] + u * (cubic[2, 1] + u * cubic[3, 1]))
        points_enu_m[n, 1] = at_y + r[1, 0] * tx + r[1, 1] * ty + r[1, 2] * tz
        at_z = cubic[0, 2] + u * (cubic[1, 2] + u * (cubic[2, 2] + u * cubic[3, 2]))
        points_enu_m[n, 2] = at_z + r[2, 0] * tx + r[2, 1] * ty + r[2, 2] * tz
        point_ns[n] = t
        n += 1
    return n, out_of_range, without_pose
