"""Polygonisation of a zone: few vertices, holes, and no unsafe cell inside (SLZ thesis, future work)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from slz.kernels.polygons.boundary_tracing import boundary_rings, corner_indices
from slz.kernels.polygons.inner_simplification import simplify_inside

Ring = NDArray[np.int32]
Points = NDArray[np.float64]
# Attempts until the points are few: distance in cells that the line may run outside the zone's cells, towards
# the centre of the next cell, and multiple of the area share that may be lost in cell centres.
ATTEMPTS = ((0.0, 1.0), (0.49, 1.0), (0.49, 2.0))
REACHES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.49)
FEW_POINTS = (
    1 / 7
)  # share of the corners: a fifth of what the collinear filter leaves, which is up to a third less
ENOUGH_POINTS = 1 / 10  # share of the corners, below which area counts for more than points


def without_collinear(boundary_cells: NDArray[np.int32]) -> NDArray[np.int32]:
    """Drop points between two neighbours in the same row or the same column (SLZ paper, Algorithm 2).

    The algorithm as printed also loses corners where a run in x meets a diagonal. Here a point is dropped
    only between two neighbours of its row, or of its column, so the polygon is unchanged.

    Parameters
    ----------
    boundary_cells
        (n, 2) rows and columns of a closed contour.
    """
    return boundary_cells[corner_indices(np.ascontiguousarray(boundary_cells, np.int32))]


@dataclass(frozen=True, slots=True)
class Polygon:
    """Polygon with holes.

    Rings are (n, 2), the first point not repeated, the outer one anticlockwise, holes clockwise.
    """

    outer: Points
    holes: tuple[Points, ...]


def polygonise(cells: NDArray[np.uint8], most_lost: float = 0.02) -> tuple[Polygon, ...]:
    """Return the polygons of the set cells in units of cells, (column, row) from the array's corner.

    The polygons hold the centre of no other cell, and their area differs from that of the cells by at most
    the share `most_lost`. They leave out the centres of at most that share of the cells, or of up to twice
    that share where the line then needs fewer points. The line may run outside the cells, up to just before
    the centres of the next. Cells that touch at a corner only belong to separate polygons; small polygons may
    be left out.
    """
    rings = _split(boundary_rings(np.ascontiguousarray(cells, np.uint8)))
    if not rings:
        return ()
    areas = np.array([_area(ring) for ring in rings])
    groups = _groups(rings, areas)
    corners = sum(int(_corners(ring).sum()) for ring in rings)
    best = _whole(rings, areas, most_lost)
    most = max((1 + most_lost) * areas.sum(), sum(map(_shoelace, best)))
    for reach, times in ATTEMPTS:
        found = _few(cells, rings, areas, groups, reach, times, most_lost, int(ENOUGH_POINTS * corners))
        if found is None or sum(map(_shoelace, found)) > most:
            continue
        if _points(found) < _points(best) and _valid(found, groups):
            best = found
        if _points(best) <= FEW_POINTS * corners:
            break
    return tuple(Polygon(best[i[0]], tuple(best[j] for j in i[1:])) for i in groups if len(best[i[0]]))


def _few(
    cells: NDArray[np.uint8],
    rings: list[Ring],
    areas: Points,
    groups: list[list[int]],
    reach: float,
    times: float,
    most_lost: float,
    enough: int,
) -> list[Points] | None:
    """Return simplified rings, empty where dropped, from rings that run `reach` outside the cells."""
    start = [_beside(ring, reach) for ring in rings]
    size = np.array([_shoelace(ring) for ring in start])
    total = areas.sum()
    spare = size.sum() - (1 - most_lost) * total
    if spare < 0:
        return None
    worth = np.full((len(rings), 2), np.inf)
    for group in groups:
        if len(group) == 1 and group[0] != areas.argmax():
            worth[group[0]] = size[group[0]], areas[group[0]]
    sums = np.zeros((cells.shape[0], cells.shape[1] + 1), np.int32)
    np.cumsum(cells != 0, axis=1, out=sums[:, 1:])
    number = np.repeat(np.arange(len(rings)), [len(ring) for ring in start])
    left = simplify_inside(
        np.concatenate(start), number, worth, sums, spare, times * most_lost * total, enough
    )
    return [left[left[:, 0] == i, 1:] for i in range(len(rings))]


def _whole(rings: list[Ring], areas: Points, most_lost: float) -> list[Points]:
    """Return rings through the middles of the steps, moved outwards no farther than the area needs."""
    for reach in REACHES:
        found = [_beside(ring, reach) for ring in rings]
        if sum(map(_shoelace, found)) >= (1 - most_lost) * areas.sum():
            break
    return found


def _points(rings: list[Points]) -> int:
    return sum(map(len, rings))


def _valid(rings: list[Points], groups: list[list[int]]) -> bool:
    parts = [shapely.Polygon(rings[i[0]], [rings[j] for j in i[1:]]) for i in groups if len(rings[i[0]])]
    return bool(shapely.MultiPolygon(parts).is_valid)


def _beside(ring: Ring, reach: float) -> Points:
    """Return the middles of a ring's steps, moved `reach` to its right, without collinear points."""
    step = np.roll(ring, -1, axis=0) - ring
    middles = ring + step / 2 + reach * np.stack([-step[:, 1], step[:, 0]], axis=1)
    back, ahead = middles - np.roll(middles, 1, axis=0), np.roll(middles, -1, axis=0) - middles
    corners = np.abs(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]) > 1e-9
    return np.ascontiguousarray(middles[corners][:, ::-1])


def _split(found: NDArray[np.int32]) -> list[Ring]:
    return np.split(found[:, 1:], np.flatnonzero(np.diff(found[:, 0])) + 1) if len(found) else []


def _corners(ring: Ring) -> NDArray[np.bool_]:
    return np.asarray((np.roll(ring, -1, axis=0) != np.roll(ring, 1, axis=0)).all(axis=1))


def _shoelace(points: Points) -> float:
    x, y = points[:, 0], points[:, 1]
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _area(ring: Ring) -> float:
    return _shoelace(ring[:, ::-1].astype(np.float64))


def _groups(rings: list[Ring], areas: Points) -> list[list[int]]:
    """Return the indices of each outer ring and of the holes in it."""
    outers = np.flatnonzero(areas > 0).tolist()
    groups = {i: [i] for i in outers}
    for hole in np.flatnonzero(areas < 0).tolist():
        around = [i for i in outers if len(outers) == 1 or _holds(rings[i], rings[hole])]
        groups[min(around, key=lambda i: float(areas[i]))].append(hole)
    return list(groups.values())


def _holds(outer: Ring, hole: Ring) -> bool:
    """Return whether a hole is inside a ring: ray casting to the east, from beside the hole's first step."""
    (y0, x0), (y1, x1) = hole[0].tolist(), hole[1].tolist()
    y, x = (y0 + y1) / 2 - 0.25 * (x1 - x0), (x0 + x1) / 2 + 0.25 * (y1 - y0)  # on its right, in the hole
    rows, cols = outer[:, 0], outer[:, 1]
    crosses = (rows > y) != (np.roll(rows, -1) > y)
    return bool((crosses & (cols > x)).sum() % 2)
