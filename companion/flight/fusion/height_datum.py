"""Height datum of the autopilot's estimate, followed by the ground: a barometer jumps, the ground does not.

An estimate that fuses another height slides by metres within seconds, and ground seen before would become a
step. Each scan is compared with the ground of the last seconds. What it is higher in common is the
estimate's error, if its height has moved against its own vertical velocity: a vehicle that moves does not.
The growth of the error is estimated within the scan, so that the first one of a slide is placed as well as
the others. Slower drifts are followed from window to window (`slz.points.registration`).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.fusion.pose_history import PoseHistory
from slz import Scan
from slz.frame import is_known
from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel
from slz.kernels.points.robust_regression import robust_fit
from slz.moving.common_shift import FEWEST_CELLS
from slz.points.registration import FEWEST_SPREAD_M, MOST_TILT_RAD, wide_axes

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]
SIDE = 64  # cells per side of the ground that is kept, of a metre each
CELLS = SIDE * SIDE
REACH_M = 28.0  # of a return from the sensor over ground
LEAST_HEIGHT_M = 1.0  # of the sensor over the ground: lower, rays graze it, and whoever stands needs no datum
MOST_RETURNS = 4_000  # of a scan
HOLD_NS = 2_000_000_000  # for which ground is compared
SLIDE_M = 0.08  # within that time, beyond which the datum slides: the registration's noise and drift
SLIDE_MS = 0.8  # from scan to scan, likewise: a filter that sways is slower (PX4: 0.5 m/s)
SIGMAS = 5.0  # of what the offset wanders within that time, likewise
WANDERS_OVER = 600  # scans
LEAST_SHARE = 0.5  # of a slide, that the estimate's velocity does not explain; of the cells that agree on it
USUAL_MS = 3.0  # speed of a slide, as to which a view that turns with time (a spinning sensor) tells little
NOISE_M = 0.03  # of a cell's height
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class _Datum:
    """Datum at the end of a scan.

    offset_m: the estimate's height over the ground's datum. slip_m: the estimate's height beyond the integral
    of its velocity.
    """

    stamp_ns: int
    offset_m: float
    slip_m: float

    def slid_since(self, before: _Datum, least_m: float) -> bool:
        """Return whether the offset changed by more than this, against the estimate's own velocity."""
        moved_m, slip_m = self.offset_m - before.offset_m, self.slip_m - before.slip_m
        return abs(moved_m) > least_m and slip_m * math.copysign(1.0, moved_m) >= LEAST_SHARE * abs(moved_m)


