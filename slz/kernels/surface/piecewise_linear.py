"""Piecewise linear functions, from which the rules make log odds."""

from __future__ import annotations

from typing import Any

import numpy as np

from slz.kernels.jit import kernel_for_any_types

F0, F1 = np.float32(0), np.float32(1)


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
