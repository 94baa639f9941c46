"""Oblique look: a ring flown around ground that may be water, which is seen from aside meanwhile.

Still water returns nothing at these angles, and wet tarmac does: from above both are level and smooth.
"""

from __future__ import annotations

import math

import numpy as np

from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.situation import Severity, Situation, Vector, known
from companion.flight.landing.transitions import SECOND
from params import Parameters
from slz import SurfaceHere

LEAST_SHARE, MOST_WATER = 0.5, 0.9  # suspicions worth a look: of `water_suspicion`, and a probability
LOOK_NS = 17 * SECOND
INCIDENCE_DEG = 45.0
NEAREST_M, FARTHEST_M = 5.0, 25.0  # radius of the ring
N_CORNERS = 8
AT_CORNER_M = 2.0
MOST_BLOCKED = 8  # steps towards a corner behind an obstacle, after which the look ends


class ObliqueLook:
    """Flies a ring around a place at the present height, once until the next `reset`.

    Attributes
    ----------
    centre_enu_m
        (3,) the place that is looked at, None before the first look.
    """

    def __init__(self, parameters: Parameters, progress: LandingProgress, texts: PilotTexts) -> None:
        self._p, self._progress, self._texts = parameters, progress, texts
        self.reset()

    def reset(self) -> None:
        """Forget the look at an earlier place."""
        self.centre_enu_m: Vector | None = None
        self._since_ns: int | None = None
        self._is_over = False
        self._n_blocked = self._corner = 0
        self._radius_m = 0.0

    @property
    def is_under_way(self) -> bool:
        """True if the ring is flown now."""
        return self._since_ns is not None and not self._is_over

    def offset(
        self, s: Situation, centre_enu_m: Vector, surface: SurfaceHere, height_m: float
    ) -> Vector | None:
        """Return the offset (2,) to fly for a look at a place; None when it needs none, or no more.

        Parameters
        ----------
        surface
            Present knowledge of the place.
        height_m
            Height above it, not finite where unknown.
        """
        if self._is_over or self._progress.is_urgent:
            return None
        doubtful = LEAST_SHARE * self._p.water_suspicion < surface.water < MOST_WATER
        if not self.is_under_way:
            if not (doubtful and math.isfinite(height_m)):
                return None
            self._begin(s, centre_enu_m, height_m)
        here = known(s.position_enu_m)[:2]
        inside = s.fence.holds_way(here, here + self._to_corner(s))
        if s.blocked or not inside:  # the look is not worth a climb
            self._n_blocked += 1
            self._corner += 1
        late = self._since_ns is not None and s.now_ns - self._since_ns > LOOK_NS
        if late or not doubtful or self._n_blocked > MOST_BLOCKED:
            self._is_over = True
            return None
        offset = self._to_corner(s)
        if math.hypot(*offset) < AT_CORNER_M:
            self._corner += 1
            offset = self._to_corner(s)
        return offset

    def _begin(self, s: Situation, centre_enu_m: Vector, height_m: float) -> None:
        """Begin at the corner on the vehicle's side of the place."""
        self._since_ns, self.centre_enu_m = s.now_ns, centre_enu_m
        radius_m = height_m * math.tan(math.radians(INCIDENCE_DEG))
        self._radius_m = min(FARTHEST_M, max(NEAREST_M, radius_m))
        east_m, north_m = (known(s.position_enu_m) - centre_enu_m)[:2]
        self._corner = round(math.atan2(north_m, east_m) / (2 * math.pi) * N_CORNERS)
        self._texts.say(Severity.INFO, "may be water: looking from aside")

    def _to_corner(self, s: Situation) -> Vector:
        angle = 2 * math.pi * self._corner / N_CORNERS
        corner = known(self.centre_enu_m)[:2] + self._radius_m * np.array([math.cos(angle), math.sin(angle)])
        return np.asarray(corner - known(s.position_enu_m)[:2])
