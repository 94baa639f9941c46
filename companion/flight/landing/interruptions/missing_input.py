"""Late data: hovering without scans or position, and the call to the pilot when that lasts."""

from __future__ import annotations

from companion.flight.landing.outage import GpsLoss, Outage
from companion.flight.landing.situation import (
    STOPPED,
    MissingInput,
    Phase,
    Severity,
    Situation,
    VehicleCommands,
)
from companion.flight.landing.transitions import LandingCore


class MissingInputs:
    """Reaction to scans, maps or positions that are late."""

    def __init__(self, core: LandingCore, outage: Outage, gps_loss: GpsLoss) -> None:
        self._p, self._progress, self._texts, self._transitions = core
        self._outage, self._gps_loss = outage, gps_loss

    def without_lidar(self, s: Situation) -> VehicleCommands:
        """Stop; call the pilot after ten seconds."""
        self._wait_for(s.no_map_reason, s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def without_pose(self, s: Situation) -> VehicleCommands:
        """Hold by the autopilot's own estimate; break off a landing that cannot be watched any more."""
        progress = self._progress
        last_state_holds = progress.aim.is_low(self._p) or self._gps_loss.is_on
        if progress.phase is Phase.FINAL and last_state_holds:
            return VehicleCommands()
        if progress.phase in (Phase.DESCEND, Phase.FINAL):
            self._transitions.break_off(MissingInput.POSITION_LOST.text, s)
        self._wait_for(MissingInput.POSITION_LOST, s)
        return VehicleCommands(mode=None if s.guided else "guided", velocity_enu_ms=STOPPED)

    def on_present(self, s: Situation) -> None:
        """Record that nothing is missing in this step."""
        self._outage.on_present(s.now_ns)

    def report_back(self, s: Situation) -> None:
        """Report once that the input of a call is back: the vehicle hovers until the next order."""
        if missing := self._outage.on_present(s.now_ns):
            self._texts.say(Severity.WARNING, f"{missing.thing} back: hovering, order again")

    def _wait_for(self, missing: MissingInput, s: Situation) -> None:
        self._progress.safe_since_ns = None
        text = f"{missing.text}: holding"
        self._texts.note_lasting(text)
        if self._outage.on_missing(missing, s.now_ns):
            self._texts.say(Severity.WARNING, text)
        if self._outage.calls_for(missing, s.now_ns):
            self._texts.say(Severity.CRITICAL, f"{missing.thing} still {missing.state}: take over")
            if self._progress.phase is not Phase.HOLD:
                self._transitions.enter_phase(Phase.HOLD, s)
