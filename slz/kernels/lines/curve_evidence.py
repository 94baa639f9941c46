"""Evidence for a curve: what its returns have in common, and the air around it."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.elementary_functions import median
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.lines.line_votes import EAST, NORTH, SEEN, SENSOR, SIGMA, UP
from slz.kernels.lines.voxel_occupancy import VOXEL_M


@kernel_part
def _distinct(values: Array1D[np.float64]) -> int:
    """Return how many values differ, at least one; they are sorted."""
    values.sort()
    n = 1
    for k in range(1, len(values)):
        n += values[k] != values[k - 1]
    return n


@kernel
def measures(
    candidates: Array2D[np.float64],
    members: Array1D[np.int64],
    along: Array1D[np.float64],
    start: float,
) -> tuple[int, float, float, float, float, float]:
    """Return what the returns of a curve have in common.

    Number of its places that have returns; time between the first and the last (s); how far the sensor moved
    (m); and the medians of range, fall of the rays over their distance, and standard deviation of the place.

    Parameters
    ----------
    candidates, members, along
        (n, CANDIDATE_FIELDS), (m,) those on the curve, at least one, and (m,) their places along it.
    start
        Where its places begin.
    """
    ranges, falls, sigma = np.empty(len(members)), np.empty(len(members)), np.empty(len(members))
    places, moved2 = np.empty(len(members)), 0.0
    first_s, last_s = math.inf, -math.inf
    for k in range(len(members)):
        own = candidates[members[k]]
        x, y, z = own[EAST] - own[SENSOR], own[NORTH] - own[SENSOR + 1], own[UP] - own[SENSOR + 2]
        ranges[k], falls[k] = math.sqrt(x * x + y * y + z * z), -z / max(math.hypot(x, y), 0.1)
        sigma[k], places[k] = own[SIGMA], np.floor((along[k] - start) / VOXEL_M)
        first_s, last_s = min(first_s, own[SEEN]), max(last_s, own[SEEN])
    for axis in range(SENSOR, SENSOR + 3):
        low = high = candidates[members[0], axis]
        for i in members:
            low, high = min(low, candidates[i, axis]), max(high, candidates[i, axis])
        moved2 += (high - low) * (high - low)
    medians = median(ranges), median(falls), median(sigma)
    return (_distinct(places), last_s - first_s, math.sqrt(moved2), *medians)


@kernel
def fullest_share(occupied: Array2D[np.int64], above: Array2D[np.int64], least: float) -> float:
    """Return the share of the voxels around a curve that are occupied in the fullest direction.

    Its fullest ring does not count where there are others: there is room for another wire.

    Parameters
    ----------
    occupied, above
        (directions, rings) numbers of voxels: occupied, and of all high over the floor.
    least
        Voxels of a direction and ring, below which it does not count.
    """
    out = 0.0
    for d in range(len(above)):
        seen = occupied_n = rings = 0
        full, most = 0, -1.0
        for k in range(above.shape[1]):
            some = above[d, k] >= least
            share = occupied[d, k] / above[d, k] if some else 0.0
            if share > most:
                full, most = k, share
            if some:
                seen, occupied_n, rings = seen + above[d, k], occupied_n + occupied[d, k], rings + 1
        if rings > 1 and above[d, full] >= least:
            seen, occupied_n = seen - above[d, full], occupied_n - occupied[d, full]
        if seen > 0:
            out = max(out, (occupied_n + 1) / (seen + 1))
    return out
