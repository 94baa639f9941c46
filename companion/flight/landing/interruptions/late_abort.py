"""Abort that was not carried out in time: the autopilot lands all the same.

A decision has an age. One that could not be sent while the link was out is judged anew when it is back, and
below the commit height one that the autopilot has not obeyed in a second is void.
"""

from __future__ import annotations

from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.situation import Phase, Situation

OBEYS_NS = SECOND  # from the decision, in which the autopilot leaves its landing and its mode shows


class LateAbort:
    """Watches an abort that asks the autopilot to leave its landing."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._was_silent = False  # since the decision

    def is_void(self, s: Situation) -> bool:
        """Return whether the landing that was given up is to be watched again; call it at every step."""
        state = self._state
        if state.phase not in (Phase.CLIMB, Phase.HOLD) or not state.ownership.lands_for_us(s):
            self._was_silent = False
            return False
        self._was_silent = self._was_silent or not s.heard
        is_late = state.is_low and s.now_ns - state.since_ns > OBEYS_NS
        return s.heard and (is_late or (self._was_silent and not state.is_ordered_abort))
