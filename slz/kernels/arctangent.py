"""Arc tangent of sixteen lanes (SIMD)."""

from __future__ import annotations

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
