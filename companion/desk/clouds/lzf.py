"""Kernel that unpacks LZF (Lehmann's format), as PCD files use it.

A control byte below 32 is followed by that many bytes and one, as they are. Any other one tells of bytes to
repeat: three bits of length, where seven means that the next byte adds to it, and thirteen bits of distance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

MOST_RATIO = 100  # three bytes become 264 at most


@kernel("int64(Array(uint8, 1, 'C', True), uint8[::1])")
def unpack(packed: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Unpack into `out` and return how many bytes were written; -1 if the packed bytes make no sense."""
    n, most = len(packed), len(out)
    i = o = 0
    while i < n:
        control = int(packed[i])
        i += 1
        if control < 32:
            length = control + 1
            if i + length > n or o + length > most:
                return -1
            for _ in range(length):
                out[o] = packed[i]
                i += 1
                o += 1
            continue
        length = control >> 5
        if length == 7:
            if i >= n:
                return -1
            length += int(packed[i])
            i += 1
        if i >= n:
            return -1
        source = o - ((control & 31) << 8) - int(packed[i]) - 1
        i += 1
        length += 2
        if source < 0 or o + length > most:
            return -1
        for _ in range(length):
            out[o] = out[source]
            source += 1
            o += 1
    return o
