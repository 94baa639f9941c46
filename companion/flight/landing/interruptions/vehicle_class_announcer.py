"""Announcement of a vehicle that must not be commanded, and that it may be again."""

from __future__ import annotations

from companion.flight.landing.landing_state import LandingState
from companion.flight.landing.situation import COMMANDING, Severity, Situation


class VehicleClassAnnouncer:
    """Says once that nothing is commanded, and why; during a landing its interruption says so."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._reason = ""

    def update(self, s: Situation) -> None:
        """Report the first reason against commands, and its end."""
        before, state = self._reason, self._state
        if not s.connected or s.no_command_reason == before:
            return
        self._reason = s.no_command_reason
        if not self._reason:
            state.say(Severity.INFO, "the vehicle may be commanded now")
        elif not before and state.phase not in COMMANDING:
            state.say(Severity.WARNING, f"{self._reason}: mapping only")
