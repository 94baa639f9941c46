"""Search for new wires among stored returns: lines by a Hough transform, grown to sagging curves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.kernels.lines.curve_fit import FIELDS, GATES, grow_curve
from slz.kernels.lines.line_votes import BEARINGS, SLOPES, STEEPEST, line_votes
from slz.kernels.lines.voxel_occupancy import VOXEL_M
from slz.wires.false_alarms import PER_WINDOW, log_false_alarms
from slz.wires.occupied_air import OccupiedAir
from slz.wires.sagging_curve import SaggingCurve
from slz.wires.wire_candidates import WireCandidates

MOST_SEEDS, FEWEST_SEEDS = 24, 8  # returns of a window through which lines are sought
MOST_PAIRS = 10_000  # of a seed and a stored return, beyond which there are fewer seeds
TRIED = 4  # lines of a window that are tested
FEWEST = 6  # places of a wire that have returns
SHORTEST_M = 8.0
FEWEST_WINDOWS = 2
BASELINE = (
    0.08  # of the range, by which the sensor must have moved: lines of a scan on a surface move with it
)
LEAST_BASELINE_M = 1.0
LEVEL = 0.15  # fall of rays over their distance, up to which they would meet a wall below a curve
MOST_MISFIT = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Curve that is a wire: which of the candidates are its returns, and from where to where along it."""

    curve: SaggingCurve
    members: NDArray[np.int64]
    start_m: float
    stop_m: float


def new_wires(candidates: WireCandidates, first_new: int, air: OccupiedAir) -> Iterator[Found]:
    """Yield the wires that some of the newest returns, from index `first_new` on, belong to."""
    n = len(candidates)
    if n < FEWEST or first_new >= n:
        return
    new = np.arange(first_new, n)
    some = min(MOST_SEEDS, max(FEWEST_SEEDS, MOST_PAIRS // n))
    seeds = np.ascontiguousarray(new[:: -(-len(new) // some)])
    votes = np.empty((BEARINGS, SLOPES), np.int32)
    lines = line_votes(seeds, candidates.points_enu_m, candidates.sigma_m, votes)
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
        if _is_wire(grown, candidates, air):
            yield grown


def _grown(
    candidates: WireCandidates, free: NDArray[np.bool_], seed: int, bearing: float, slope: float
) -> Found | None:
    """Return the curve that grows from a line through a return."""
    points, sigma, fields = candidates.points_enu_m, candidates.sigma_m, np.empty(FIELDS)
    members = grow_curve(points, sigma, free, seed, bearing, slope, FEWEST, fields)
    if not len(members):
        return None
    curve = SaggingCurve.of(fields)
    if curve.misfit > MOST_MISFIT or abs(curve.heights[1]) > STEEPEST:
        return None
    along_m, _ = curve.distances_m(points[members])
    return Found(curve, members, float(along_m.min()), float(along_m.max()))


def _is_wire(found: Found, candidates: WireCandidates, air: OccupiedAir) -> bool:
    """Return whether neither clutter nor a surface explains a curve."""
    length_m = found.stop_m - found.start_m
    own = candidates.some(found.members)
    along_m, _ = found.curve.distances_m(own.points_enu_m)
    on_curve = len(np.unique(np.floor((along_m - found.start_m) / VOXEL_M)))
    if length_m < SHORTEST_M or on_curve < FEWEST or len(np.unique(own.window)) < FEWEST_WINDOWS:
        return False
    ranges = np.linalg.norm(own.points_enu_m - own.sensors_enu_m, axis=1)
    moved_m = float(np.linalg.norm(np.ptp(own.sensors_enu_m, axis=0)))
    if moved_m < max(LEAST_BASELINE_M, BASELINE * float(np.median(ranges))):
        return False
    alarms = _log_false_alarms(found, own, len(candidates), air)
    return alarms is not None and alarms < math.log(PER_WINDOW)


def is_explained(found: Found, own: WireCandidates, air: OccupiedAir) -> bool:
    """Return whether what is known by now explains a wire: it is part of a surface, or low over the floor."""
    if not air.around(found.curve, found.start_m, found.stop_m).is_high(_places(found)):
        return True
    alarms = _log_false_alarms(found, own, len(own), air)
    return alarms is not None and alarms > 0


def _places(found: Found) -> int:
    return round((found.stop_m - found.start_m) / VOXEL_M) + 1


def _log_false_alarms(found: Found, own: WireCandidates, stored: int, air: OccupiedAir) -> float | None:
    """Return the logarithm of the expected number of false alarms, None where a wall or ground may be below.

    A wall seen from above has an edge like a wire. Either rays passed below, or the sensor was low enough to
    see a wall.
    """
    around = air.around(found.curve, found.start_m, found.stop_m)
    way = own.points_enu_m - own.sensors_enu_m
    steepness = float(np.median(-way[:, 2] / np.maximum(np.hypot(way[:, 0], way[:, 1]), 0.1)))
    places = _places(found)
    if not around.is_high(places) or (steepness > LEVEL and not around.below_is_seen):
        return None
    along_m, _ = found.curve.distances_m(own.points_enu_m)
    on_curve = len(np.unique(np.floor((along_m - found.start_m) / VOXEL_M)))
    places = max(on_curve, places)
    tube_m = GATES[-1] * float(np.median(own.sigma_m))
    return log_false_alarms(on_curve, places, tube_m, around.occupied, around.above, stored)
