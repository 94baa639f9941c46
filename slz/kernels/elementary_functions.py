"""Elementary functions: ranks and medians, arc tangents (SIMD), piecewise linear functions."""

from __future__ import annotations

from typing import Any

import numpy as np

from slz.kernels.jit import kernel_for_any_types
from slz.kernels.simd import Floats, broadcast, where

F0, F1 = np.float32(0.0), np.float32(1.0)
TAN_1, TAN_3 = np.float32(0.4142135623730950), np.float32(2.414213562373095)  # tan of pi / 8 and 3 pi / 8
QUARTER, RIGHT = np.float32(np.pi / 4), np.float32(np.pi / 2)
A3, A5, A7, A9 = (
    np.float32(a) for a in (-3.33329491539e-1, 1.99777106478e-1, -1.38776856032e-1, 8.05374449538e-2)
)


@kernel_for_any_types
def ranked(values: Any, rank: int) -> Any:
    """Return the value of a rank, from 0 on; the values are moved so that lower ones come before it."""
    first, last = 0, len(values) - 1
    while first < last:
        pivot, i, j = values[(first + last) // 2], first, last
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if rank <= j:
            last = j
        elif rank >= i:
            first = i
        else:
            break
    return values[rank]


@kernel_for_any_types
def median(values: Any) -> Any:
    """Return the median, of an even number the mean of both in the middle; the values are moved."""
    n = len(values)
    upper = ranked(values, n // 2)
    return upper if n % 2 else (ranked(values, n // 2 - 1) + upper) / 2


@kernel_for_any_types
def arctangent(x: Floats) -> Floats:
    """Return the arc tangents of 16 numbers >= 0 (Cephes polynomial, relative error 2e-7); NaN of NaN."""
    one = broadcast(F1)
    large, middle = broadcast(TAN_3) < x, broadcast(TAN_1) < x
    r = where(large, broadcast(-F1), where(middle, x - one, x)) / where(large, x, where(middle, x + one, one))
    z = r * r
    start = where(large, broadcast(RIGHT), where(middle, broadcast(QUARTER), broadcast(F0)))
    return start + (
        (((broadcast(A9) * z + broadcast(A7)) * z + broadcast(A5)) * z + broadcast(A3)) * z * r + r
    )


@kernel_for_any_types
def interpolate(x: Any, places: tuple[float, ...], values: tuple[float, ...]) -> Any:
    """Return the value at x between the values at ascending places; beyond them that of the last."""
    if not x > places[0]:
        return values[0]
    for k in range(1, len(places)):
        if x < places[k]:
            slope = (values[k] - values[k - 1]) / (places[k] - places[k - 1])
            return slope * (x - places[k - 1]) + values[k - 1]
    return values[-1]


@kernel_for_any_types
def ramp(x: Any, low: Any, width: Any) -> Any:
    """Return how far x is from `low` to `low + width`, from 0 to 1, in the precision of the arguments."""
    return min(max((x - low) / width, F0), F1)
