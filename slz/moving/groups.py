"""Groups of raised returns: one for each object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

APART_M = 0.7  # horizontal distance between returns from which they are of two objects
FEWEST = 4  # returns of an object
CELL_M = 0.2  # of one place, in which returns count together: an object beside the sensor gives thousands
MOST = 3000  # cells that are grouped; of more, those with most returns

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Group:
    """Object in the returns of a moment.

    enu_m: (2,) their middle, east and north. stamp_ns: mean of their stamps. span_s: from the first to the
    last. radius_m: around the middle; an object that moves leaves a trace. height_m: over the ground, and
    ground_m: of the ground, up in the map frame.
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
    places, over, stamps, counts = _in_cells(points_enu_m[:, :2], over_m, stamp_ns)
    ground_m = points_enu_m[:, 2] - over_m
    tree = cKDTree(points_enu_m[:, :2])
    pairs = cKDTree(places).query_pairs(APART_M, output_type="ndarray")
    ones = np.ones(len(pairs), np.int8)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(places), len(places)))
    count, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels, counts, minlength=count)
    found = []
    for label in np.argsort(-sizes, kind="stable"):
        if sizes[label] < FEWEST:
            break
        own = labels == label
        middle = (places[own].min(axis=0) + places[own].max(axis=0)) / 2
        first_ns = int(stamps[own].min())
        stamp = first_ns + int(np.average(stamps[own] - first_ns, weights=counts[own]))
        radius_m = float(np.hypot(*(places[own] - middle).T).max())
        span_s = float(np.ptp(stamps[own])) * 1e-9
        below_m = float(ground_m[tree.query(middle)[1]])
        found.append(Group(middle, stamp, span_s, radius_m, float(over[own].max()), below_m))
    return found


def _in_cells(
    places: Floats, over_m: Floats, stamp_ns: NDArray[np.int64]
) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Return mean place, greatest height, mean stamp and number of the returns of each cell."""
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
        return mean, top, stamps, counts
    most = np.sort(np.argsort(-counts, kind="stable")[:MOST])
    return mean[most], top[most], stamps[most], counts[most]
