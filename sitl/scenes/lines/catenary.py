"""Spans of wire with sag: a catenary between two points, in straight pieces."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Kind, Wire

F64 = NDArray[np.float64]
Point = tuple[float, float, float]

ERROR_M = 0.8e-3
"""Greatest height of the catenary below the chord of a piece."""


def constant_m(length_m: float, rise_m: float, sag_m: float) -> float:
    """Return the catenary constant (horizontal tension per weight) of a span.

    Parameters
    ----------
    length_m, rise_m
        Horizontal distance and difference of the heights of the ends.
    sag_m
        Height of the chord over the wire at mid-span.
    """
    low, high = 1e-2 * length_m, 1e7 * length_m
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _sag_m(middle, length_m, rise_m) > sag_m else (low, middle)
    return math.sqrt(low * high)


def heights_m(along_m: F64, length_m: float, rise_m: float, sag_m: float) -> F64:
    """Return the heights of a span over its start at horizontal distances from it."""
    a = constant_m(length_m, rise_m, sag_m)
    lowest = length_m / 2 - a * math.asinh(rise_m / (2 * a * math.sinh(length_m / (2 * a))))
    heights: F64 = a * (np.cosh((along_m - lowest) / a) - math.cosh(lowest / a))
    return heights


def span(
    name: str, start: Point, end: Point, sag_m: float, radius_m: float, kind: Kind = Kind.METAL
) -> list[Wire]:
    """Return a span whose pieces depart from the catenary by less than 1 mm; no sag is one straight piece."""
    length, rise = math.dist(start[:2], end[:2]), end[2] - start[2]
    count = 1
    if sag_m > 0.0:
        a = constant_m(length, rise, sag_m)
        steepest = abs(math.asinh(rise / (2 * a * math.sinh(length / (2 * a))))) + length / (2 * a)
        count = math.ceil(length / math.sqrt(8.0 * a * ERROR_M / math.cosh(steepest)))
    share = np.linspace(0.0, 1.0, count + 1)
    x, y = (start[k] + share * (end[k] - start[k]) for k in (0, 1))
    z = start[2] + (heights_m(share * length, length, rise, sag_m) if sag_m > 0.0 else share * rise)
    nodes = [tuple(map(float, node)) for node in zip(x, y, z, strict=True)]
    return [
        Wire((a[0], a[1], a[2]), (b[0], b[1], b[2]), radius_m, kind, f"{name}-{k}")
        for k, (a, b) in enumerate(itertools.pairwise(nodes))
    ]


def _sag_m(a: float, length_m: float, rise_m: float) -> float:
    half = length_m / (2 * a)
    if half > 300.0:  # beyond the range of cosh
        return math.inf
    slope = rise_m / (2 * a * math.sinh(half))
    # cosh(half) - 1 without the loss of digits where the wire is tight.
    return 2 * a * math.sqrt(1.0 + slope * slope) * math.sinh(half / 2) ** 2
