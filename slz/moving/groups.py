"""Groups of raised returns: one for each object."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

APART_M = 0.7  # horizontal distance between returns from which they are of two objects
FEWEST, MOST_FEWEST = 3, 8  # returns of an object: in clear air, and in the densest dust
BY_CHANCE = 0.01  # groups that specks form
LEAST_AREA_M2 = 100.0  # over which specks are spread
NEWEST_NS = 100_000_000  # in which a Mid-360 sweeps its field of view once
CELL_M = 0.2  # of one place, in which returns count together: an object beside the sensor gives thousands
MOST = 3000  # cells that are grouped; of more, those with most returns

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Group:
    """Object in the returns of a moment.

    enu_m: (2,) middle of its newest returns, east and north. stamp_ns: mean of their stamps. span_s: from the
    first of all to the last. radius_m: around the middle of all; an object that moves leaves a trace.
    height_m: over the ground, and ground_m: of the ground, up in the map frame.
    """

    enu_m: Floats
    stamp_ns: int
    span_s: float
    radius_m: float
    height_m: float
    ground_m: float


def groups(points_enu_m: Floats, over_m: Floats, stamp_ns: NDArray[np.int64]) -> list[Group]:
    """Return the groups of returns, the one with most returns first.

    Parameters
    ----------
    points_enu_m, over_m, stamp_ns
        (n, 3), (n,) heights over the ground, and (n,).
    """
    if len(points_enu_m) < FEWEST:
        return []
    places, over, stamps, counts, cell_of = _in_cells(points_enu_m[:, :2], over_m, stamp_ns)
    ground_m = points_enu_m[:, 2] - over_m
    tree = cKDTree(points_enu_m[:, :2])
    pairs = cKDTree(places).query_pairs(APART_M, output_type="ndarray")
    ones = np.ones(len(pairs), np.int8)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(places), len(places)))
    count, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels, counts, minlength=count)
    fewest = _fewest(sizes, places, labels)
    found = []
    for label in np.argsort(-sizes, kind="stable"):
        if sizes[label] < fewest:
            break
        own = labels == label
        middle = (places[own].min(axis=0) + places[own].max(axis=0)) / 2
        newest = _newest(stamp_ns, np.flatnonzero(np.append(own, False)[cell_of]))
        where, when = points_enu_m[newest, :2], stamp_ns[newest]
        place = (where.min(axis=0) + where.max(axis=0)) / 2
        stamp = int(when[0]) + int(np.mean(when - when[0]))
        radius_m = float(np.hypot(*(places[own] - middle).T).max())
        span_s = float(np.ptp(stamps[own])) * 1e-9
        below_m = float(ground_m[tree.query(middle)[1]])
        found.append(Group(place, stamp, span_s, radius_m, float(over[own].max()), below_m))
    return found


def _fewest(sizes: NDArray[np.integer], places: Floats, labels: NDArray[np.integer]) -> int:
    """Return the least size of a group that specks do not form by chance.

    Specks are the returns in groups smaller than the smallest object.
    """
    specks = sizes < FEWEST
    count = float(sizes[specks].sum())
    if count < FEWEST:
        return FEWEST
    area_m2 = max(LEAST_AREA_M2, float(np.prod(np.ptp(places[specks[labels]], axis=0))))
    beside = count * math.pi * APART_M**2 / area_m2  # others that are near one
    by_chance = (
        count * beside ** (size - 1) / math.factorial(size - 1) for size in range(FEWEST, MOST_FEWEST)
    )
    return next((k for k, expected in enumerate(by_chance, FEWEST) if expected < BY_CHANCE), MOST_FEWEST)


def _newest(stamp_ns: NDArray[np.int64], own: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return which of an object's returns are of the last `NEWEST_NS`, or the last few if these are fewer."""
    stamps = stamp_ns[own]
    fewest = np.partition(stamps, len(stamps) - FEWEST)[len(stamps) - FEWEST]
    return own[stamps >= min(int(fewest), int(stamps.max()) - NEWEST_NS)]


def _in_cells(
    places: Floats, over_m: Floats, stamp_ns: NDArray[np.int64]
) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.int64], NDArray[np.intp]]:
    """Return mean place, greatest height, mean stamp and number of the returns of each cell.

    And the cell of each return, -1 for one that is left out.
    """
    cells = np.floor(places / CELL_M).astype(np.int64)
    _, first, of_cell, counts = np.unique(
        cells, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    of_cell = of_cell.reshape(-1)
    mean = np.column_stack([np.bincount(of_cell, places[:, k]) for k in (0, 1)]) / counts[:, None]
    top = np.full(len(counts), -np.inf)
    np.maximum.at(top, of_cell, over_m)
    start_ns = int(stamp_ns[first].min())
    stamps = start_ns + (np.bincount(of_cell, stamp_ns - start_ns) / counts).astype(np.int64)
    if len(counts) <= MOST:
        return mean, top, stamps, counts, of_cell
    most = np.sort(np.argsort(-counts, kind="stable")[:MOST])
    kept = np.full(len(counts), -1)
    kept[most] = np.arange(len(most))
    return mean[most], top[most], stamps[most], counts[most], kept[of_cell]