class HeightDatum:
    """Follower of the height datum, which sets the vertical shift of the history's correction.

    Parameters
    ----------
    history
        The autopilot's poses.
    """

    def __init__(self, history: PoseHistory) -> None:
        self._history, self._epoch = history, history.epoch
        self._ground = _RecentGround()
        self._recent: deque[_Datum] = deque()
        self._begun: _Datum | None = None
        self._wander_m2, self._scans = 0.0, 0
        self._last: tuple[int, float, float] | None = None  # stamp, climb rate, integral of it

    def add(self, scan: Scan) -> None:
        """Take a scan as the autopilot's poses place it, and correct the history where its datum slides."""
        at_ns = int(scan.stamp_ns[-1])
        follows = self._last is not None and 0 < at_ns - self._last[0] <= HOLD_NS
        if self._history.epoch != self._epoch or not follows:
            self._forget()
        before = self._history.correction_at(at_ns)
        if not is_known(scan.sensor_enu_m) or before is not self._history.correction:
            return  # placed by poses of before a reset that is over
        before_ns = at_ns if self._last is None else self._last[0]
        slip_m = float(scan.sensor_enu_m[2]) - self._climbed_m(at_ns)
        while self._recent and at_ns - self._recent[0].stamp_ns > HOLD_NS:
            self._recent.popleft()
        elapsed_s = (at_ns - before_ns) * 1e-9
        shift_m = float(before.shift_enu_m[2]) + before.slide_up_ms * elapsed_s
        lowest = _Lowest.of(before.levelled(scan), scan.stamp_ns, scan.sensor_enu_m)
        known = self._ground.holds(lowest, at_ns)
        common = self._ground.common_m(lowest, known, shift_m, scan.sensor_enu_m)
        slide_ms = 0.0
        if common is not None and elapsed_s > 0:
            up_m, up_ms = common
            if self._slides(_Datum(at_ns, up_m - shift_m, slip_m)):
                slide_ms = before.slide_up_ms - up_ms
                shift_m -= up_m
            elif before.slide_up_ms:
                shift_m -= up_m  # the slide has ended
        if slide_ms or before.slide_up_ms:
            shift_enu_m = np.array([*before.shift_enu_m[:2], shift_m])
            self._history.correction = replace(before, shift_enu_m=shift_enu_m, slide_up_ms=slide_ms)
        self._ground.add(lowest, ~known, shift_m, at_ns)

    def _slides(self, now: _Datum) -> bool:
        """Return whether the datum slides, and the vehicle's motion does not explain it."""
        if not self._recent:
            self._recent.append(now)
        first, last = self._recent[0], self._recent[-1]
        wander_m = self._wander_m(now.offset_m - first.offset_m)
        slide_m = max(SLIDE_M, wander_m)
        moves = abs(now.offset_m - first.offset_m) > slide_m
        begun = self._begun or first  # the filter takes more of a long slide for a velocity
        slides = moves and (now.slid_since(first, slide_m) or now.slid_since(begun, slide_m))
        if moves and not slides:
            return False  # something fills the view, or the sensor repeats a picture
        self._begun = begun if slides else None
        self._recent.append(now)
        suddenly_m = SLIDE_MS * (now.stamp_ns - last.stamp_ns) * 1e-9 * slide_m / SLIDE_M
        return slides or (last is not now and now.slid_since(last, suddenly_m))

    def _wander_m(self, moved_m: float) -> float:
        """Return how far the offset of this vehicle's estimate wanders, and take another change of it.

        A noisy estimator wanders by decimetres all the time (PX4's simulator SIH), and slides by nothing; a
        slide itself is no wandering.
        """
        wander_m = SIGMAS * math.sqrt(self._wander_m2)
        if not self._scans or abs(moved_m) <= max(SLIDE_M, wander_m):
            self._scans += 1
            self._wander_m2 += (moved_m**2 - self._wander_m2) / min(self._scans, WANDERS_OVER)
        return wander_m

    def _climbed_m(self, at_ns: int) -> float:
        """Return the integral of the autopilot's vertical velocity up to a time."""
        climb_ms, climbed_m = float(self._history.velocity_enu_ms(at_ns)[2]), 0.0
        if self._last is not None:
            last_ns, last_ms, last_m = self._last
            climbed_m = last_m + (climb_ms + last_ms) / 2 * (at_ns - last_ns) * 1e-9
        self._last = at_ns, climb_ms, climbed_m
        return climbed_m

    def _forget(self) -> None:
        """Forget ground and datum after a reset of estimate or clock, or a gap; the shift stays."""
        self._history.correction = replace(self._history.correction, slide_up_ms=0.0)
        self._epoch, self._ground, self._last = self._history.epoch, _RecentGround(), None
        self._recent.clear()
        self._begun = None


