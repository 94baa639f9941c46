"""Detector and memory of wires, window by window."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.air.seen_air import SeenAir
from slz.frame import is_known
from slz.grid import Edges
from slz.kernels.lines.candidates import MOST, MOST_OF_WINDOW, candidates_of
from slz.kernels.lines.line_votes import CANDIDATE_FIELDS
from slz.wires.detected_wire import Wire
from slz.wires.line_search import new_wires
from slz.wires.occupied_air import OccupiedAir, Rows
from slz.wires.tracked_wire import TrackedWire

STEP_M = 0.1
MOST_ASIDE_M, MOST_HIGHER_M = 1.0, 3.0
SIGMAS = 2.0  # of the place across the wire, and of its height
MOVED_M, RISEN_M, LONGER_M = 0.1, 0.2, 1.0  # from where a wire was marked, up to which its marks stay
CHUNK = 100  # marks along a wire with edges of their own

Floats = NDArray[np.float64]
MOST_WIRES = 64
MOST_RAYS = 2000  # of a window, counted for contradiction
LEAST_S = 0.01  # between two windows
WATCHED_M = 60.0  # from the sensor, within which wires may be contradicted


class WireMarks:
    """Points along all wires, renewed only where a wire has moved: maps are derived again there.

    Attributes
    ----------
    points_m
        (n, 3), in the heights of the wires given.
    """

    def __init__(self) -> None:
        self._marked: dict[int, tuple[Wire, Floats]] = {}
        self.points_m: Floats = np.empty((0, 3))

    def update(self, wires: Iterable[Wire]) -> list[Edges]:
        """Mark the wires known now; return the edges (west, south, east, north) of places that change."""
        altered: list[Edges] = []
        marked: dict[int, tuple[Wire, Floats]] = {}
        for wire in wires:
            before = self._marked.pop(wire.number, None)
            if before is not None and _is_alike(before[0], wire):
                marked[wire.number] = before
                continue
            points = _marks(wire)
            marked[wire.number] = wire, points
            altered += [*_edges(points), *([] if before is None else _edges(before[1]))]
        for _, points in self._marked.values():
            altered += _edges(points)
        if altered:
            self.points_m = np.concatenate([np.empty((0, 3)), *(points for _, points in marked.values())])
        self._marked = marked
        return altered


def _marks(wire: Wire) -> Floats:
    """Return points (n, 3) along a wire, beside and over it as far as its place is uncertain."""
    points, height_sd_m, _ = wire.sampled(STEP_M)
    points[:, 2] += np.minimum(MOST_HIGHER_M, SIGMAS * height_sd_m)
    aside_m = min(MOST_ASIDE_M, SIGMAS * wire.curve.aside_sd_m)
    count = int(np.ceil(aside_m / STEP_M))
    across = np.array([-wire.curve.along[1], wire.curve.along[0], 0.0])
    return np.concatenate([points + k * STEP_M * across for k in range(-count, count + 1)])


def _edges(points: Floats) -> list[Edges]:
    parts = (points[k : k + CHUNK, :2] for k in range(0, len(points), CHUNK))
    return [(*part.min(axis=0).tolist(), *part.max(axis=0).tolist()) for part in parts]


def _is_alike(old: Wire, new: Wire) -> bool:
    """Return whether a wire is still where it was marked."""
    places = old.curve.points_enu_m(np.linspace(old.from_m, old.to_m, 7))
    along_m, across_m = new.curve.distances_m(places)
    risen_m = np.abs(new.curve.height_m(along_m) - places[:, 2])
    longer_m = max(along_m.min() - new.from_m, new.to_m - along_m.max())
    return bool(np.abs(across_m).max() < MOVED_M and risen_m.max() < RISEN_M and longer_m < LONGER_M)


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
        self._noise = math.radians(parameters.angle_noise_deg), parameters.range_noise_m
        self._air = OccupiedAir(seen_air)
        self._stored, self._n_stored = np.empty((MOST + MOST_OF_WINDOW, CANDIDATE_FIELDS)), 0
        self._numbers = itertools.count(1)
        self._window, self._now_s = 0, -math.inf
        self.tracked: list[TrackedWire] = []

    def update(
        self,
        points_m: Floats,
        sensor_m: Floats,
        now_s: float,
        stamp_ns: int,
        rays: tuple[NDArray[np.uint16], Floats] | None = None,
        rows: Rows | None = None,
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
        rows
            (m,) returns to use, in an order of which the floor depends; None for all.
        """
        rows = np.arange(len(points_m)) if rows is None else rows
        if not is_known(sensor_m) or not len(rows):
            return
        self._window += 1
        since_s, self._now_s = min(1.0, max(LEAST_S, now_s - self._now_s)), now_s
        points = np.ascontiguousarray(points_m)
        raised = self._air.add(points, rows, sensor_m, now_s)
        for tracked in self.tracked:
            self._air.vacate(tracked.curve, tracked.start_m, tracked.stop_m)
        if self.tracked and (suspect := self.tracked[self._window % len(self.tracked)]).is_surface(self._air):
            self.tracked.remove(suspect)
        found = candidates_of(points, raised, sensor_m, *self._noise, now_s)
        if self.tracked:
            found = self._grown(found, stamp_ns)
            if rays is not None:
                self._contradicted(points, rows, *rays, sensor_m)
        self._n_stored, n_new = self._air.renew(self._stored, self._n_stored, found, now_s, self._window)
        self._search(max(0, self._n_stored - n_new), since_s, sensor_m, stamp_ns)

    def wires(self, datum_m: float) -> tuple[Wire, ...]:
        """Return the wires known now; datum_m: the height of the zero of the stored heights."""
        return tuple(tracked.wire(datum_m) for tracked in self.tracked)

    def _grown(self, candidates: Floats, stamp_ns: int) -> Floats:
        """Let the wires grow by the candidates on them; return the others."""
        for tracked in self.tracked:
            own = tracked.near(candidates)
            if own.any():
                tracked.grow(candidates[own], self._air, stamp_ns)
                tracked.extend(self._air)
                candidates = candidates[~own]
        return candidates

    def _contradicted(
        self, points: Floats, rows: Rows, origin: NDArray[np.uint16], origins: Floats, sensor_m: Floats
    ) -> None:
        stride = max(1, math.ceil(len(rows) / MOST_RAYS))
        first, origins = self._window % stride, np.ascontiguousarray(origins)
        for tracked in self.tracked:
            if tracked.distance_m(sensor_m) <= WATCHED_M:
                tracked.count_rays(points, rows, origin, origins, first, stride)
        self.tracked = [tracked for tracked in self.tracked if not tracked.is_contradicted]

    def _search(self, first_new: int, since_s: float, sensor_m: Floats, stamp_ns: int) -> None:
        stored, taken = self._stored[: self._n_stored], []
        for found in new_wires(stored, first_new, since_s, self._air):
            taken.append(found.members)
            wire = TrackedWire(next(self._numbers), found, stored[found.members], stamp_ns)
            if not any(known.merge(wire) for known in self.tracked):
                self.tracked.append(wire)
        if not taken:
            return
        left = np.delete(stored, np.concatenate(taken), axis=0)
        self._n_stored = len(left)
        self._stored[: len(left)] = left
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
