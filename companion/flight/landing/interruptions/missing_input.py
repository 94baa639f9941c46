"""Hovering without scans or position, and the call to the pilot when that lasts."""

from __future__ import annotations

from companion.flight.landing.landing_state import LandingState
from companion.flight.landing.situation import (
    STOPPED,
    MissingInput,
    Phase,
    Severity,
    Situation,
    VehicleCommands,
)


def without_lidar(state: LandingState, s: Situation) -> VehicleCommands:
    """Stop; call the pilot after ten seconds."""
    _wait_for(state, s.no_map_reason, s)
    return VehicleCommands(velocity_enu_ms=STOPPED)


def without_pose(state: LandingState, s: Situation) -> VehicleCommands:
    """Hold by the autopilot's own estimate; break off a landing that cannot be watched any more."""
    if state.phase is Phase.FINAL and state.last_state_holds:
        return VehicleCommands()
    if state.phase in (Phase.DESCEND, Phase.FINAL):
        state.break_off(MissingInput.POSITION_LOST.text, s)
    _wait_for(state, MissingInput.POSITION_LOST, s)
    return VehicleCommands(mode=None if s.guided else "guided", velocity_enu_ms=STOPPED)


def report_input_back(state: LandingState, s: Situation) -> None:
    """Report once that the input of a call is back: the vehicle hovers until the next order."""
    if missing := state.outage.on_present(s.now_ns):
        state.say(Severity.WARNING, f"{missing.thing} back: hovering, order again")


def _wait_for(state: LandingState, missing: MissingInput, s: Situation) -> None:
    state.safe_since_ns = None
    text = f"{missing.text}: holding"
    state.note_lasting(text)
    if state.outage.on_missing(missing, s.now_ns):
        state.say(Severity.WARNING, text)
    if state.outage.calls_for(missing, s.now_ns):
        state.say(Severity.CRITICAL, f"{missing.thing} still {missing.state}: take over")
        if state.phase is not Phase.HOLD:
            state.go(Phase.HOLD, s)
