"""Wire under observation: it grows with new returns, and rays that pass it without any contradict it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.lines.curve_fit import GAP_M, GATES
from slz.kernels.lines.line_votes import SENSOR, SIGMA, UP, rays_past
from slz.wires.detected_wire import SaggingCurve, Wire, fit_curve
from slz.wires.line_search import MOST_MISFIT, Found, is_explained
from slz.wires.occupied_air import OccupiedAir, Rows

MOST_RETURNS = 400  # kept for the fit
EXTENSION, MOST_EXTENSION_M = 0.5, 100.0  # of the length seen, beyond each end
HALF_M = 0.3  # from the curve within which rays pass it
USUAL_SHARE = 0.05  # of these rays that a wire returns, before any is known
CONTRADICTED = 15.0  # returns that the rays since the last one would have brought
BACK_M = 1.0  # before an end, from where a support is looked for
ALIKE_M, ALIKE_COSINE = 0.5, 0.998  # between two curves of one wire

Floats = NDArray[np.float64]


def median_range_m(candidates: Floats) -> float:
    """Return the median distance of candidates from the sensor."""
    return float(np.median(np.linalg.norm(candidates[:, :SIGMA] - candidates[:, SENSOR:], axis=1)))


class TrackedWire:
    """Wire with the returns that it is fitted to.

    Attributes
    ----------
    curve, start_m, stop_m
        As in `Wire`, in stored heights.
    """

    def __init__(self, number: int, found: Found, returns: Floats, stamp_ns: int) -> None:
        self.number = number
        self.curve, self.start_m, self.stop_m = found.curve, found.start_m, found.stop_m
        self.n_returns = len(returns)
        self._returns = returns
        self._first_ns = self._last_ns = stamp_ns
        self._hits, self._rays = float(len(returns)), len(returns) / USUAL_SHARE
        self._rays_since, self._grew = 0.0, True  # since the last return, and whether one is of this window
        self._farthest_m = median_range_m(returns)
        self._extended = self.start_m, self.stop_m, (False, False)

    def distance_m(self, enu_m: Floats) -> float:
        """Return the horizontal distance of what was seen from a place."""
        along_m, _ = self.curve.distances_m(np.reshape(enu_m, (1, -1)))
        near = self.curve.points_enu_m(np.clip(along_m, self.start_m, self.stop_m))[0]
        return float(np.hypot(*(near[:2] - enu_m[:2])))

    def near(self, candidates: Floats) -> NDArray[np.bool_]:
        """Return which candidates are on the curve, or on its continuation up to `GAP_M`."""
        along_m, across_m = self.curve.distances_m(candidates)
        sigma_m = candidates[:, SIGMA]
        near = np.abs(across_m) <= GATES[-1] * np.hypot(sigma_m, self.curve.aside_sd_m)
        near &= (along_m >= self.start_m - GAP_M) & (along_m <= self.stop_m + GAP_M)
        at = np.flatnonzero(near)
        off = np.abs(candidates[at, UP] - self.curve.height_m(along_m[at]))
        near[at] = off <= GATES[-1] * np.hypot(sigma_m[at], self.curve.height_sd_m(along_m[at]))
        return near

    def grow(self, new: Floats, air: OccupiedAir, stamp_ns: int) -> None:
        """Fit the curve to new returns as well; what leads beyond the ends must be thin."""
        along_m, _ = self.curve.distances_m(new)
        beyond = (along_m < self.start_m) | (along_m > self.stop_m)
        if beyond.any():
            thin = air.is_thin(new[beyond])
            keep = ~beyond
            keep[np.flatnonzero(beyond)[thin]] = True
            new = new[keep]
        if not len(new):
            return
        self._saw(new, stamp_ns)
        together = np.concatenate([self._returns, new])
        curve = fit_curve(together)
        if curve is None or curve.misfit > max(MOST_MISFIT, self.curve.misfit):
            return
        self._become(curve, together)

    def merge(self, other: TrackedWire) -> bool:
        """Become one with another wire if one curve fits both; return whether it does."""
        if abs(float(self.curve.along @ other.curve.along)) < ALIKE_COSINE:
            return False
        if not self._meets(other):
            return False
        together = np.concatenate([self._returns, other._returns])
        curve = fit_curve(together)
        if curve is None or curve.misfit > MOST_MISFIT:
            return False
        ends = np.concatenate([self._ends(), other._ends()])
        self._become(curve, together, ends)
        self.n_returns += other.n_returns
        self._first_ns, self._last_ns = (
            min(self._first_ns, other._first_ns),
            max(self._last_ns, other._last_ns),
        )
        return True

    def extend(self, air: OccupiedAir) -> None:
        """Follow the curve beyond its ends, to a support or for half the length seen."""
        length_m = self.stop_m - self.start_m
        more_m = min(MOST_EXTENSION_M, EXTENSION * length_m)
        back_m = min(BACK_M, length_m / 4)
        low, first = air.support_m(self.curve, self.start_m + back_m, self.start_m - more_m)
        high, last = air.support_m(self.curve, self.stop_m - back_m, self.stop_m + more_m)
        self._extended = min(low, self.start_m), max(high, self.stop_m), (first, last)

    def count_rays(
        self,
        points: Floats,
        rows: Rows,
        origin: NDArray[np.uint16],
        origins: Floats,
        first: int,
        stride: int,
    ) -> None:
        """Count the rays of every `stride`-th row that passed the wire as near as its returns were."""
        place = np.array([*self.curve.place_m, *self.curve.along])
        ends = np.array([self.start_m, self.stop_m])
        heights = np.ascontiguousarray(self.curve.heights)
        line = (place, heights, ends, HALF_M, self._farthest_m)
        count = stride * rays_past(points, rows, origin, origins, first, stride, *line)
        if self._grew:
            self._rays += self._rays_since + count
            self._rays_since, self._grew = 0.0, False
        else:
            self._rays_since += count

    def is_surface(self, air: OccupiedAir) -> bool:
        """Return whether the air around holds as many returns as the wire by now."""
        along_m, _ = self.curve.distances_m(self._returns)
        found = Found(self.curve, np.arange(len(along_m)), along_m, self.start_m, self.stop_m)
        return is_explained(found, self._returns, air)

    @property
    def is_contradicted(self) -> bool:
        """True if rays that passed since its last return would have brought many more."""
        return self._rays_since * self._hits / self._rays > CONTRADICTED

    def wire(self, datum_m: float) -> Wire:
        """Return what is known of it now; datum_m: the height of the zero of the stored heights."""
        c = self.curve
        heights = c.heights + np.array([datum_m, 0.0, 0.0])
        curve = SaggingCurve(c.place_m, c.along, heights, c.covariance, c.aside_sd_m, c.misfit)
        return Wire(
            self.number,
            curve,
            self.start_m,
            self.stop_m,
            *self._extended,
            self.n_returns,
            self._first_ns,
            self._last_ns,
        )

    def _saw(self, new: Floats, stamp_ns: int) -> None:
        self.n_returns += len(new)
        self._last_ns = stamp_ns
        self._hits, self._grew = self._hits + len(new), True
        share = min(0.5, len(new) / self._hits)
        self._farthest_m += (median_range_m(new) - self._farthest_m) * share

    def _ends(self) -> Floats:
        return self.curve.points_enu_m(np.array([self.start_m, self.stop_m]))

    def _become(self, curve: SaggingCurve, returns: Floats, ends: Floats | None = None) -> None:
        places = np.concatenate([self._ends() if ends is None else ends, returns[:, :SIGMA]])
        along_m, _ = curve.distances_m(places)
        self.curve, self.start_m, self.stop_m = curve, float(along_m.min()), float(along_m.max())
        self._returns = returns[::2].copy() if len(returns) > MOST_RETURNS else returns

    def _meets(self, other: TrackedWire) -> bool:
        """Return whether the ends of the other are near this one or its continuation."""
        ends = other._ends()
        along_m, across_m = self.curve.distances_m(ends)
        gap_m = max(self.start_m - along_m.max(), along_m.min() - self.stop_m, 0.0)
        if gap_m > GAP_M or np.abs(across_m).max() > ALIKE_M + 3 * self.curve.aside_sd_m:
            return False
        middle = np.clip(along_m, self.start_m, self.stop_m)
        there, _ = other.curve.distances_m(self.curve.points_enu_m(middle))
        off = np.abs(self.curve.height_m(middle) - other.curve.height_m(there))
        sd = self.curve.height_sd_m(middle) + other.curve.height_sd_m(there)
        return bool((off <= ALIKE_M + 2 * sd).all())