@dataclass(frozen=True, slots=True)
class _Lowest:
    """Lowest returns of a scan by cells, in order: number (n,), east and north (2, n), heights (n,).

    early_s : (n,), before the scan's end.
    """

    index: Cells
    places: Cells
    heights_m: Floats
    early_s: Floats

    @classmethod
    def of(cls, points_enu_m: Floats, stamp_ns: Cells, sensor_enu_m: Floats) -> _Lowest:
        every = -(-len(points_enu_m) // MOST_RETURNS)
        index, places, heights = np.empty(CELLS, np.int64), np.empty((2, CELLS), np.int64), np.empty(CELLS)
        which = np.empty(CELLS, np.int64)
        points = np.ascontiguousarray(points_enu_m)
        n = find_lowest(points, every, sensor_enu_m, REACH_M, index, places, heights, which)
        early_s = (stamp_ns[-1] - stamp_ns[which[:n]]) * 1e-9
        return cls(index[:n], places[:, :n], heights[:n], early_s)


@kernel
def find_lowest(
    points: ReadOnly2D[np.float64],
    every: int,
    sensor: ReadOnly1D[np.float64],
    reach_m: float,
    index: Array1D[np.int64],
    places: Array2D[np.int64],
    heights: Array1D[np.float64],
    which: Array1D[np.int64],
) -> int:
    """Write the lowest of every k-th point in reach by cells of a metre, as in `_Lowest`; return how many.

    which : number of the point.
    """
    lowest, at = np.full(CELLS, np.inf), np.empty((CELLS, 3), np.int64)
    for i in range(0, len(points), every):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if math.hypot(x - sensor[0], y - sensor[1]) < reach_m:
            east, north = math.floor(x), math.floor(y)
            cell = east % SIDE * SIDE + north % SIDE
            if z < lowest[cell]:
                lowest[cell], at[cell, 0], at[cell, 1], at[cell, 2] = z, east, north, i
    n = 0
    for cell in range(CELLS):
        if lowest[cell] < np.inf:
            index[n], heights[n] = cell, lowest[cell]
            places[0, n], places[1, n], which[n] = at[cell, 0], at[cell, 1], at[cell, 2]
            n += 1
    return n


class _RecentGround:
    """Lowest returns on the map, of the cells around the vehicle, from when each was first seen."""

    def __init__(self) -> None:
        self._heights_m = np.full(CELLS, np.nan)
        self._places = np.zeros((2, CELLS), np.int64)
        self._seen_ns = np.full(CELLS, -HOLD_NS)

    def common_m(
        self, lowest: _Lowest, known: NDArray[np.bool_], shift_m: float, sensor_enu_m: Floats
    ) -> tuple[float, float] | None:
        """Return the height (m) that shifted returns have over the ground in common, and its growth (m/s).

        The height is that at the sensor, at the end of the scan. None where the returns do not agree.
        """
        if np.count_nonzero(known) < FEWEST_CELLS:
            return None
        if sensor_enu_m[2] - _median(np.sort(lowest.heights_m)) < LEAST_HEIGHT_M:
            return None
        places_m = lowest.places[:, known].T + 0.5 - sensor_enu_m[:2]
        axes = wide_axes(places_m, FEWEST_SPREAD_M)
        if axes.shape[1] < 2:
            return None  # an object may fill a line or a narrow view
        over_m = lowest.heights_m[known] + shift_m - self._heights_m[lowest.index[known]]
        usual = np.array([[0.0, 0.0, 0.0, NOISE_M / USUAL_MS]])  # as if a cell had seen the usual: no slide
        design = np.column_stack([np.ones(len(places_m)), places_m, -lowest.early_s[known]])
        (up_m, *tilt, up_ms), share = robust_fit(
            np.concatenate([design, usual]), np.append(over_m, 0.0), ROUNDS
        )
        agrees = share >= LEAST_SHARE and math.hypot(*tilt) <= MOST_TILT_RAD
        return (float(up_m), float(up_ms)) if agrees else None

    def add(self, lowest: _Lowest, new: NDArray[np.bool_], shift_m: float, at_ns: int) -> None:
        """Add the cells that are not held yet, or no more."""
        index = lowest.index[new]
        self._heights_m[index] = lowest.heights_m[new] + shift_m
        self._places[:, index] = lowest.places[:, new]
        self._seen_ns[index] = at_ns

    def holds(self, lowest: _Lowest, at_ns: int) -> NDArray[np.bool_]:
        """Return which of the cells (n,) are held."""
        index, (east, north) = lowest.index, lowest.places
        same = (self._places[0][index] == east) & (self._places[1][index] == north)
        return np.asarray(same & (at_ns - self._seen_ns[index] <= HOLD_NS))


def _median(ascending: NDArray[Any]) -> float:
    """Return the median of values (n,), n > 0."""
    low, high = ascending[(len(ascending) - 1) // 2], ascending[len(ascending) // 2]
    return (float(low) + float(high)) / 2
