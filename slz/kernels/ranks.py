"""Values by their rank, without sorting them all; NumPy's own take seconds to compile."""

from __future__ import annotations

from typing import Any

from slz.kernels.jit import kernel_for_any_types


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
