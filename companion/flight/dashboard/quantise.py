"""Kernels that quantise and downsample maps for the page's blocks."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Float32, Strided2D
from slz.kernels.jit import kernel

STEP_M = 0.005  # height step
MIDDLE = 32_768
NO_HEIGHT = np.uint16(0)
NO_VALUE = np.uint8(255)
SLOPE_STEP_DEG, RELIEF_STEP_M, CERTAINTY_STEP = 0.25, 0.01, 0.005
_UNSAFE, _SAFE, _UNKNOWN = 0, 1, 255  # same as in `slz.terrain.terrain_maps`

Floats = Array2D[np.float32]


@kernel
def _steps(value: Float32, step: float) -> np.uint8:
    """Return a value in steps, at most 254; 255 if unknown."""
    if np.isnan(value):
        return np.uint8(255)
    return np.uint8(min(254.0, max(0.0, np.rint(value / step))))


@kernel
def _height(value: Float32, base_m: float) -> np.uint16:
    """Return a height in steps above a base, 1 to 65535; 0 if unknown."""
    if np.isnan(value):
        return np.uint16(0)
    return np.uint16(min(65_535.0, max(1.0, np.rint((value - base_m) / STEP_M))))


@kernel
def quantise(
    height_m: Floats,
    slope_deg: Floats,
    relief_m: Floats,
    certainty: Floats,
    state: Array2D[np.uint8],
    base_m: float,
    height: Strided2D[np.uint16],
    slope: Strided2D[np.uint8],
    relief: Strided2D[np.uint8],
    sure: Strided2D[np.uint8],
    verdict: Strided2D[np.uint8],
) -> bool:
    """Overwrite quantised maps with new ones; return whether anything changed.

    The certainty of an unknown cell is unknown.
    """
    changed = False
    for row in range(state.shape[0]):
        for col in range(state.shape[1]):
            h = _height(height_m[row, col], base_m)
            s = _steps(slope_deg[row, col], SLOPE_STEP_DEG)
            r = _steps(relief_m[row, col], RELIEF_STEP_M)
            v = state[row, col]
            c = np.uint8(255) if v == _UNKNOWN else _steps(certainty[row, col], CERTAINTY_STEP)
            if (
                h != height[row, col]
                or s != slope[row, col]
                or r != relief[row, col]
                or c != sure[row, col]
                or v != verdict[row, col]
            ):
                changed = True
                height[row, col] = h
                slope[row, col] = s
                relief[row, col] = r
                sure[row, col] = c
                verdict[row, col] = v
    return changed


@kernel
def halve(
    height: Array2D[np.uint16],
    slope: Array2D[np.uint8],
    relief: Array2D[np.uint8],
    sure: Array2D[np.uint8],
    verdict: Array2D[np.uint8],
    shift: int,
    out_height: Strided2D[np.uint16],
    out_slope: Strided2D[np.uint8],
    out_relief: Strided2D[np.uint8],
    out_sure: Strided2D[np.uint8],
    out_verdict: Strided2D[np.uint8],
) -> None:
    """Downsample squares of four cells to one: see `companion.flight.dashboard.map_block.coarser`.

    shift: steps to add to heights, for another base.
    """
    for row in range(out_verdict.shape[0]):
        for col in range(out_verdict.shape[1]):
            total, count, unsafe, safe = 0, 0, 0, 0
            least, steepest, roughest = np.int64(255), np.int64(-1), np.int64(-1)
            for i in range(2 * row, 2 * row + 2):
                for j in range(2 * col, 2 * col + 2):
                    if height[i, j] != 0:
                        total += int(height[i, j])
                        count += 1
                    if slope[i, j] != 255:
                        steepest = max(steepest, np.int64(slope[i, j]))
                    if relief[i, j] != 255:
                        roughest = max(roughest, np.int64(relief[i, j]))
                    least = min(least, np.int64(sure[i, j]))
                    unsafe += verdict[i, j] == _UNSAFE
                    safe += verdict[i, j] == _SAFE
            out_height[row, col] = min(65_535, max(1, total // count + shift)) if count > 0 else 0
            out_slope[row, col] = steepest if steepest >= 0 else 255
            out_relief[row, col] = roughest if roughest >= 0 else 255
            out_sure[row, col] = least
            out_verdict[row, col] = _UNSAFE if unsafe > 0 else _SAFE if safe == 4 else _UNKNOWN
