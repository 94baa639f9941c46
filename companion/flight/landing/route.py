"""Route at flight level: height, corners of the search, and climbs over obstacles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import Enum

import numpy as np

from companion.flight.geometry.geofence import Geofence
from companion.flight.landing.guidance import course_rad, level, towards
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.situation import Severity, Situation, Vector, VehicleCommands, known
from params import Parameters
from slz.points.outliers import reach_m

BLOCKED_NS = 2_000_000_000
STEP_UP_M, MOST_UP_M = 5.0, 30.0  # step and total of the climb over an obstacle
AT_CORNER_M = 3.0
LEGS_APART = 1.6  # in mapping reaches, which end at 45 degrees from the nadir
MOST_SKIPPED = 8  # corners beyond the fence in a step, after which the vehicle stays until the next one
TURN_M = 6.0  # within this distance the heading is kept


class Way(Enum):
    """Responses of a route to an obstacle ahead."""

    FREE = "free"
    CLIMBING = "climbing"
    TOO_HIGH = "too high"


class Route:
    """Flight height, and the corners of an expanding square search.

    Beyond half of `zone_m` from its start the search restarts there.

    Attributes
    ----------
    highest_m
        Height up to which the autopilot's fence allows to climb, up in the map frame.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self.highest_m = math.inf
        self._height_m = 0.0
        self._corners: Iterator[tuple[float, float]] | None = None
        self._corner: Vector | None = None
        self._middle = np.zeros(2)
        self._risen_m = 0.0
        self._blocked_since_ns: int | None = None

    def follow(self, s: Situation) -> None:
        """Use the ceiling of the present fence."""
        self.highest_m = s.fence.highest_m

    @property
    def height_m(self) -> float:
        """Height up in the map frame; minus infinity after `forget`."""
        return min(self._height_m, self.highest_m)

    @property
    def begun(self) -> bool:
        """True if there is a corner to fly to."""
        return self._corner is not None

    def start_search(self, position_enu_m: Vector, height_above_home_m: float, least_m: float) -> None:
        """Start the search at a position, at the highest of its height, survey height and `least_m`."""
        east, north, up = (float(v) for v in position_enu_m)
        self._height_m = max(up + max(0.0, self._p.survey_height_m - height_above_home_m), least_m)
        self._middle = np.array([east, north])
        self._search(self._middle)
        self._risen_m = 0.0

    def forget(self) -> None:
        """Drop the route of an earlier flight."""
        self._corner = self._corners = None
        self._height_m = -math.inf

    def move(self, jump_enu_m: Vector) -> None:
        """Shift the route by a jump of the position estimate; the search restarts at its next corner."""
        self._height_m += float(jump_enu_m[2])
        self._middle = self._middle + jump_enu_m[:2]
        if self._corner is not None:
            self._search(self._corner + jump_enu_m[:2])

    def _search(self, about_m: Vector) -> None:
        self._corner = about_m
        apart_m = self._p.search_legs_m or LEGS_APART * reach_m(self._p)
        self._corners = expanding_square(float(about_m[0]), float(about_m[1]), apart_m)

    def to_corner(self, position_enu_m: Vector, way: Way, fence: Geofence) -> Vector:
        """Return the offset (2,) to the corner, or to the next one if it is reached or the way too high.

        Corners beyond the autopilot's fence, or with a way beyond it, are left out.
        """
        if self._corner is None:
            raise RuntimeError("the search has not begun")
        here = position_enu_m[:2]
        if float(np.hypot(*(self._corner - here))) < AT_CORNER_M or way is Way.TOO_HIGH:
            self._next_corner()
        for _ in range(MOST_SKIPPED):
            if fence.holds(self._corner) and fence.holds_way(here, self._corner):
                return np.asarray(self._corner - here)
            self._next_corner()
        return np.zeros(2)

    def _next_corner(self) -> None:
        if self._corners is None:
            raise RuntimeError("the search has not begun")
        self._corner = np.array(next(self._corners))
        if float(np.hypot(*(self._corner - self._middle))) > self._p.zone_m / 2:
            self._search(self._middle)

    def commands_towards(self, s: Situation, offset_m: Vector, speed_ms: float) -> VehicleCommands:
        """Return the commands that cover an offset (2,) at the route's height.

        A vehicle above the ceiling keeps its height: the ground below may be higher than home.
        """
        up_m = float(known(s.position_enu_m)[2])
        climb = level(min(self._height_m, max(self.highest_m, up_m)) - up_m, self._p.climb_speed_ms)
        horizontal = towards(offset_m, speed_ms, known(s.velocity_enu_ms))
        course = course_rad(offset_m) if float(np.hypot(*offset_m)) > TURN_M else None
        yaw = None if course is None else course + math.radians(self._p.crab_deg)
        return VehicleCommands(velocity_enu_ms=np.array([*horizontal, climb]), yaw_rad=yaw)

    def way(self, s: Situation) -> Way:
        """Raise the route by a step if it has been blocked for a while; report when it is too high."""
        if not s.blocked:
            self._blocked_since_ns = None
            return Way.FREE
        if self._blocked_since_ns is None:
            self._blocked_since_ns = s.now_ns
        if s.now_ns - self._blocked_since_ns < BLOCKED_NS:
            return Way.FREE
        self._blocked_since_ns = None
        if self._risen_m >= MOST_UP_M or self.height_m + STEP_UP_M > self.highest_m:
            return Way.TOO_HIGH
        self._risen_m += STEP_UP_M
        self._height_m = self.height_m + STEP_UP_M
        return Way.CLIMBING

    def reported_way(self, s: Situation, texts: PilotTexts) -> Way:
        """Raise the route as `way` does, and report the climb."""
        way = self.way(s)
        if way is Way.CLIMBING:
            texts.say(Severity.INFO, "obstacle ahead: climbing")
        return way

    def unblocked(self) -> None:
        """Restart the timer of an obstacle ahead."""
        self._blocked_since_ns = None


def expanding_square(east_m: float, north_m: float, spacing_m: float) -> Iterator[tuple[float, float]]:
    """Yield the corners of an expanding square search about a point (legs 1, 1, 2, 2, 3, 3 ... spacings)."""
    steps = ((1, 0), (0, 1), (-1, 0), (0, -1))
    leg = 0
    while True:
        dx, dy = steps[leg % 4]
        length = spacing_m * (leg // 2 + 1)
        east_m, north_m = east_m + dx * length, north_m + dy * length
        leg += 1
        yield east_m, north_m
