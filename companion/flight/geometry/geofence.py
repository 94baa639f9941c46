"""Geofence of the autopilot in the map frame, and what it leaves for points, ways and velocities."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

STEP_M = 0.5  # between samples of a course, and longest part of a way that is judged by its ends
SLACK_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Boundary:
    """One area of a fence: a polygon, or a circle around a single corner.

    corners_m: (n, 2) east, north. radius_m: 0 for a polygon. inclusion: the vehicle has to stay inside;
    otherwise outside.
    """

    corners_m: F64
    radius_m: float
    inclusion: bool

    def room_m(self, places_m: F64) -> F64:
        """Return the distances (k,) of places (k, 2) to the edge, negative on the forbidden side."""
        if self.radius_m > 0:
            inside_m = self.radius_m - np.hypot(*(places_m - self.corners_m[0]).T)
        else:
            inside_m = _inside_polygon_m(self.corners_m, places_m)
        return np.asarray(inside_m if self.inclusion else -inside_m)


@dataclass(frozen=True, slots=True, eq=False)
class Geofence:
    """Space that the autopilot's fence leaves, with a margin.

    Attributes
    ----------
    circle
        Circle around home, None without one.
    areas
        Areas to stay inside of, or outside of.
    is_union
        Whether the vehicle may be in any area of inclusion, instead of having to be in all.
    margin_m
        Horizontal distance kept from the boundaries.
    lowest_m, highest_m
        Heights to fly at, up in the map frame, with their margin.
    """

    circle: Boundary | None = None
    areas: tuple[Boundary, ...] = ()
    is_union: bool = False
    margin_m: float = 0.0
    lowest_m: float = -math.inf
    highest_m: float = math.inf

    @property
    def boundaries(self) -> tuple[Boundary, ...]:
        """Circle and areas."""
        return self.areas if self.circle is None else (self.circle, *self.areas)

    @property
    def is_open(self) -> bool:
        """True if there is no fence at all."""
        return not self.boundaries and math.isinf(self.lowest_m) and math.isinf(self.highest_m)

    def room_m(self, places_m: F64) -> F64:
        """Return how far (k,) places (k, 2 or more: east, north) are from the margin, negative beyond it."""
        places_m = np.atleast_2d(places_m)[:, :2]
        inclusions = [one.room_m(places_m) for one in self.areas if one.inclusion]
        rooms = [one.room_m(places_m) for one in self.areas if not one.inclusion]
        if self.circle is not None:
            rooms.append(self.circle.room_m(places_m))
        if inclusions:
            rooms.append(np.max(inclusions, axis=0) if self.is_union else np.min(inclusions, axis=0))
        if not rooms:
            return np.full(len(places_m), math.inf)
        return np.asarray(np.min(rooms, axis=0) - self.margin_m)

    def holds(self, place_m: F64) -> bool:
        """Return whether a place (east, north, ...) is inside, horizontally."""
        return bool(self.room_m(place_m)[0] >= 0)

    def holds_landings(self, points_enu_m: F64, above_m: float) -> NDArray[np.bool_]:
        """Return whether the vehicle may fly over points (k, 3), as low as `above_m` over each, (k,)."""
        low_m = points_enu_m[:, 2] + above_m
        is_high_enough = (self.lowest_m <= low_m) & (low_m <= self.highest_m)
        return np.asarray(is_high_enough & (self.room_m(points_enu_m) >= 0))

    def holds_landing(self, point_enu_m: F64, above_m: float) -> bool:
        """Return whether the vehicle may fly over one point (3,)."""
        return bool(self.holds_landings(point_enu_m[None], above_m)[0])

    def holds_way(self, from_m: F64, to_m: F64) -> bool:
        """Return whether a straight way is inside; beyond the margin it must not go farther out.

        Halves the parts of the way that may leave: the room changes by no more than their length.
        """
        if not self.boundaries:
            return True
        begins, ends = np.asarray(from_m, np.float64)[None, :2], np.asarray(to_m, np.float64)[None, :2]
        rooms, end_rooms = self.room_m(begins), self.room_m(ends)
        least_m = min(0.0, float(rooms[0])) - SLACK_M
        while len(begins) and (rooms >= least_m).all() and (end_rooms >= least_m).all():
            lengths = np.hypot(*(ends - begins).T)
            may_leave = ((rooms + end_rooms - lengths) / 2 < least_m) & (lengths > STEP_M)
            middles = (begins + ends)[may_leave] / 2
            middle_rooms = self.room_m(middles) if len(middles) else rooms[:0]
            begins = np.concatenate([begins[may_leave], middles])
            ends = np.concatenate([middles, ends[may_leave]])
            rooms, end_rooms = (
                np.concatenate([rooms[may_leave], middle_rooms]),
                np.concatenate([middle_rooms, end_rooms[may_leave]]),
            )
        return len(begins) == 0

    def limited(self, position_enu_m: F64, velocity_enu_ms: F64, braking_ms2: float) -> F64:
        """Return the velocity (3,) with which the vehicle stops before the margin; its course is kept.

        Parameters
        ----------
        braking_ms2
            Deceleration of the stop.
        """
        if self.is_open:
            return velocity_enu_ms
        up_m, up_ms = float(position_enu_m[2]), float(velocity_enu_ms[2])
        up_ms = min(up_ms, _stopping_ms(self.highest_m - up_m, braking_ms2))
        up_ms = max(up_ms, -_stopping_ms(up_m - self.lowest_m, braking_ms2))
        horizontal = velocity_enu_ms[:2]
        speed = float(np.hypot(*horizontal))
        if speed > 0 and self.boundaries:
            free_m = self._free_m(position_enu_m[:2], horizontal / speed, speed**2 / (2 * braking_ms2))
            horizontal = horizontal * min(1.0, _stopping_ms(free_m, braking_ms2) / speed)
        return np.array([*horizontal, up_ms])

    def _free_m(self, from_m: F64, course: F64, ahead_m: float) -> float:
        """Return the distance that may be flown on a course, at least `ahead_m` if nothing is in the way."""
        along_m = STEP_M * np.arange(2 + math.ceil(ahead_m / STEP_M))
        rooms = self.room_m(from_m + along_m[:, None] * course)
        beyond = np.flatnonzero(rooms < min(0.0, float(rooms[0])) - SLACK_M)
        return math.inf if len(beyond) == 0 else float(along_m[beyond[0] - 1])


NO_FENCE = Geofence()


def _stopping_ms(free_m: float, braking_ms2: float) -> float:
    return math.sqrt(2 * braking_ms2 * max(0.0, free_m))


def _inside_polygon_m(corners_m: F64, places_m: F64) -> F64:
    """Return the distances (k,) of places (k, 2) to a polygon's edges, negative outside (even-odd rule)."""
    starts, ends = corners_m, np.roll(corners_m, -1, axis=0)
    edges = ends - starts
    from_start = places_m[:, None] - starts
    length2 = np.maximum((edges**2).sum(axis=1), 1e-12)
    share = np.clip((from_start * edges).sum(axis=2) / length2, 0.0, 1.0)
    distance_m = np.hypot(*np.moveaxis(from_start - share[:, :, None] * edges, 2, 0)).min(axis=1)
    east, north = places_m[:, 0, None], places_m[:, 1, None]
    crosses = (starts[:, 1] > north) != (ends[:, 1] > north)
    rise = np.where(edges[:, 1] == 0, 1.0, edges[:, 1])
    at_east = starts[:, 0] + (north - starts[:, 1]) * edges[:, 0] / rise
    is_inside = (crosses & (east < at_east)).sum(axis=1) % 2 == 1
    return np.asarray(np.where(is_inside, distance_m, -distance_m))
