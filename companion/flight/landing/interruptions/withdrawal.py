"""Withdrawal: no commands while the pilot or a failsafe flies, nor to a vehicle of the wrong class."""

from __future__ import annotations

from companion.flight.landing.check_order import Check
from companion.flight.landing.interruptions.preconditions import Breach, Precondition, Reaction
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.orders.mode_ownership import HandOver
from companion.flight.landing.pilot_texts import PilotTexts, bracketed
from companion.flight.landing.situation import COMMANDING, Phase, Severity, Situation, VehicleCommands
from companion.flight.landing.transitions import SECOND, Transitions

CALM_NS = 3 * SECOND  # without a sign of it, until a failsafe is over
MOST_CAUSE = 21  # characters of cause and mode in one STATUSTEXT
RECLASSIFY_NS = 2 * SECOND  # PX4's heartbeat, which reports a failsafe, comes each second


class Withdrawal:
    """Stops commanding for the pilot or a failsafe; during a failsafe reports each further mode."""

    def __init__(
        self,
        auto: bool,
        progress: LandingProgress,
        texts: PilotTexts,
        transitions: Transitions,
        hand_over: HandOver,
    ) -> None:
        self.checks: tuple[Check, ...] = (self.on_ground, self.next_mode, self.calm)
        self._auto, self._progress, self._texts = auto, progress, texts
        self._transitions, self._hand_over = transitions, hand_over
        self._taken: tuple[str, int] | None = None  # mode set by another party, and its time
        self._reported_mode = ""  # last reported mode of the failsafe
        self._calm_since_ns: int | None = None  # since then without failsafe

    def hands_off(self, breach: Breach, s: Situation) -> VehicleCommands:
        """Leave control to whoever moved the sticks, set another mode or target, or flies on a wing now."""
        if breach.precondition is Precondition.CLASS:
            text = f"{breach.what}: hands off"
        elif breach.precondition is Precondition.COMMANDER:
            text = f"target of {breach.what} flies, not ours: hands off"
            self._hand_over.end()
        elif breach.precondition is Precondition.STICKS:
            text = f"pilot moves the sticks in {s.mode}: hands off"
        else:
            text = f"pilot set {s.mode}: hands off" if s.switched else f"{s.mode} set, not by SLZ: hands off"
        self._texts.say(Severity.WARNING, text)
        self._progress.tally.hands_off += 1
        self._transitions.end_request(Phase.IDLE, s)
        self._taken = (s.mode, s.now_ns) if breach.precondition is Precondition.MODE else None
        return VehicleCommands()

    def reclassify_as_failsafe(self, s: Situation) -> VehicleCommands | None:
        """Stand back if a failsafe explains a mode change attributed to the pilot; otherwise return None.

        The autopilot may report its failsafe up to two seconds after the mode.
        """
        if self._taken is None or self._progress.phase is not Phase.IDLE:
            return None
        mode, taken_ns = self._taken
        if s.mode != mode or s.now_ns - taken_ns > RECLASSIFY_NS:
            self._taken = None
        elif s.failsafe or s.breached or s.estimate_lost:
            self._progress.tally.hands_off -= 1
            return self.stand_back(Breach(Precondition.MODE, Reaction.STAND_BACK, mode), s)
        return None

    def stand_back(self, breach: Breach, s: Situation) -> VehicleCommands:
        """Stop commanding: the autopilot flies by its own failsafe, or without an estimate."""
        self._taken = None
        cause = breach.what if breach.precondition is Precondition.ESTIMATE else s.cause
        because = bracketed(cause, MOST_CAUSE - len(s.mode))
        self._texts.say(Severity.CRITICAL, f"failsafe{because}: {s.mode}, take over")
        self._progress.tally.failsafes.append(cause or "failsafe")
        self._hand_over.end()
        self._reported_mode, self._calm_since_ns = s.mode, None
        self._transitions.end_request(Phase.FAILSAFE, s)
        return VehicleCommands()

    def on_ground(self, s: Situation) -> VehicleCommands | None:
        """End on the ground."""
        if not s.connected or (s.armed and s.on_ground is not True):
            return None
        self._texts.say(Severity.WARNING, "on the ground by the autopilot's failsafe")
        self._transitions.end_request(Phase.IDLE, s)
        return VehicleCommands()

    def next_mode(self, s: Situation) -> None:
        """Report each further mode of the failsafe."""
        if s.mode != self._reported_mode:
            self._reported_mode = s.mode
            self._texts.say(Severity.CRITICAL, f"failsafe: {s.mode}, take over")

    def calm(self, s: Situation) -> None:
        """End after three seconds without a sign of the failsafe, and ask for a hand-over."""
        if s.failsafe or s.breached or s.estimate_lost or not s.connected:
            self._calm_since_ns = None
        elif self._calm_since_ns is None:
            self._calm_since_ns = s.now_ns
        elif s.now_ns - self._calm_since_ns > CALM_NS:
            self._texts.ask_for_hand_over("failsafe over", s, self._auto)
            self._hand_over.asked_ns = s.now_ns
            self._transitions.end_request(Phase.IDLE, s)


class VehicleClassAnnouncer:
    """Announcement of a vehicle that must not be commanded; during a landing the interruption reports it."""

    def __init__(self, progress: LandingProgress, texts: PilotTexts) -> None:
        self._progress, self._texts = progress, texts
        self._reason = ""

    def update(self, s: Situation) -> None:
        """Report the first reason against commands, and its end."""
        before = self._reason
        if not s.connected or s.no_command_reason == before:
            return
        self._reason = s.no_command_reason
        if not self._reason:
            self._texts.say(Severity.INFO, "the vehicle may be commanded now")
        elif not before and self._progress.phase not in COMMANDING:
            self._texts.say(Severity.WARNING, f"{self._reason}: mapping only")
