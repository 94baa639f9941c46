"""False alarms of wires: how many curves clutter and surfaces would make, with as many returns on them.

An a-contrario test: the returns on a curve are compared with those in the air around it, and the number of
curves that three of the stored returns define is known. In the plane of a surface the air beside a curve
holds as many returns as the curve itself, so each direction across the curve is tested by itself.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, log_ndtr, pdtrc

from slz.kernels.lines.curve_evidence import fullest_share
from slz.kernels.lines.voxel_occupancy import VOXEL_M

PER_SECOND = 1e-4  # false wires expected; one in three hours
DEFINING = 3  # returns that define a curve, and therefore are on it
ABOVE = 0.5  # least share of the places of a curve beside which there is air high over the floor


def log_false_alarms(
    on_curve: int,
    places: int,
    tube_m: float,
    occupied: NDArray[np.int64],
    above: NDArray[np.int64],
    returns: int,
) -> float:
    """Return the natural logarithm of the number of curves that would have as many returns by chance.

    Parameters
    ----------
    on_curve, places
        Places of the curve that have returns, of all.
    tube_m
        Distance from the curve within which returns are on it.
    occupied, above
        (directions, rings) numbers of voxels around the curve: occupied, and of all high over the floor.
    returns
        Number of stored returns; any three of them define a curve.
    """
    all_around = _share(int(occupied.sum()), int(above.sum())) * math.pi * tube_m**2 / VOXEL_M**2
    in_plane = fullest_share(occupied, above, max(1.0, ABOVE * places)) * 2 * tube_m / VOXEL_M
    expected = places * min(1.0, max(all_around, in_plane))
    tests = gammaln(returns + 1) - gammaln(max(0, returns - DEFINING) + 1) - math.log(6)
    others = on_curve - DEFINING
    chance = float(pdtrc(others - 1, expected))
    if chance > 0:
        return float(tests + math.log(chance))
    return float(tests + log_ndtr(-(others - expected) / math.sqrt(expected)))


def _share(occupied: int, above: int) -> float:
    return (occupied + 1) / (above + 1)
