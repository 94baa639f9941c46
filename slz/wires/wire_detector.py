"""Detector and memory of wires, window by window."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.air.seen_air import SeenAir
from slz.frame import is_known
from slz.wires.detected_wire import Wire
from slz.wires.line_search import new_wires
from slz.wires.occupied_air import FENCE_M, OccupiedAir
from slz.wires.tracked_wire import TrackedWire
from slz.wires.wire_candidates import WireCandidates

PLACE_SD_M, PLACE_SD_SHARE = 0.05, 0.003  # of the vehicle, and of its attitude by range, beside the ray's own
SHARES = 4  # of the stored returns, one of which is compared with the air around in a window
MOST_WIRES = 64
MOST_RAYS = 2000  # of a window, counted for contradiction
WATCHED_M = 60.0  # from the sensor, within which wires may be contradicted
NEAREST_M, FARTHEST_M = 4.0, 60.0  # from the sensor; dust near it is a line along the way flown

Floats = NDArray[np.float64]


class WireDetector:
    """Detector of wires in the returns of many windows, and memory of the wires found.

    Parameters
    ----------
    seen_air
        Air that rays passed, in which the window's rays are followed before each update; None where no ray is
        known.

    Attributes
    ----------
    tracked
        Wires known now.
    """

    def __init__(self, parameters: Parameters, seen_air: SeenAir | None = None) -> None:
        self._range_noise_m = parameters.range_noise_m
        self._angle_noise_rad = math.radians(parameters.angle_noise_deg)
        self._air = OccupiedAir(seen_air)
        self._candidates = WireCandidates.none()
        self._numbers = itertools.count(1)
        self._window = 0
        self.tracked: list[TrackedWire] = []

    def update(
        self,
        points_m: Floats,
        sensor_m: Floats,
        now_s: float,
        stamp_ns: int,
        rays: tuple[NDArray[np.uint16], Floats] | None = None,
    ) -> None:
        """Add a window's returns: known wires grow or are contradicted, and new ones are sought.

        Parameters
        ----------
        points_m, sensor_m
            (n, 3) returns, those without others near them too, and (3,) position of the sensor, in stored
            heights.
        now_s, stamp_ns
            Time since the map began, and stamp of the window.
        rays
            (n,) the scan of each return and (k, 3) the sensor's position in each scan, in stored heights;
            None where they are unknown: nothing contradicts a wire then.
        """
        if not is_known(sensor_m) or not len(points_m):
            return
        self._window += 1
        points = np.ascontiguousarray(points_m)
        over = self._air.add(points, sensor_m, now_s)
        for tracked in self.tracked:
            self._air.vacate(tracked.curve, tracked.start_m, tracked.stop_m)
        if self.tracked and (suspect := self.tracked[self._window % len(self.tracked)]).is_surface(self._air):
            self.tracked.remove(suspect)
        raised = self._raised(points, over, sensor_m, now_s)
        raised = self._grown(raised, stamp_ns)
        if rays is not None:
            self._contradicted(points, *rays, sensor_m)
        thin = self._air.is_thin(raised.points_enu_m)
        new = raised.some(thin)
        kept = self._candidates.bounded(now_s)
        some = np.arange(self._window % SHARES, len(kept), SHARES)
        still = np.ones(len(kept), bool)
        held = kept.points_enu_m[some]
        still[some] = self._air.is_thin(held) & self._air.is_raised(held)
        kept = kept.some(still)
        self._candidates = kept.joined_with(new).bounded(now_s)
        self._search(max(0, len(self._candidates) - len(new)), sensor_m, stamp_ns)

    def wires(self, datum_m: float) -> tuple[Wire, ...]:
        """Return the wires known now; datum_m: the height of the zero of the stored heights."""
        return tuple(tracked.wire(datum_m) for tracked in self.tracked)

    def _raised(self, points: Floats, over: Floats, sensor_m: Floats, now_s: float) -> WireCandidates:
        at = np.flatnonzero(over >= FENCE_M)
        ranges = np.linalg.norm(points[at] - sensor_m, axis=1)
        of_use = (ranges >= NEAREST_M) & (ranges <= FARTHEST_M)
        at, ranges = at[of_use], ranges[of_use]
        sigma = np.hypot(PLACE_SD_M + PLACE_SD_SHARE * ranges, self._angle_noise_rad * ranges)
        sigma = np.hypot(sigma, self._range_noise_m)
        return WireCandidates.of(points[at], sigma, now_s, self._window, sensor_m).thinned()

    def _grown(self, raised: WireCandidates, stamp_ns: int) -> WireCandidates:
        """Let the wires grow by the returns on them; return the others."""
        for tracked in self.tracked:
            own = tracked.near(raised.points_enu_m, raised.sigma_m)
            if own.any():
                tracked.grow(raised.some(own), self._air, stamp_ns)
                tracked.extend(self._air)
                raised = raised.some(~own)
        return raised

    def _contradicted(
        self, points: Floats, origin: NDArray[np.uint16], origins: Floats, sensor_m: Floats
    ) -> None:
        stride = max(1, math.ceil(len(points) / MOST_RAYS))
        first, origins = self._window % stride, np.ascontiguousarray(origins)
        for tracked in self.tracked:
            if tracked.distance_m(sensor_m) <= WATCHED_M:
                tracked.count_rays(points, origin, origins, first, stride)
        self.tracked = [tracked for tracked in self.tracked if not tracked.is_contradicted]

    def _search(self, first_new: int, sensor_m: Floats, stamp_ns: int) -> None:
        taken = np.zeros(len(self._candidates), bool)
        for found in new_wires(self._candidates, first_new, self._air):
            returns = self._candidates.some(found.members)
            taken[found.members] = True
            wire = TrackedWire(next(self._numbers), found, returns, stamp_ns)
            if not any(known.merge(wire) for known in self.tracked):
                self.tracked.append(wire)
        if not taken.any():
            return
        self._candidates = self._candidates.some(~taken)
        self._merge()
        for tracked in self.tracked:
            tracked.extend(self._air)
        if len(self.tracked) > MOST_WIRES:  # the nearest
            self.tracked = sorted(self.tracked, key=lambda one: one.distance_m(sensor_m))[:MOST_WIRES]

    def _merge(self) -> None:
        """Make one of wires that one curve fits."""
        kept: list[TrackedWire] = []
        for tracked in self.tracked:
            if not any(known.merge(tracked) for known in kept):
                kept.append(tracked)
        self.tracked = kept
