"""Closer look: a small square flown around the point while a hazard there may have gone unseen."""

from __future__ import annotations

import itertools
import math

import numpy as np

from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.situation import Severity, Situation, Vector, known
from companion.flight.landing.transitions import SECOND
from params import Parameters

MOST_UNSEEN = 0.01  # probability that a hazard got no return, from which on no more looking is needed
LOOK_NS = 20 * SECOND
AWAY_M, AT_CORNER_M = 2.0, 0.7  # corners from the point, and distance at which one is reached
LOOK_MS = 1.0
MOST_BLOCKED = 8  # steps towards a corner behind an obstacle, after which the look ends
CORNERS = ((AWAY_M, 0.0), (0.0, AWAY_M), (-AWAY_M, 0.0), (0.0, -AWAY_M))


class CloserLook:
    """Shifts the vehicle so that scan lines fall between those of before."""

    def __init__(self, parameters: Parameters, progress: LandingProgress, texts: PilotTexts) -> None:
        self._p, self._progress, self._texts = parameters, progress, texts
        self.reset()

    def reset(self) -> None:
        """Forget the look at an earlier point."""
        self._since_ns: int | None = None
        self._is_over = False
        self._n_blocked = 0
        self._corners = itertools.cycle(map(np.array, CORNERS))
        self._corner: Vector = next(self._corners)

    def offset(self, s: Situation) -> Vector | None:
        """Return the offset (2,) to fly for a closer look at the point; None when it needs none."""
        progress, selected = self._progress, s.selected
        if self._is_over or progress.is_urgent or selected is None or not progress.aim.is_at(selected):
            return None
        unseen, hazard_m = selected.footing.unseen, self._p.hazard_size_m
        if not unseen > MOST_UNSEEN:  # NaN: no evidence of cells
            return None
        if self._since_ns is None:
            self._since_ns = s.now_ns
            self._texts.say(Severity.INFO, f"{unseen:.0%} of {hazard_m:g} m hazards unseen: looking closer")
        corner_m = known(progress.aim.enu_m)[:2] + self._corner
        if s.blocked or not s.fence.holds(corner_m):  # the look is not worth a climb
            self._n_blocked += 1
            self._corner = next(self._corners)
        if s.now_ns - self._since_ns > LOOK_NS or self._n_blocked > MOST_BLOCKED:
            self._is_over = True
            self._texts.say(Severity.WARNING, f"{unseen:.0%} of {hazard_m:g} m hazards stay unseen")
            return None
        offset = known(progress.aim.enu_m)[:2] + self._corner - known(s.position_enu_m)[:2]
        if math.hypot(*offset) < AT_CORNER_M:
            self._corner = next(self._corners)
        return np.asarray(offset)
