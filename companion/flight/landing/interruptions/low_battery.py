"""Low battery: land at the zone reached soonest, and call the pilot while there is none."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.orders.confirmation import must_be_confirmed
from companion.flight.landing.situation import Phase, Severity, Situation
from companion.flight.landing.transitions import SECOND, LandingCore
from companion.flight.landing.ways.endurance import is_battery_low
from companion.flight.landing.zone_choice import SoonestZone

CALL_AGAIN_NS = 30 * SECOND  # while there is no zone
RECHARGED_PCT = 10.0  # above the low charge: another battery, for which everything is said anew


class LowBattery:
    """Watch on the charge that the autopilot reports."""

    def __init__(self, core: LandingCore, soonest: SoonestZone) -> None:
        self._p, self._progress, self._texts, self._transitions = core
        self._soonest = soonest
        self._said_ns: int | None = None

    def update(self, s: Situation) -> None:
        """Make the landing under way urgent, and warn; before a hand-over only warn."""
        progress, say, said_ns = self._progress, self._texts.say, self._said_ns
        if s.battery_pct is not None and s.battery_pct > self._p.battery_land_pct + RECHARGED_PCT:
            self._said_ns = None
        if not is_battery_low(s, self._p):
            return
        if said_ns is not None and (s.now_ns - said_ns <= CALL_AGAIN_NS or not self._lacks_zone(s)):
            return
        on_its_way = progress.request is not None and progress.phase in (
            Phase.SURVEY,
            Phase.APPROACH,
            Phase.CLIMB,
        )
        if self._lacks_zone(s):
            say(Severity.CRITICAL, "battery low, no zone: take over")
        elif on_its_way:
            say(Severity.CRITICAL, "battery low: landing at the nearest zone")
        elif progress.phase in (Phase.IDLE, Phase.LANDED, Phase.HOLD) and s.armed and s.on_ground is not True:
            say(Severity.CRITICAL, "battery low: land")
        else:  # the autopilot's landing, a failsafe, or on the ground: no warning yet
            return
        self._said_ns = s.now_ns
        if said_ns is None and on_its_way:
            self._transitions.replace_request(urgent=True)
            if progress.phase is Phase.APPROACH and self._is_nearer_elsewhere(s):
                self._transitions.enter_phase(Phase.SURVEY, s)

    def _lacks_zone(self, s: Situation) -> bool:
        """Return whether a landing is ordered, no point is flown to, and no zone is known."""
        progress = self._progress
        looks = progress.phase in (Phase.SURVEY, Phase.CLIMB, Phase.HOLD) and progress.request is not None
        return looks and self._soonest.zone(s) is None

    def _is_nearer_elsewhere(self, s: Situation) -> bool:
        zone = self._soonest.zone(s)
        if zone is None or s.position_enu_m is None:
            return False
        if must_be_confirmed(zone.best.surface, self._p):
            return False
        return bool(np.hypot(*(zone.best.enu_m - s.position_enu_m)[:2]) < self._progress.aim.away_m)
