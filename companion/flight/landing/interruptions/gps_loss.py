"""Loss of GPS: the autopilot's estimate lives on for some seconds, drifting, and then fails.

Each second of flight then is a second of blind sinking with the wind later. So nothing climbs or flies aside
any more: a descent goes on as low as it gets, everything else hovers where it is. A map placed by a drifting
estimate seems to change: the last verified state of the point holds.
"""

from __future__ import annotations

from companion.flight.landing.interruptions.preconditions import Breach
from companion.flight.landing.point_objections import objection
from companion.flight.landing.situation import STOPPED, Phase, Severity, Situation, VehicleCommands
from companion.flight.landing.transitions import LandingCore


class WithoutGps:
    """Reaction to the loss of GPS while no odometry guides the autopilot."""

    def __init__(self, core: LandingCore) -> None:
        self._p, self._progress, self._texts, self._transitions = core

    def report(self, reaction: str) -> None:
        """Report the loss and the reaction to it."""
        self._texts.say(Severity.CRITICAL, f"GPS lost: {reaction}, be ready")

    def hold(self, breach: Breach, s: Situation) -> VehicleCommands:
        """Land at once at a safe point that the vehicle is over, otherwise hover where it is."""
        down = self._descend_at_once(s) if self._progress.phase is Phase.APPROACH else None
        if breach.is_new:
            self.report("hovering" if down is None else "landing at once")
        if down is not None:
            return down
        self._progress.safe_since_ns = None
        self._transitions.restart_limit(s)
        if self._progress.phase is Phase.SURVEY and not s.guided:
            return self._transitions.take_over(s)
        return VehicleCommands(mode=None if s.guided else "guided", velocity_enu_ms=STOPPED)

    def stop_for_object(self, s: Situation) -> VehicleCommands | None:
        """Hover and call the pilot where something came onto the point after the loss; else None."""
        if s.intrusion is None or self._progress.aim.is_low(self._p):
            return None
        self._texts.say(Severity.CRITICAL, "GPS lost, object on the point: take over")
        return self._transitions.break_off(f"object of {s.intrusion.height_m:.1f} m came", s, hold=True)

    def _descend_at_once(self, s: Situation) -> VehicleCommands | None:
        """Descend over a safe point without waiting; None if the vehicle is not ready to go straight down."""
        progress = self._progress
        sloped = self._p.approach_path == "sloped" and not progress.is_urgent
        if progress.safe_since_ns is None or sloped or objection(s, progress, self._p) is not None:
            return None
        self._transitions.enter_phase(Phase.DESCEND, s)
        return VehicleCommands(velocity_enu_ms=STOPPED, target_enu_m=progress.aim.on_ground_enu_m)
