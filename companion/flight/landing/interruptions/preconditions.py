"""Preconditions of each stage of a landing, with the reaction to each violation.

`TABLE` is the table of docs/reactions.md. `Preconditions` checks it at every step.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from companion.flight.landing.interruptions.velocity_following import VelocityFollowing
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.orders.mode_ownership import ModeOwnership
from companion.flight.landing.outage import GpsLoss
from companion.flight.landing.situation import Phase, Situation
from companion.flight.landing.sticks import StickWatch
from companion.flight.landing.wind.landing_wind import LandingWind
from params import Parameters


class Stage(Enum):
    """Columns of the table: the commanding phases, and the landing below `commit_height_m`."""

    SURVEY = "survey"
    APPROACH = "approach"
    DESCEND = "descend"
    FINAL = "final"
    COMMITTED = "committed"
    CLIMB = "climb"
    HOLD = "hold"


LANDING = (Stage.FINAL, Stage.COMMITTED)


class Precondition(Enum):
    """Rows of the table, in the order in which they are checked."""

    ARMED = "armed, in the air"
    CLASS = "flies as a multirotor or helicopter"
    MODE = "mode set by slz or at the hand-over"
    COMMANDER = "no other commander"
    ESTIMATE = "estimator trusted"
    NO_FAILSAFE = "no failsafe"
    GPS = "GPS has a fix"
    PLACE = "GPS has a fix, or the odometry guides the autopilot"
    GLITCH = "GPS used by the estimator"
    DRIFT = "GPS and LiDAR odometry agree"
    STICKS = "sticks at rest"
    POSITION = "position known"
    TARGET = "landing target used"
    OVER = "over the point"
    SINKS = "sinks"
    NO_UNASKED_SINK = "does not sink unasked"
    FOLLOWS = "follows the velocity asked"
    WIND = "gusts up to `max_wind_ms`"


class Reaction(Enum):
    """Reactions of the executive."""

    ENDS = "ends"  # the flight is over
    HANDS_OFF = "hands off"  # the pilot flies: no more commands
    STAND_BACK = "stand back"  # the autopilot flies in its failsafe or without an estimate: no more commands
    BREAK_OFF = "break off"  # guided mode, climb, next zone
    HOLD = "hold"  # stand still until the precondition holds again
    RETURN = "return"  # stop sinking and fly back over the point
    WAIT = "wait"  # begin no landing until the precondition holds; by the phase itself
    CALL = "call"  # "take over", while still commanding the vehicle
    TELL = "tell"  # warn the pilot and go on
    NONE = "-"  # no precondition


def _row(*reactions: Reaction) -> dict[Stage, Reaction]:
    every = reactions * len(Stage) if len(reactions) == 1 else reactions
    return dict(zip(Stage, every, strict=True))


_NO, _BREAK, _CALL, _OFF = Reaction.NONE, Reaction.BREAK_OFF, Reaction.CALL, Reaction.HANDS_OFF
_HOLD, _WAIT = Reaction.HOLD, Reaction.WAIT
# Columns: survey, approach, descend, final, committed, climb, hold.
TABLE: dict[Precondition, dict[Stage, Reaction]] = {
    Precondition.ARMED: _row(Reaction.ENDS),
    Precondition.CLASS: _row(_OFF),
    Precondition.MODE: _row(_OFF),
    Precondition.COMMANDER: _row(_OFF, _OFF, _OFF, _NO, _NO, _OFF, _OFF),
    Precondition.ESTIMATE: _row(Reaction.STAND_BACK),
    Precondition.NO_FAILSAFE: _row(Reaction.TELL),
    Precondition.GPS: _row(Reaction.TELL),
    Precondition.PLACE: _row(_HOLD, _HOLD, Reaction.TELL, Reaction.TELL, Reaction.TELL, _HOLD, _HOLD),
    Precondition.GLITCH: _row(Reaction.TELL),
    Precondition.DRIFT: _row(Reaction.TELL),
    Precondition.STICKS: _row(_NO, _NO, _NO, _OFF, _OFF, _NO, _NO),
    Precondition.POSITION: _row(_HOLD, _HOLD, _BREAK, _BREAK, _NO, _HOLD, _HOLD),
    Precondition.TARGET: _row(_NO, _NO, _NO, _BREAK, _NO, _NO, _NO),  # committed: it lands straight down
    Precondition.OVER: _row(_NO, _NO, Reaction.RETURN, _BREAK, _CALL, _NO, _NO),
    Precondition.SINKS: _row(_NO, _NO, _NO, _BREAK, _CALL, _NO, _NO),
    Precondition.NO_UNASKED_SINK: _row(_CALL, _CALL, _BREAK, _NO, _NO, _CALL, _CALL),
    Precondition.FOLLOWS: _row(_CALL, _BREAK, _BREAK, _NO, _NO, _CALL, _CALL),
    Precondition.WIND: _row(_WAIT, _BREAK, _BREAK, _BREAK, _NO, _NO, _NO),
}

SECOND = 1_000_000_000
# A breach must last this long: longer than one wrong message, a gust, or a change of speed.
PATIENCE_NS = {
    Precondition.CLASS: SECOND // 2,  # after an outage the heartbeat may come before EXTENDED_SYS_STATE
    Precondition.ESTIMATE: SECOND,
    Precondition.NO_FAILSAFE: SECOND,  # in which it may take the mode
    Precondition.GPS: SECOND // 2,
    Precondition.GLITCH: SECOND // 2,
    Precondition.STICKS: SECOND // 4,
    Precondition.OVER: SECOND // 2,
    Precondition.SINKS: 3 * SECOND // 2,
}
CALL_AGAIN_NS = 30 * SECOND
REPORTED = (Reaction.CALL, Reaction.TELL, Reaction.HOLD)  # now and then, while the breach lasts
# Height over the point and vertical speed, up to which the vehicle stands: nobody can move it any more.
STANDS_M, STANDS_MS = 0.15, 0.2
CLIMBING_MS = 0.5  # climb rate that the change to LAND does not reach
MOST_DRIFT_M = 0.8  # in ten seconds; a receiver under a clear sky wanders by a tenth of that


@dataclass(frozen=True, slots=True)
class Breach:
    """A violated precondition, the reaction, and the text for the pilot; is_new: not reported yet."""

    precondition: Precondition
    reaction: Reaction
    what: str = ""
    is_new: bool = True


class Preconditions:
    """Checker of the preconditions of the present stage, step by step."""

    def __init__(
        self,
        parameters: Parameters,
        progress: LandingProgress,
        ownership: ModeOwnership,
        wind: LandingWind,
        gps_loss: GpsLoss,
    ) -> None:
        self._p, self._progress = parameters, progress
        self._ownership, self._wind, self._gps_loss = ownership, wind, gps_loss
        self._since_ns: dict[Precondition, int] = {}
        self._reported_ns: dict[Precondition, int] = {}
        self._sticks = StickWatch()
        self._started_ns = 0  # when the landing under way began
        self._landing_since_ns: int | None = None
        self._stage: Stage | None = None
        self._following = VelocityFollowing()

    def breach(self, s: Situation) -> Breach | None:
        """Return the first violated precondition that needs a reaction, None without one."""
        stage, aim = self._present_stage, self._progress.aim
        too_windy = self._wind.too_windy(s)
        self._follow(stage, s)
        self._following.update(s)
        broken = self._state(stage, s)
        if too_windy:
            broken[Precondition.WIND] = too_windy
        if self._gps_loss.lasts:
            broken[Precondition.PLACE] = ""
        elif s.gps_lost and not self._gps_loss.is_on:
            broken[Precondition.GPS] = ""
        if s.velocity_enu_ms is not None and Precondition.POSITION not in broken:
            limit_m = self._p.off_point_m / 2 if stage is Stage.COMMITTED else self._p.off_point_m
            up_ms = float(s.velocity_enu_ms[2])
            stands = abs(aim.height_left_m) <= STANDS_M and abs(up_ms) <= STANDS_MS
            broken |= self._motion(s, up_ms, aim.away_m > limit_m and not stands, aim.away_m)
        lasting = [
            precondition for precondition in Precondition if self._lasts(precondition, broken, s.now_ns)
        ]
        for precondition in lasting:
            reaction = TABLE[precondition][stage]
            if precondition is Precondition.MODE and (s.failsafe or s.breached):
                reaction = Reaction.STAND_BACK
            if precondition is Precondition.STICKS and self._progress.is_taken_over:
                reaction = Reaction.HANDS_OFF
            is_new = reaction not in REPORTED or self._must_report(precondition, s.now_ns)
            if reaction in (Reaction.CALL, Reaction.TELL) and not is_new:
                continue
            # The descent returns by its own steering, and the survey waits.
            if reaction not in (Reaction.NONE, Reaction.RETURN, Reaction.WAIT):
                return Breach(precondition, reaction, broken[precondition], is_new)
        return None

    @property
    def _present_stage(self) -> Stage:
        progress = self._progress
        committed = progress.aim.height_left_m <= self._p.commit_height_m or self._gps_loss.is_on
        return Stage.COMMITTED if progress.phase is Phase.FINAL and committed else Stage(progress.phase.value)

    def _follow(self, stage: Stage, s: Situation) -> None:
        """Record the beginning of the autopilot's landing, and the stick positions until then."""
        landing = stage in LANDING
        if not landing:
            self._landing_since_ns = None
        elif self._landing_since_ns is None:
            self._landing_since_ns = s.now_ns
        progress = self._progress
        if not landing and not (progress.is_taken_over and progress.started_ns == self._started_ns):
            self._sticks.note_rest(s.sticks_us)
        self._started_ns = progress.started_ns
        if stage is Stage.CLIMB and stage is not self._stage:
            self._following.restart()
        if stage is not self._stage and not (landing and self._stage in LANDING):
            self._since_ns.clear()  # kept at the commit height, which a landing may cross several times
        self._stage = stage

    def _state(self, stage: Stage, s: Situation) -> dict[Precondition, str]:
        """Return the preconditions about the vehicle's state that fail now, with their texts."""
        landing = stage in LANDING
        broken: dict[Precondition, str] = {}
        if s.connected and (not s.armed or (s.on_ground is True and landing)):
            broken[Precondition.ARMED] = ""
        if s.no_command_reason:
            broken[Precondition.CLASS] = s.no_command_reason
        if s.connected and self._ownership.is_taken_away(s):
            broken[Precondition.MODE] = s.mode
        if s.commander:
            broken[Precondition.COMMANDER] = s.commander
        if s.estimate_lost:
            broken[Precondition.ESTIMATE] = f"{s.estimate_lost} lost"
        if s.failsafe and not s.estimate_lost:  # one event: it is about to stand back
            broken[Precondition.NO_FAILSAFE] = s.cause
        if s.gps_glitching and not s.gps_lost:
            broken[Precondition.GLITCH] = ""
        if s.gps_drift_m > MOST_DRIFT_M:
            broken[Precondition.DRIFT] = ""
        if self._sticks.are_moved(s.sticks_us):
            broken[Precondition.STICKS] = ""
        since_ns, lost_ns = self._landing_since_ns, s.target_lost_ns
        if since_ns is not None and lost_ns is not None and lost_ns > since_ns:
            broken[Precondition.TARGET] = "target lost"
        if s.position_enu_m is None or s.velocity_enu_ms is None:
            broken[Precondition.POSITION] = "position lost"
        return broken

    def _motion(self, s: Situation, up_ms: float, is_off: bool, away_m: float) -> dict[Precondition, str]:
        """Return the preconditions about the vehicle's motion that fail now, with their texts."""
        broken: dict[Precondition, str] = {}
        if is_off:
            broken[Precondition.OVER] = f"{away_m:.1f} m off the point"
        if s.landing and up_ms > CLIMBING_MS:
            broken[Precondition.SINKS] = "climbs in landing"
        if self._following.sinks:
            broken[Precondition.NO_UNASKED_SINK] = "sinking"
        if self._following.departs:
            broken[Precondition.FOLLOWS] = "velocity not followed"
        return broken

    def _lasts(self, precondition: Precondition, broken: dict[Precondition, str], now_ns: int) -> bool:
        """Return whether a precondition has failed for its minimum time."""
        if precondition not in broken:
            self._since_ns.pop(precondition, None)
            if TABLE[precondition][Stage.FINAL] is Reaction.TELL:
                self._reported_ns.pop(precondition, None)
            return False
        since_ns = self._since_ns.setdefault(precondition, now_ns)
        return now_ns - since_ns >= PATIENCE_NS.get(precondition, 0)

    def _must_report(self, precondition: Precondition, now_ns: int) -> bool:
        reported_ns = self._reported_ns.get(precondition)
        if reported_ns is not None and now_ns - reported_ns < CALL_AGAIN_NS:
            return False
        self._reported_ns[precondition] = now_ns
        return True
