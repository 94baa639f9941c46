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
MOST = 3000  # returns that are grouped; more are thinned

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Group:
    """Object in the returns of a moment.

    enu_m: (2,) their middle, east and north. stamp_ns: mean of their stamps. span_s: from the first to the
    last. radius_m: around the middle; an object that moves leaves a trace. height_m: over the ground.
    """

    enu_m: Floats
    stamp_ns: int
    span_s: float
    radius_m: float
    height_m: float
    count: int


def groups(points_enu_m: Floats, over_m: Floats, stamp_ns: NDArray[np.int64]) -> list[Group]:
    """Return the groups of returns, the one with most returns first.

    Parameters
    ----------
    points_enu_m, over_m, stamp_ns
        (n, 3), (n,) heights over the ground, and (n,).
    """
    every = -(-len(points_enu_m) // MOST) or 1
    places, over, stamps = points_enu_m[::every, :2], over_m[::every], stamp_ns[::every]
    if len(places) < FEWEST:
        return []
    pairs = cKDTree(places).query_pairs(APART_M, output_type="ndarray")
    ones = np.ones(len(pairs), np.int8)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(places), len(places)))
    count, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels, minlength=count)
    found = []
    for label in np.argsort(-sizes, kind="stable"):
        if sizes[label] < FEWEST:
            break
        own = labels == label
        middle = (places[own].min(axis=0) + places[own].max(axis=0)) / 2
        first_ns = int(stamps[own][0])
        stamp = first_ns + int(np.mean(stamps[own] - first_ns))
        radius_m = float(np.hypot(*(places[own] - middle).T).max())
        span_s = float(np.ptp(stamps[own])) * 1e-9
        found.append(Group(middle, stamp, span_s, radius_m, float(over[own].max()), int(sizes[label])))
    return found
