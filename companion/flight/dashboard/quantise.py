"""Kernels that quantise and downsample one layer of the page's blocks."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Float32, Strided2D
from slz.kernels.jit import kernel, kernel_part

MIDDLE = 32_768
NO_HEIGHT = np.uint16(0)
NO_VALUE = np.uint8(255)
_UNSAFE, _SAFE, _UNKNOWN = 0, 1, 255  # same as in `slz.terrain.terrain_maps`

Floats = Array2D[np.float32]
Small = Array2D[np.uint8]
Heights = Array2D[np.uint16]


@kernel_part
def _steps(value: Float32, step: float) -> np.uint8:
    """Return a value in steps, at most 254; 255 if unknown."""
    if np.isnan(value):
        return np.uint8(255)
    return np.uint8(min(254.0, max(0.0, np.rint(value / step))))


@kernel_part
def _height(value: Float32, base_m: float, step_m: float) -> np.uint16:
    """Return a height in steps above a base, 1 to 65535; 0 if unknown."""
    if np.isnan(value):
        return np.uint16(0)
    return np.uint16(min(65_535.0, max(1.0, np.rint((value - base_m) / step_m))))


@kernel
def quantise_heights(values: Floats, base_m: float, step_m: float, out: Strided2D[np.uint16]) -> bool:
    """Overwrite quantised heights with new ones; return whether any changed."""
    changed = np.uint16(0)
    for row in range(values.shape[0]):
        for col in range(values.shape[1]):
            number = _height(values[row, col], base_m, step_m)
            changed |= number ^ out[row, col]  # no branch, so that it is done for several cells at a time
            out[row, col] = number
    return bool(changed != 0)


@kernel
def quantise(values: Floats, step: float, state: Small, of_known: bool, out: Strided2D[np.uint8]) -> bool:
    """Overwrite a quantised layer with new values; return whether any changed.

    of_known: a value is unknown where the state is.
    """
    changed = np.uint8(0)
    for row in range(values.shape[0]):
        for col in range(values.shape[1]):
            number = _steps(values[row, col], step)
            if of_known and state[row, col] == _UNKNOWN:
                number = np.uint8(255)
            changed |= number ^ out[row, col]
            out[row, col] = number
    return bool(changed != 0)


@kernel
def halve_heights(heights: Heights, shift: int, out: Strided2D[np.uint16]) -> None:
    """Downsample squares of four cells to the mean of their known heights, plus `shift` for another base."""
    for row in range(out.shape[0]):
        for col in range(out.shape[1]):
            total, count = 0, 0
            for i in range(2 * row, 2 * row + 2):
                for j in range(2 * col, 2 * col + 2):
                    if heights[i, j] != 0:
                        total += int(heights[i, j])
                        count += 1
            out[row, col] = min(65_535, max(1, total // count + shift)) if count > 0 else 0


@kernel
def halve(values: Small, lowest: bool, out: Strided2D[np.uint8]) -> None:
    """Downsample squares of four cells to the lowest, or highest, of their known values."""
    for row in range(out.shape[0]):
        for col in range(out.shape[1]):
            least, most = np.int64(255), np.int64(-1)
            for i in range(2 * row, 2 * row + 2):
                for j in range(2 * col, 2 * col + 2):
                    number = np.int64(values[i, j])
                    least = min(least, number)
                    if number != 255:
                        most = max(most, number)
            out[row, col] = least if lowest or most < 0 else most


@kernel
def halve_states(states: Small, out: Strided2D[np.uint8]) -> None:
    """Downsample squares of four cells: unsafe if one is unsafe, else unknown if one is unknown."""
    for row in range(out.shape[0]):
        for col in range(out.shape[1]):
            unsafe, safe = 0, 0
            for i in range(2 * row, 2 * row + 2):
                for j in range(2 * col, 2 * col + 2):
                    unsafe += states[i, j] == _UNSAFE
                    safe += states[i, j] == _SAFE
            out[row, col] = _UNSAFE if unsafe > 0 else _SAFE if safe == 4 else _UNKNOWN
