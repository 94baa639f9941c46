"""Maps around a vehicle at the origin: level ground, with what stands on it and where one can land."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from slz import Nearby

HALF_M, CELL_M = 30.0, 0.5
N = round(2 * HALF_M / CELL_M)
Area = tuple[float, float, float, float]  # west, south, east, north


def ground_around(
    landable: Iterable[Area], walls: Iterable[tuple[Area, float]] = (), unknown: Iterable[Area] = ()
) -> Nearby:
    """Return level ground with walls of a height, and ground that nobody has seen."""
    level = np.zeros((N, N), np.float32)
    top, safe = level.copy(), np.zeros((N, N), bool)
    for area, height_m in walls:
        top[blocks(area)] = height_m
    for area in unknown:
        top[blocks(area)] = level[blocks(area)] = np.nan
    for area in landable:
        safe[blocks(area)] = True
    return Nearby(-HALF_M, -HALF_M, CELL_M, level, top, safe)


def blocks(area: Area) -> tuple[slice, slice]:
    west, south, east, north = (round((edge + HALF_M) / CELL_M) for edge in area)
    return slice(south, north), slice(west, east)
