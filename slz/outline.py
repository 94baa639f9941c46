"""A zone as polygons with holes, of few points and without any unsafe cell (SLZ thesis, future work)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from slz.kernels.outline import edges, simplified

Ring = NDArray[np.int32]

DEPTHS = (8.0, 6.0, 4.0, 3.0, 2.0, 1.5, 1.0, 0.5, 0.0)  # cells that a chord may cut off, tried in turn


@dataclass(frozen=True, slots=True)
class Polygon:
    """A polygon with holes.

    Rings are (n, 2), the first point not repeated, the outer one anticlockwise, holes clockwise.
    """

    outer: NDArray[np.float64]
    holes: tuple[NDArray[np.float64], ...]


def outline(cells: NDArray[np.uint8], most_lost: float = 0.02) -> tuple[Polygon, ...]:
    """Return the outline of the set cells in units of cells, (column, row) from the array's corner.

    The polygons hold the centre of no other cell, and lose at most the share `most_lost` of the area. Cells
    that touch at a corner only belong to separate polygons.
    """
    rings = [(ring, _area(ring)) for ring in _split(edges(np.ascontiguousarray(cells, np.uint8)))]
    outers = [(ring, area) for ring, area in rings if area > 0]
    nested: list[list[Ring]] = [[ring] for ring, _ in outers]
    for ring, area in rings:
        if area < 0:
            nested[_owner(ring, outers)].append(ring)
    return tuple(_polygon(group, most_lost) for group in nested)


def _split(found: NDArray[np.int32]) -> list[Ring]:
    return np.split(found[:, 1:], np.flatnonzero(np.diff(found[:, 0])) + 1) if len(found) else []


def _polygon(rings: list[Ring], most_lost: float) -> Polygon:
    """Simplify rings as deep as the area allows; where they come to touch, keep the middle of every step."""
    rings = [np.roll(ring, -int(np.argmax(_corners(ring))), axis=0) for ring in rings]
    least = (1 - most_lost) * sum(map(_area, rings))
    for depth in DEPTHS:
        simple = [simplified(ring, depth) for ring in rings]
        if min(map(len, simple)) >= 3:
            polygon = shapely.Polygon(simple[0], simple[1:])
            if (polygon.area >= least or depth == 0) and polygon.is_valid:
                return Polygon(simple[0], tuple(simple[1:]))
    middles = [((ring + np.roll(ring, -1, axis=0)) / 2)[:, ::-1] for ring in rings]
    return Polygon(middles[0], tuple(middles[1:]))


def _corners(ring: Ring) -> NDArray[np.bool_]:
    return np.asarray((np.roll(ring, -1, axis=0) != np.roll(ring, 1, axis=0)).all(axis=1))


def _area(ring: Ring) -> float:
    y, x = ring[:, 0].astype(np.int64), ring[:, 1].astype(np.int64)
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _owner(hole: Ring, outers: list[tuple[Ring, float]]) -> int:
    """Return which outer ring, of those around the hole, is the smallest."""
    around = [i for i, (outer, _) in enumerate(outers) if len(outers) == 1 or _holds(outer, hole)]
    return min(around, key=lambda i: outers[i][1])


def _holds(outer: Ring, hole: Ring) -> bool:
    """Tell whether a hole lies inside a ring, by the crossings of a ray east from beside its first step."""
    (y0, x0), (y1, x1) = hole[0].tolist(), hole[1].tolist()
    y, x = (y0 + y1) / 2 - 0.25 * (x1 - x0), (x0 + x1) / 2 + 0.25 * (y1 - y0)  # its right side is the hole
    rows, cols = outer[:, 0], outer[:, 1]
    crosses = (rows > y) != (np.roll(rows, -1) > y)
    return bool((crosses & (cols > x)).sum() % 2)
