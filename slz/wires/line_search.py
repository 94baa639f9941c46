"""Search for new wires among stored returns: lines by a Hough transform, grown to sagging curves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, log_ndtr, pdtrc

from slz.kernels.lines.curve_evidence import fullest_share, measures
from slz.kernels.lines.curve_fit import FIELDS, GATES, grow_curve
from slz.kernels.lines.line_votes import STEEPEST, line_votes
from slz.kernels.lines.voxel_occupancy import VOXEL_M
from slz.wires.detected_wire import SaggingCurve
from slz.wires.occupied_air import OccupiedAir, Surrounding

PER_SECOND = 1e-4  # false wires expected; one in three hours
DEFINING = 3  # returns that define a curve, and therefore are on it
ABOVE = 0.5  # least share of the places of a curve beside which there is air high over the floor
MOST_SEEDS, FEWEST_SEEDS = 24, 8  # returns of a window through which lines are sought
MOST_PAIRS = 10_000  # of a seed and a stored return, beyond which there are fewer seeds
TRIED = 4  # lines of a window that are tested
FEWEST = 6  # places of a wire that have returns
SHORTEST_M = 8.0
LEAST_TIME_S = 0.5  # between the first and the last return
BASELINE = (
    0.08  # of the range, by which the sensor must have moved: lines of a scan on a surface move with it
)
LEAST_BASELINE_M = 1.0
LEVEL = 0.15  # fall of rays over their distance, up to which they would meet a wall below a curve
MOST_MISFIT = 2.0
Floats = NDArray[np.float64]


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


class Measures(NamedTuple):
    """Statistics of the returns of a curve.

    on_curve: places that have returns. span_s: time between the first return and the last. moved_m: how far
    the sensor moved. range_m, steepness, sigma_m: medians of the distance from the sensor, of the fall of the
    rays over their distance, and of the standard deviation of the place.
    """

    on_curve: int
    span_s: float
    moved_m: float
    range_m: float
    steepness: float
    sigma_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Curve that is a wire: which of the candidates are its returns, and where along it each is (m)."""

    curve: SaggingCurve
    members: NDArray[np.int64]
    along_m: Floats
    start_m: float
    stop_m: float

    @classmethod
    def of(cls, curve: SaggingCurve, members: NDArray[np.int64], candidates: Floats) -> Self:
        """Return the curve of some candidates."""
        along_m, _ = curve.distances_m(candidates[members])
        return cls(curve, members, along_m, float(along_m.min()), float(along_m.max()))

    @property
    def places(self) -> int:
        """Number of its places, as far apart as voxels."""
        return round((self.stop_m - self.start_m) / VOXEL_M) + 1

    def measures(self, candidates: Floats) -> Measures:
        """Return what its returns have in common."""
        return Measures(*measures(candidates, self.members, self.along_m, self.start_m))


def new_wires(candidates: Floats, first_new: int, since_s: float, air: OccupiedAir) -> Iterator[Found]:
    """Yield the wires that some of the returns since the last search, from index `first_new` on, are of."""
    n = len(candidates)
    if n < FEWEST or first_new >= n:
        return
    new = np.arange(first_new, n)
    some = min(MOST_SEEDS, max(FEWEST_SEEDS, MOST_PAIRS // n))
    seeds = np.ascontiguousarray(new[:: -(-len(new) // some)])
    lines = line_votes(seeds, candidates)
    taken = np.zeros(n, bool)
    tried = 0
    for k in np.argsort(-lines[:, 0], kind="stable"):
        if lines[k, 0] < FEWEST - 1 or tried == TRIED:
            return
        if taken[seeds[k]]:
            continue
        tried += 1
        grown = _grown(candidates, ~taken, int(seeds[k]), *lines[k, 1:].tolist())
        if grown is None:
            continue
        taken[grown.members] = True  # also of one that is no wire, so that others are tried
        if _is_wire(grown, candidates, air, since_s):
            yield grown


def _grown(
    candidates: Floats, free: NDArray[np.bool_], seed: int, bearing: float, slope: float
) -> Found | None:
    """Return the curve that grows from a line through a return."""
    fields = np.empty(FIELDS)
    members = grow_curve(candidates, free, seed, bearing, slope, FEWEST, fields)
    if not len(members):
        return None
    curve = SaggingCurve.of(fields)
    if curve.misfit > MOST_MISFIT or abs(curve.heights[1]) > STEEPEST:
        return None
    return Found.of(curve, members, candidates)


def _is_wire(found: Found, candidates: Floats, air: OccupiedAir, since_s: float) -> bool:
    """Return whether neither clutter nor a surface explains a curve."""
    m = found.measures(candidates)
    if found.stop_m - found.start_m < SHORTEST_M or m.on_curve < FEWEST or m.span_s < LEAST_TIME_S:
        return False
    if m.moved_m < max(LEAST_BASELINE_M, BASELINE * m.range_m):
        return False
    around = air.around(found.curve, found.start_m, found.stop_m)
    alarms = _log_false_alarms(found, m, len(candidates), around)
    return alarms is not None and alarms < math.log(PER_SECOND * since_s)


def is_explained(found: Found, own: Floats, air: OccupiedAir) -> bool:
    """Return whether what is known by now explains a wire: it is part of a surface, or low over the floor."""
    around = air.around(found.curve, found.start_m, found.stop_m)
    if not around.is_high(found.places):
        return True
    alarms = _log_false_alarms(found, found.measures(own), len(own), around)
    return alarms is not None and alarms > 0


def _log_false_alarms(found: Found, m: Measures, stored: int, around: Surrounding) -> float | None:
    """Return the logarithm of the expected number of false alarms, None where a wall or ground may be below.

    A wall seen from above has an edge like a wire. Either rays passed below, or the sensor was low enough to
    see a wall.
    """
    if not around.is_high(found.places) or (m.steepness > LEVEL and not around.below_is_seen):
        return None
    places, tube_m = max(m.on_curve, found.places), GATES[-1] * m.sigma_m
    return log_false_alarms(m.on_curve, places, tube_m, around.occupied, around.above, stored)
