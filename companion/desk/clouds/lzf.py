"""LZF decompression kernel (Lehmann's format, as used by PCD files).

A control byte below 32 is followed by control + 1 literal bytes. Any other control byte is a back
reference: three bits of length, where 7 means that the next byte is added, and 13 bits of distance.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, ReadOnly1D
from slz.kernels.jit import kernel

MOST_RATIO = 100  # three bytes become at most 264


@kernel
def unpack(packed: ReadOnly1D[np.uint8], out: Array1D[np.uint8]) -> int:
    """Decompress into `out` and return the number of bytes written; -1 if the input is invalid."""
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
