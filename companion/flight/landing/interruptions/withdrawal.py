"""Withdrawal: nothing is commanded while the pilot or a failsafe of the autopilot flies the vehicle."""

from __future__ import annotations

from companion.flight.landing.interruptions.preconditions import Breach, Precondition, Reaction
from companion.flight.landing.landing_state import SECOND, LandingState, bracketed
from companion.flight.landing.situation import Phase, Severity, Situation, VehicleCommands

CALM_NS = 3 * SECOND  # without a sign of it, until a failsafe is over
MOST_CAUSE = 21  # characters of cause and mode in one STATUSTEXT
RECLASSIFY_NS = 2 * SECOND  # PX4's heartbeat, which reports a failsafe, comes each second


class Withdrawal:
    """Stops commanding for the pilot or a failsafe; during a failsafe reports each further mode."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._taken: tuple[str, int] | None = None  # mode set by another party, and its time
        self._told_mode = ""  # last reported mode of the failsafe
        self._calm_since_ns: int | None = None  # since then without failsafe

    def hands_off(self, breach: Breach, s: Situation) -> VehicleCommands:
        """Leave control to whoever moved the sticks, set another mode or target, or flies on a wing now."""
        if breach.precondition is Precondition.CLASS:
            text = f"{breach.what}: hands off"
        elif breach.precondition is Precondition.COMMANDER:
            text = f"target of {breach.what} flies, not ours: hands off"
            self._state.hand_over.end()
        elif breach.precondition is Precondition.STICKS:
            text = f"pilot moves the sticks in {s.mode}: hands off"
        else:
            text = f"pilot set {s.mode}: hands off" if s.switched else f"{s.mode} set, not by SLZ: hands off"
        self._state.say(Severity.WARNING, text)
        self._state.tally.hands_off += 1
        self._state.rest(Phase.IDLE, s)
        self._taken = (s.mode, s.now_ns) if breach.precondition is Precondition.MODE else None
        return VehicleCommands()

    def reclassify_as_failsafe(self, s: Situation) -> VehicleCommands | None:
        """Stand back if a failsafe explains a mode change attributed to the pilot; otherwise return None.

        The autopilot may report its failsafe up to two seconds after the mode.
        """
        if self._taken is None or self._state.phase is not Phase.IDLE:
            return None
        mode, taken_ns = self._taken
        if s.mode != mode or s.now_ns - taken_ns > RECLASSIFY_NS:
            self._taken = None
        elif s.failsafe or s.breached or s.estimate_lost:
            self._state.tally.hands_off -= 1
            return self.stand_back(Breach(Precondition.MODE, Reaction.STAND_BACK, mode), s)
        return None

    def stand_back(self, breach: Breach, s: Situation) -> VehicleCommands:
        """Stop commanding: the autopilot flies by its own failsafe, or without an estimate."""
        self._taken = None
        cause = breach.what if breach.precondition is Precondition.ESTIMATE else s.cause
        because = bracketed(cause, MOST_CAUSE - len(s.mode))
        self._state.say(Severity.CRITICAL, f"failsafe{because}: {s.mode}, take over")
        self._state.tally.failsafes.append(cause or "failsafe")
        self._state.hand_over.end()
        self._told_mode, self._calm_since_ns = s.mode, None
        self._state.rest(Phase.FAILSAFE, s)
        return VehicleCommands()

    def commands(self, s: Situation) -> VehicleCommands:
        """Wait for the end of the failsafe and report its mode; a new hand-over is needed afterwards."""
        state = self._state
        if s.connected and (not s.armed or s.on_ground is True):
            state.say(Severity.WARNING, "on the ground by the autopilot's failsafe")
            state.rest(Phase.IDLE, s)
            return VehicleCommands()
        if s.mode != self._told_mode:
            self._told_mode = s.mode
            state.say(Severity.CRITICAL, f"failsafe: {s.mode}, take over")
        if s.failsafe or s.breached or s.estimate_lost or not s.connected:
            self._calm_since_ns = None
        elif self._calm_since_ns is None:
            self._calm_since_ns = s.now_ns
        elif s.now_ns - self._calm_since_ns > CALM_NS:
            state.call_for_hand_over("failsafe over", s)
            state.told_to_hand_over_ns = s.now_ns
            state.rest(Phase.IDLE, s)
        return VehicleCommands()
