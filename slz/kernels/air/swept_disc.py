"""Swept disc: what a vehicle covers on a straight way to a point.

The vehicle is a disc of `radius` + `spread` times its distance to the point, as its place grows uncertain. On
a corridor of a slope its underside is the tangent times that distance above the floor, its top `height` more.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.jit import kernel_part


@kernel_part
def passes(along: float, aside: float, radius: float, spread: float) -> tuple[float, float]:
    """Return the least and greatest distance to the point at which the disc covers a place; not below 0.

    along, aside: coordinates of the place from the point, along the way and across it (m). The first is
    greater than the second where the disc never covers it.
    """
    b, a = along + spread * radius, 1 - spread * spread
    root2 = b * b - a * (along * along + aside * aside - radius * radius)
    if root2 < 0:
        return 1.0, 0.0
    root = np.sqrt(root2)
    if b + root < 0:
        return 1.0, 0.0
    return max(0.0, (b - root) / a), (b + root) / a


@kernel_part
def bearings_within(away: float, radius: float, spread: float, width: float) -> int:
    """Return how many steps of `width` (rad) to each side corridors may cover a place so far `away`."""
    nearest = (away - radius) / (1 + spread)  # of the vehicle to the point, when it covers the place
    sine = 1.0 if nearest <= 0 else min(1.0, radius / nearest + spread)
    return int(min(np.ceil((np.pi if sine == 1.0 else np.arcsin(sine)) / width), np.floor(np.pi / width)))
