"""Choice of the way in: straight down, or along an approach path."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.geofence import NO_FENCE, Geofence
from companion.flight.geometry.wind import Wind
from companion.flight.landing.aim import Aim
from companion.flight.landing.route import Route
from companion.flight.landing.situation import Situation, Vector
from companion.flight.landing.ways.approach_path import ApproachPath, hover_height_m
from companion.flight.landing.wind.landing_wind import FROM_MS
from params import Parameters
from slz import SAFE, UNSAFE, Corridors, SelectedPoint

WIND_CLASS_DEG = 15.0  # bearings as near to the wind's as this are alike, and the less steep one is flown
TRIED_WITHIN_DEG = 12.5  # of a bearing that was flown out along in vain


def paths(
    corridors: Corridors,
    parameters: Parameters,
    *,
    least_state: int,
    route_over_point_m: float,
    wind: Wind | None = None,
    position_enu_m: Vector | None = None,
    tried_deg: Iterable[float] = (),
    outbound: bool = False,
    fence: Geofence = NO_FENCE,
) -> list[ApproachPath]:
    """Return the approach paths to a point, the best first: into the wind, not steep, near the vehicle.

    Parameters
    ----------
    least_state
        `SAFE` for clear corridors alone; `UNKNOWN` adds those whose air was not seen yet.
    route_over_point_m
        Height over the point at which the vehicle flies to the beginning of a path.
    wind
        Without it, and below 2 m/s, the wind does not matter.
    tried_deg
        Bearings that are left out, with those beside them.
    outbound
        The vehicle leaves the point along the path: into the wind it flies the other way.
    fence
        Of the autopilot; paths beyond it are left out.
    """
    hover_m, tried = hover_height_m(parameters), tuple(tried_deg)
    slopes_deg = corridors.slopes_deg[:-1]
    found: list[tuple[tuple[float, ...], ApproachPath]] = []
    for k, states in enumerate(corridors.states[:, :-1]):
        bearing_deg = k * 360 / len(corridors.states)
        index = _flyable(states, least_state)
        if index is None or any(_apart_deg(bearing_deg, one) < TRIED_WITHIN_DEG for one in tried):
            continue
        slope_deg = slopes_deg[index]
        length_m = (route_over_point_m - hover_m) / math.tan(math.radians(slope_deg))
        if length_m <= 0:
            continue
        path = ApproachPath(bearing_deg, slope_deg, hover_m, min(length_m, parameters.corridor_m))
        if not fence.holds_way(corridors.enu_m, corridors.enu_m[:2] + path.length_m * path.outward):
            continue
        unseen = float(states[index] != SAFE)
        found.append(((*_effort(path, corridors, wind, position_enu_m, outbound), unseen), path))
    return [path for _, path in sorted(found, key=lambda one: one[0])]


class WaysOfPoint:
    """Best sloped clear ways in to the selected point and out of it, determined once per report."""

    def __init__(self, parameters: Parameters, route: Route) -> None:
        self._p, self._route = parameters, route
        self._of: SelectedPoint | None = None
        self._found: tuple[ApproachPath | None, ApproachPath | None] = None, None

    def in_and_out(self, s: Situation) -> tuple[ApproachPath | None, ApproachPath | None]:
        """Return the way in and the way out, None for one that does not exist."""
        selected, p = s.selected, self._p
        if selected is None or selected.corridors is None:
            return None, None
        if selected is self._of:
            return self._found
        up_m = self._route.height_m - float(selected.enu_m[2])
        inward, outward = (
            paths(
                selected.corridors,
                p,
                least_state=int(SAFE),
                route_over_point_m=max(up_m, p.survey_height_m),
                wind=s.wind if p.into_wind == "on" else None,
                outbound=outbound,
                fence=s.fence,
            )
            for outbound in (False, True)
        )
        self._of, self._found = selected, (next(iter(inward), None), next(iter(outward), None))
        return self._found


def corridors_of(s: Situation, aim: Aim) -> Corridors | None:
    """Return the ways in and out of the target point in the newest report, None while they are not judged."""
    selected = s.selected
    return None if selected is None or not aim.is_at(selected) else selected.corridors


def straight_down_is_blocked(corridors: Corridors | None) -> bool:
    """Return whether something stands in the way straight down; what was not judged does not."""
    return corridors is not None and corridors.overhead == UNSAFE


def is_blocked(corridors: Corridors | None, path: ApproachPath) -> bool:
    """Return whether something stands in a path's corridor now."""
    return corridors is not None and state_of(corridors, path) == UNSAFE


def state_of(corridors: Corridors, path: ApproachPath) -> int:
    """Return the state of a path's corridor in other corridors of the same point."""
    bearing = round(path.bearing_deg * len(corridors.states) / 360) % len(corridors.states)
    slope = int(np.argmin(np.abs(np.array(corridors.slopes_deg) - path.slope_deg)))
    return int(corridors.states[bearing, slope])


def _flyable(states: NDArray[np.uint8], least_state: int) -> int | None:
    """Return the index of the least steep slope that is clear, or that is not blocked, if asked for."""
    flyable = np.flatnonzero(states == SAFE if least_state == SAFE else states != UNSAFE)
    return int(flyable[0]) if len(flyable) else None


def _effort(
    path: ApproachPath,
    corridors: Corridors,
    wind: Wind | None,
    position_enu_m: Vector | None,
    outbound: bool,
) -> tuple[float, float, float]:
    """Return what makes a path worse, the most important first."""
    off_deg = 0.0
    if wind is not None and wind.speed_ms >= FROM_MS:
        course_deg = path.bearing_deg if outbound else path.bearing_deg + 180
        off_deg = _apart_deg(course_deg, math.degrees(wind.from_rad))
    away_m = 0.0
    if position_enu_m is not None:
        away_m = float(np.hypot(*path.entry_offset_m(position_enu_m, corridors.enu_m)))
    return off_deg // WIND_CLASS_DEG, path.slope_deg, round(off_deg + away_m, 3)


def _apart_deg(a: float, b: float) -> float:
    return abs(math.remainder(a - b, 360))
