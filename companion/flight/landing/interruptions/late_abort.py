"""Late abort: the autopilot lands although the landing was given up, or begins to land after that.

A decision has an age. One that could not be sent while the link was out is judged anew when it is back, and
below the commit height one that the autopilot has not obeyed in a second is void.
"""

from __future__ import annotations

from companion.flight.landing.orders.mode_ownership import ModeOwnership
from companion.flight.landing.phases.descent import Descent
from companion.flight.landing.situation import STOPPED, Phase, Severity, Situation, VehicleCommands
from companion.flight.landing.transitions import SECOND, LandingCore

OBEYS_NS = SECOND  # from the decision, in which the autopilot leaves its landing and its mode shows


class LateAbort:
    """Watch on an abort that asks the autopilot to leave its landing."""

    def __init__(self, core: LandingCore, ownership: ModeOwnership, descent: Descent) -> None:
        self._p, self._progress, self._texts, self._transitions = core
        self._ownership, self._descent = ownership, descent
        self._was_silent = False  # since the decision

    def is_void(self, s: Situation) -> bool:
        """Return whether a landing that was given up must be watched again; call it at every step."""
        progress = self._progress
        if progress.phase not in (Phase.CLIMB, Phase.HOLD) or not self._ownership.lands_for_us(s):
            self._was_silent = False
            return False
        self._was_silent = self._was_silent or not s.heard
        is_late = progress.aim.is_low(self._p) and s.now_ns - progress.since_ns > OBEYS_NS
        return s.heard and (is_late or (self._was_silent and not progress.is_ordered_abort))

    def watch_again(self, s: Situation) -> VehicleCommands:
        """Watch a landing again that the autopilot was not made to leave in time."""
        aim = self._progress.aim
        if s.position_enu_m is None or aim.enu_m is None:
            return VehicleCommands()
        self._texts.say(Severity.WARNING, "abort too late: watching the landing again")
        self._descent.resume(s, aim.on_ground_enu_m)
        return self._descent.final_commands(s)

    def leave_landing(self, s: Situation) -> VehicleCommands | None:
        """Leave a landing mode entered after it was given up: nobody chose this ground; None without one."""
        phase = self._progress.phase
        waits = phase is Phase.DESCEND and self._descent.waits
        landing = phase in (Phase.FINAL, Phase.CLIMB, Phase.HOLD) or waits
        if landing or not self._ownership.lands_for_us(s):
            return None
        self._texts.say(Severity.WARNING, "LAND came late: climbing")
        self._transitions.enter_phase(Phase.CLIMB, s)
        return VehicleCommands(mode="guided", velocity_enu_ms=STOPPED)
