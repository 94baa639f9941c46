"""Reactions to the interruptions of a phase, in the order in which they are checked."""

from __future__ import annotations

from companion.flight.landing.check_order import Check, first_commands
from companion.flight.landing.interruptions.gps_loss import WithoutGps
from companion.flight.landing.interruptions.late_abort import LateAbort
from companion.flight.landing.interruptions.missing_input import MissingInputs
from companion.flight.landing.interruptions.preconditions import (
    Breach,
    Precondition,
    Preconditions,
    Reaction,
)
from companion.flight.landing.interruptions.withdrawal import MOST_CAUSE, Withdrawal
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.phases.waiting import Waiting
from companion.flight.landing.pilot_texts import PilotTexts, bracketed
from companion.flight.landing.situation import COMMANDING, Phase, Severity, Situation, VehicleCommands
from companion.flight.landing.transitions import Transitions

ENDING = (Reaction.ENDS, Reaction.HANDS_OFF, Reaction.STAND_BACK)


class Reactions:
    """Commands of the first interruption that demands some.

    Attributes
    ----------
    checks
        Interruptions in the order in which they are checked; `preconditions.TABLE` orders the breaches.
    """

    def __init__(
        self,
        progress: LandingProgress,
        texts: PilotTexts,
        transitions: Transitions,
        preconditions: Preconditions,
        withdrawal: Withdrawal,
        late_abort: LateAbort,
        without_gps: WithoutGps,
        missing_inputs: MissingInputs,
        waiting: Waiting,
    ) -> None:
        self.checks: tuple[Check, ...] = (
            self.void_abort, self.refused_mode, self.breach, self.lost_pose, self.late_landing,
        )  # fmt: skip
        self._progress, self._texts, self._transitions = progress, texts, transitions
        self._preconditions, self._withdrawal, self._late_abort = preconditions, withdrawal, late_abort
        self._without_gps, self._missing_inputs, self._waiting = without_gps, missing_inputs, waiting
        self._breach: Breach | None = None  # of this step
        self._is_refused = False

    def on_refusal(self) -> None:
        """Begin nothing any more after the pilot was called for a refused mode."""
        self._is_refused = True

    def commands(self, s: Situation) -> VehicleCommands | None:
        """Return the commands that an interruption demands; None where the phase goes on."""
        reclassified = self._withdrawal.reclassify_as_failsafe(s)
        if reclassified is not None or self._progress.phase not in COMMANDING:
            return reclassified
        self._breach = self._preconditions.breach(s)
        return first_commands(self.checks, s)

    def void_abort(self, s: Situation) -> VehicleCommands | None:
        """Watch the landing again that an abort did not end in time."""
        ends = self._breach is not None and self._breach.reaction in ENDING
        return self._late_abort.watch_again(s) if self._late_abort.is_void(s) and not ends else None

    def refused_mode(self, s: Situation) -> VehicleCommands | None:
        """Hold where the autopilot refused to land; the phase commands that."""
        if self._is_refused and s.guided and self._progress.phase is Phase.FINAL:
            self._transitions.enter_phase(Phase.HOLD, s)
        self._is_refused = False
        return None

    def breach(self, s: Situation) -> VehicleCommands | None:
        """Execute the reaction to a violated precondition; None where the phase goes on."""
        breach = self._breach
        if breach is None:
            return None
        match breach.reaction:
            case Reaction.ENDS:
                return self._waiting.finish(s)
            case Reaction.HANDS_OFF:
                return self._withdrawal.hands_off(breach, s)
            case Reaction.STAND_BACK:
                return self._withdrawal.stand_back(breach, s)
            case Reaction.BREAK_OFF if breach.precondition is not Precondition.POSITION:
                by_wind = breach.precondition is Precondition.WIND
                return self._transitions.break_off(breach.what, s, keeps_point=by_wind)
            case Reaction.CALL:
                self._transitions.call_pilot(breach.what, s)
            case Reaction.HOLD if breach.precondition is Precondition.PLACE:
                return self._without_gps.hold(breach, s)
            case Reaction.TELL:
                self._report(breach, s)
        return None

    def lost_pose(self, s: Situation) -> VehicleCommands | None:
        """Hold without a position or velocity."""
        if s.position_enu_m is not None and s.velocity_enu_ms is not None:
            return None
        taking_over = self._progress.phase is Phase.SURVEY and not s.guided
        return self._transitions.take_over(s) if taking_over else self._missing_inputs.without_pose(s)

    def late_landing(self, s: Situation) -> VehicleCommands | None:
        """Leave a landing mode that came after the landing was given up."""
        return self._late_abort.leave_landing(s)

    def _report(self, breach: Breach, s: Situation) -> None:
        """Report a breach with which the landing continues."""
        say = self._texts.say
        match breach.precondition:
            case Precondition.PLACE:
                self._without_gps.report("landing at once")
            case Precondition.GPS:
                say(Severity.CRITICAL, f"GPS lost: going on by the {s.place_by}")
            case Precondition.GLITCH:
                say(Severity.CRITICAL, "GPS glitch: position may jump, be ready")
            case Precondition.DRIFT:
                say(Severity.CRITICAL, f"GPS drifts off the {s.place_by}, {s.gps_drift_m:.1f} m in 10 s")
            case _:
                say(Severity.CRITICAL, f"failsafe{bracketed(breach.what, MOST_CAUSE)}: going on")
