"""Flight from over the point out to the beginning of an approach path, which is seen from above meanwhile.

A helicopter's pilot does the same: a look from high over the place, then out, and in against the wind.
"""

from __future__ import annotations

import math

from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.route import Route
from companion.flight.landing.situation import Severity, Situation, Vector, known
from companion.flight.landing.transitions import SECOND, STUCK_NS
from companion.flight.landing.ways.approach_path import ApproachPath
from companion.flight.landing.ways.way_choice import corridors_of, paths, state_of, straight_down_is_blocked
from params import Parameters
from slz import SAFE, UNKNOWN, UNSAFE, Corridors

AT_ENTRY_M = 3.0
LOOK_NS = 4 * SECOND  # at the beginning of a path, until its air is seen
MOST_TRIED = 3  # bearings flown out along in vain, after which only what is clear already counts


class FlyOut:
    """Chooses the way in, over the point, and flies to where it begins.

    Attributes
    ----------
    path
        The path whose beginning is flown to, None while none is.
    goes_down
        The way in is straight down.
    """

    def __init__(
        self, parameters: Parameters, progress: LandingProgress, texts: PilotTexts, route: Route
    ) -> None:
        self._p, self._progress, self._texts, self._route = parameters, progress, texts, route
        self.reset()

    def reset(self) -> None:
        """Forget the ways to an earlier point."""
        self.path: ApproachPath | None = None
        self.goes_down = False
        self._tried_deg: list[float] = []
        self._at_entry_ns: int | None = None

    def begin(self, s: Situation) -> bool:
        """Choose a way in from over the point; return whether there is one."""
        corridors = corridors_of(s, self._progress.aim)
        blocked = straight_down_is_blocked(corridors)
        sloped = self._p.approach_path == "sloped" or blocked
        self.path, self._at_entry_ns = None, None
        if self._progress.is_urgent or corridors is None or not sloped:
            self.goes_down = True
            return True
        look = len(self._tried_deg) < MOST_TRIED
        self.path = next(iter(self._paths(s, corridors, int(UNKNOWN if look else SAFE))), None)
        if self.path is not None:
            length_m = self.path.length_m
            way_ns = round(2e9 * length_m / self._p.approach_speed_ms)
            self._progress.late_ns = s.now_ns + STUCK_NS + way_ns
            self._texts.say(Severity.INFO, f"flying out to {self.path.bearing_deg:.0f} deg for the approach")
            return True
        if blocked:
            return False
        self._texts.say(Severity.NOTICE, "no clear way in: straight down")
        self.goes_down = True
        return True

    def offset(self, s: Situation) -> Vector | None:
        """Return the offset (2,) to the path's beginning; None where the path begins, or is given up.

        Where something stands in it, or its air stays unseen, a steeper one of its bearing replaces it; with
        none it is given up, and `path` None.
        """
        if self._progress.is_urgent:  # the battery became low meanwhile: back, and straight down
            self.path = None
        path, corridors = self.path, corridors_of(s, self._progress.aim)
        if path is None:
            return None
        state = int(UNKNOWN) if corridors is None else state_of(corridors, path)
        offset = path.entry_offset_m(known(s.position_enu_m), self._progress.aim.on_ground_enu_m)
        if math.hypot(*offset) >= AT_ENTRY_M and self._at_entry_ns is None:
            if state != UNSAFE:
                return offset
            return self._steeper(s, path, int(UNKNOWN))
        if self._at_entry_ns is None:
            self._at_entry_ns = s.now_ns
        if state == SAFE:
            return None
        if state == UNKNOWN and s.now_ns - self._at_entry_ns < LOOK_NS:
            return offset
        return self._steeper(s, path, int(SAFE))

    def _steeper(self, s: Situation, path: ApproachPath, least_state: int) -> Vector | None:
        """Go on with a steeper path of the same bearing, or give that bearing up."""
        corridors = corridors_of(s, self._progress.aim)
        found = [] if corridors is None else self._paths(s, corridors, least_state)
        self._at_entry_ns = None
        self.path = next((one for one in found if one.bearing_deg == path.bearing_deg), None)
        if self.path is None:
            self._tried_deg.append(path.bearing_deg)
        return self.offset(s)

    def _paths(self, s: Situation, corridors: Corridors, least_state: int) -> list[ApproachPath]:
        return paths(
            corridors,
            self._p,
            least_state=least_state,
            route_over_point_m=self._route.height_m - float(self._progress.aim.on_ground_enu_m[2]),
            wind=s.wind if self._p.into_wind == "on" else None,
            position_enu_m=known(s.position_enu_m),
            tried_deg=self._tried_deg,
            fence=s.fence,
        )
