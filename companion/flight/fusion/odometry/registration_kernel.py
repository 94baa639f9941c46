"""Kernel of the registration: normal equations of the distances from a scan's points to the map's planes."""

from __future__ import annotations

import math

import numpy as np

from companion.flight.fusion.odometry.surfel_kernels import FEWEST, ROUGHNESS, key_of, slot_of
from slz.kernels.argument_types import Array1D, Array2D, Array3D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel

STEEP = 0.8  # vertical component of a plane's normal below which the plane tells the horizontal position
FEWEST_STEEP = 12  # points of such a plane


@kernel
def normal_equations(
    points_m: ReadOnly2D[np.float64],
    pivot_m: ReadOnly1D[np.float64],
    rotation: ReadOnly2D[np.float64],
    shift_m: ReadOnly1D[np.float64],
    stamp_ns: int,
    sizes_m: ReadOnly1D[np.float64],
    keys: Array2D[np.int64],
    first_ns: Array2D[np.int64],
    counts: Array2D[np.int32],
    planes: Array3D[np.float32],
    age_ns: int,
    sigma_m: float,
    gate_m: float,
    moved_m: Array2D[np.float64],
    known: Array1D[np.bool_],
    left: Array2D[np.float64],
    right: Array1D[np.float64],
) -> tuple[int, int, int, int, int]:
    """Write the normal equations of a small further rotation about the pivot and shift.

    Points (n, 3) are rotated about the pivot and shifted first (`moved_m`). A plane that is not steep gives
    the height alone, whatever its slope, because a slope of the ground taken for a place would let the map
    slide. A steep one counts from `age_ns` after it was first seen: by then it was not placed by the present
    error. Weights are those of Geman and McClure.

    Returns
    -------
    tuple of int
        Points at a plane of the map, those within `gate_m` of it, points at a steep plane, and those within
        `gate_m` of it; and the mean time for which the map has had the planes of the second, ns.
    """
    left[:, :] = 0.0
    right[:] = 0.0
    row = np.zeros(6)
    met, matched, steep_met, steep_ones, ages_ns = 0, 0, 0, 0, 0
    precision = 1 / (sigma_m * sigma_m)
    for i in range(len(points_m)):
        x, y, z = points_m[i, 0] - pivot_m[0], points_m[i, 1] - pivot_m[1], points_m[i, 2] - pivot_m[2]
        lx = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
        ly = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
        lz = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
        px, py, pz = lx + pivot_m[0] + shift_m[0], ly + pivot_m[1] + shift_m[1], lz + pivot_m[2] + shift_m[2]
        moved_m[i, 0], moved_m[i, 1], moved_m[i, 2] = px, py, pz
        known[i] = False
        for level in range(len(sizes_m)):
            size_m = sizes_m[level]
            qx, qy, qz = px / size_m, py / size_m, pz / size_m
            ix, iy, iz = math.floor(qx), math.floor(qy), math.floor(qz)
            key = key_of(ix, iy, iz)
            j = slot_of(keys[level], key)
            if keys[level, j] == 0 or counts[level, j] < FEWEST or planes[level, j, ROUGHNESS] < 0:
                continue
            nx, ny = float(planes[level, j, 0]), float(planes[level, j, 1])
            nz = float(planes[level, j, 2])
            cx, cy, cz = (qx - ix - 0.5) * size_m, (qy - iy - 0.5) * size_m, (qz - iz - 0.5) * size_m
            error = nx * cx + ny * cy + nz * cz - planes[level, j, 3]
            old = stamp_ns - first_ns[level, j] >= age_ns
            met += 1
            steep = nz < STEEP and old and counts[level, j] >= FEWEST_STEEP
            if steep:
                steep_met += 1
            if abs(error) > gate_m:
                break
            matched += 1
            ages_ns += stamp_ns - first_ns[level, j]
            known[i] = old
            if steep:
                steep_ones += 1
            elif nz < STEEP:
                break
            else:
                nx, ny, nz = 0.0, 0.0, 1.0
            row[0], row[1], row[2] = ly * nz - lz * ny, lz * nx - lx * nz, lx * ny - ly * nx
            row[3], row[4], row[5] = nx, ny, nz
            weight = precision / (1 + error * error * precision) ** 2
            for a in range(6):
                right[a] -= weight * row[a] * error
                for b in range(6):
                    left[a, b] += weight * row[a] * row[b]
            break
    return met, matched, steep_met, steep_ones, ages_ns // max(matched, 1)
