"""Kernels that interpolate a vehicle's attitude and position between samples.

An attitude sample is a unit quaternion (w, x, y, z) of body forward-right-down into north-east-down. Attitude
is interpolated at a constant rate (slerp); position follows the cubic through both positions and both
velocities (Hermite).
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, ReadOnly1D
from slz.kernels.jit import kernel, kernel_part

# Columns of a position sample: east, north, up; their rates; a number that changes when the estimate or the
# clock of its stamps jumps.
POSITION_WIDTH = 7
STRETCH = 6
SMALL_RAD = 0.5  # limit of the sine's power series


@kernel_part
def segment(stamp_ns: Array1D[np.int64], t_ns: int, hint: int) -> int:
    """Return the least i with `stamp_ns[i] <= t_ns <= stamp_ns[i + 1]`, -1 if there is none.

    The last sample before a gap thus belongs to the segment before it. The search walks from `hint`, because
    neighbouring returns are in the same or the next segment.
    """
    last = len(stamp_ns) - 1
    if last < 1 or t_ns < stamp_ns[0] or t_ns > stamp_ns[last]:
        return -1
    i = min(max(hint, 0), last - 1)
    if abs(t_ns - stamp_ns[i]) > 2_000_000_000:
        i = min(np.int64(np.searchsorted(stamp_ns, t_ns)), last - 1)  # type: ignore[assignment]
    while i > 0 and stamp_ns[i] >= t_ns:
        i -= 1
    while stamp_ns[i + 1] < t_ns:
        i += 1
    return i


@kernel_part
def rotation_enu(quat_wxyz: Array1D[np.float64], out: Array2D[np.float64]) -> None:
    """Write the rotation of body forward-right-down into east-north-up from the quaternion into NED."""
    w, x, y, z = quat_wxyz[0], quat_wxyz[1], quat_wxyz[2], quat_wxyz[3]
    out[1, 0] = 1 - 2 * (y * y + z * z)
    out[1, 1] = 2 * (x * y - w * z)
    out[1, 2] = 2 * (x * z + w * y)
    out[0, 0] = 2 * (x * y + w * z)
    out[0, 1] = 1 - 2 * (x * x + z * z)
    out[0, 2] = 2 * (y * z - w * x)
    out[2, 0] = -2 * (x * z - w * y)
    out[2, 1] = -2 * (y * z + w * x)
    out[2, 2] = -1 + 2 * (x * x + y * y)


@kernel_part
def turn_between(
    before: Array1D[np.float64], after: Array1D[np.float64]
) -> tuple[float, float, float, float]:
    """Return body axis (3) and angle (rad, 0 to pi) of the shorter rotation between two attitudes."""
    w = before[0] * after[0] + before[1] * after[1] + before[2] * after[2] + before[3] * after[3]
    # conjugate(before) * after
    x = before[0] * after[1] - before[1] * after[0] - before[2] * after[3] + before[3] * after[2]
    y = before[0] * after[2] + before[1] * after[3] - before[2] * after[0] - before[3] * after[1]
    z = before[0] * after[3] - before[1] * after[2] + before[2] * after[1] - before[3] * after[0]
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    sign = 1.0 if w >= 0 else -1.0
    scale = sign / sine
    return x * scale, y * scale, z * scale, 2 * math.atan2(sine, abs(w))


@kernel_part
def sine_versine_of_small(angle: float) -> tuple[float, float]:
    """Return sin and 1 - cos of an angle below half a radian from their series, with an error of 1e-11."""
    s = angle * angle  # reciprocals, because a chain of divisions takes longer than the rest of a return
    sine = angle * (1 - s * (1 / 6) * (1 - s * (1 / 20) * (1 - s * (1 / 42) * (1 - s * (1 / 72)))))
    versine = 0.5 * s * (1 - s * (1 / 12) * (1 - s * (1 / 30) * (1 - s * (1 / 56) * (1 - s * (1 / 90)))))
    return sine, versine


@kernel_part
def sine_versine(angle: float) -> tuple[float, float]:
    """Return sin and 1 - cos of an angle."""
    if angle > SMALL_RAD:
        return math.sin(angle), 1 - math.cos(angle)
    return sine_versine_of_small(angle)


@kernel_part
def hermite_cubic(samples: Array2D[np.float64], i: int, span_s: float, out: Array2D[np.float64]) -> None:
    """Write the coefficients (4, 3), constant first, of the cubic from sample i to i + 1.

    The argument of the cubic is the normalised time, 0 to 1, between samples `span_s` seconds apart.
    """
    for k in range(3):
        start, way = samples[i, k], samples[i + 1, k] - samples[i, k]
        leave, arrive = span_s * samples[i, 3 + k], span_s * samples[i + 1, 3 + k]
        out[0, k] = start
        out[1, k] = leave
        out[2, k] = 3 * way - 2 * leave - arrive
        out[3, k] = leave + arrive - 2 * way


@kernel
def interpolate(
    stamp_ns: ReadOnly1D[np.int64],
    attitude_ns: Array1D[np.int64],
    attitudes: Array2D[np.float64],
    position_ns: Array1D[np.int64],
    positions: Array2D[np.float64],
    gap_ns: int,
    position_enu_m: Array2D[np.float64],
    rotation_enu_from_frd: Array3D[np.float64],
    valid: Array1D[np.bool_],
) -> None:
    """Write position (n, 3), rotation (n, 3, 3) and validity (n,) at each stamp; NaN where invalid.

    A segment longer than `gap_ns`, or one across which the estimate jumped, is invalid.
    """
    before = np.empty((3, 3))
    cubic = np.empty((4, 3))
    a = p = 0
    for j in range(len(stamp_ns)):
        t = stamp_ns[j]
        ja, jp = segment(attitude_ns, t, a), segment(position_ns, t, p)
        valid[j] = (
            ja >= 0
            and jp >= 0
            and attitude_ns[ja + 1] - attitude_ns[ja] <= gap_ns
            and position_ns[jp + 1] - position_ns[jp] <= gap_ns
            and positions[jp, STRETCH] == positions[jp + 1, STRETCH]
        )
        if not valid[j]:
            position_enu_m[j, :] = np.nan
            rotation_enu_from_frd[j, :, :] = np.nan
            continue
        a, p = ja, jp
        span_ns = position_ns[p + 1] - position_ns[p]
        hermite_cubic(positions, p, span_ns * 1e-9, cubic)
        u = (t - position_ns[p]) / span_ns
        for k in range(3):
            position_enu_m[j, k] = cubic[0, k] + u * (cubic[1, k] + u * (cubic[2, k] + u * cubic[3, k]))
        x, y, z, angle = turn_between(attitudes[a], attitudes[a + 1])
        share = (t - attitude_ns[a]) / (attitude_ns[a + 1] - attitude_ns[a])
        s, c = sine_versine(angle * share)
        rotation_enu(attitudes[a], before)
        for row in range(3):  # times the body's rotation, by Rodrigues' formula
            r0, r1, r2 = before[row, 0], before[row, 1], before[row, 2]
            along = c * (r0 * x + r1 * y + r2 * z)
            rotation_enu_from_frd[j, row, 0] = r0 * (1 - c) + s * (r1 * z - r2 * y) + along * x
            rotation_enu_from_frd[j, row, 1] = r1 * (1 - c) + s * (r2 * x - r0 * z) + along * y
            rotation_enu_from_frd[j, row, 2] = r2 * (1 - c) + s * (r0 * y - r1 * x) + along * z
