"""Low battery: land at the zone reached soonest, and call the pilot while there is none."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.situation import LandingRequest, Phase, Severity, Situation
from companion.flight.landing.zone_choice import must_be_confirmed

CALL_AGAIN_NS = 30 * SECOND  # while there is no zone
RECHARGED_PCT = 10.0  # above the low charge: another battery, for which everything is said anew


class LowBattery:
    """Watch on the charge that the autopilot reports."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._said_ns: int | None = None

    def update(self, s: Situation) -> None:
        """Make the landing under way urgent, and warn; before a hand-over only warn."""
        state, said_ns = self._state, self._said_ns
        if s.battery_pct is not None and s.battery_pct > state.parameters.battery_land_pct + RECHARGED_PCT:
            self._said_ns = None
        if not state.is_battery_low(s):
            return
        if said_ns is not None and (s.now_ns - said_ns <= CALL_AGAIN_NS or not self._lacks_zone(s)):
            return
        on_its_way = state.request is not None and state.phase in (Phase.SURVEY, Phase.APPROACH, Phase.CLIMB)
        if self._lacks_zone(s):
            state.say(Severity.CRITICAL, "battery low, no zone: take over")
        elif on_its_way:
            state.say(Severity.CRITICAL, "battery low: landing at the nearest zone")
        elif state.phase in (Phase.IDLE, Phase.LANDED, Phase.HOLD) and s.armed and s.on_ground is not True:
            state.say(Severity.CRITICAL, "battery low: land")
        else:  # the autopilot's landing, a failsafe, or on the ground: no warning yet
            return
        self._said_ns = s.now_ns
        if said_ns is None and on_its_way:
            state.request = LandingRequest(urgent=True)
            if state.phase is Phase.APPROACH and self._is_nearer_elsewhere(s):
                state.go(Phase.SURVEY, s)

    def _lacks_zone(self, s: Situation) -> bool:
        """Return whether a landing is ordered, no point is flown to, and no zone is known."""
        state = self._state
        looks = state.phase in (Phase.SURVEY, Phase.CLIMB, Phase.HOLD) and state.request is not None
        return looks and state.soonest_zone(s) is None

    def _is_nearer_elsewhere(self, s: Situation) -> bool:
        zone = self._state.soonest_zone(s)
        if zone is None or s.position_enu_m is None:
            return False
        if must_be_confirmed(zone.best.surface, self._state.parameters):
            return False
        return bool(np.hypot(*(zone.best.enu_m - s.position_enu_m)[:2]) < self._state.aim.away_m)
