"""Landing executive: a state machine for survey, approach, descent, landing and abort.

Without I/O: `step` maps the present situation to orders. It commands nothing before the operator's hand-over,
and nothing after another party changed the mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from companion.flight.fusion.pose_history import motion_m
from companion.flight.landing.aim import Aim, same_place
from companion.flight.landing.emergencies.outage import Outage
from companion.flight.landing.emergencies.preconditions import (
    Breach,
    Precondition,
    Preconditions,
    Reaction,
    Stage,
)
from companion.flight.landing.guidance import level, towards
from companion.flight.landing.hand_over import HandOver
from companion.flight.landing.mode_ownership import ModeOwnership
from companion.flight.landing.route import Route, Way
from companion.flight.landing.situation import (
    FLYING,
    LandingRequest,
    Orders,
    Phase,
    Reply,
    Severity,
    Situation,
    Tally,
    Vector,
)
from companion.flight.landing.zone_choice import choose, look_at, soonest
from params import Parameters
from slz import PointState, Zone

SECOND = 1_000_000_000
STEADY_NS = 2 * SECOND  # airborne and level before an automatic start; point safe before the descent
TARGET_NS = round(2.5 * SECOND)  # landing target streamed before LAND, for the autopilot's estimator
TAKE_OVER_NS = 5 * SECOND  # limit for the autopilot to obey an emergency
SEARCH_NS = 300 * SECOND  # beyond `survey_s`, before the pilot is called
UNSEEN_NS = 30 * SECOND  # over a point that stays unknown
STUCK_NS = 60 * SECOND  # beyond twice the travel time of a phase
CALL_AGAIN_NS = 30 * SECOND  # with a low battery and no zone
LANDING_MS = 0.5  # lowest sink rate of autopilots at the end of a landing
RECHARGED_PCT = 10.0
OVER_NS = 3 * SECOND  # without a failsafe, until it is over
BLAMED_NS = 2 * SECOND  # PX4's heartbeat, which reports a failsafe, comes each second
RESUMED_NS = 8 * SECOND  # a resumed landing may sink this long before its point must be seen safe

STOPPED = np.zeros(3)


class Executive:
    """Landing executive.

    Parameters
    ----------
    parameters
        Speeds, heights and times of the `landing` section.
    auto
        Land without an order, once the vehicle is armed, airborne and in its guided mode.

    Attributes
    ----------
    phase, tally
        Phase of the landing, and events so far.
    order_count
        Order counter: incremented when an order is accepted, aborted or finished, so that a stale repeat can
        be recognised.
    """

    def __init__(self, parameters: Parameters, auto: bool) -> None:
        self._p = parameters
        self._auto = auto
        self.phase = Phase.IDLE
        self.tally = Tally()
        self.order_count = 0
        self._custody = ModeOwnership()
        self._required = Preconditions()
        self._hand_over_seen = HandOver()
        self._asked_up_ms: float | None = None
        self._taken: tuple[str, int] | None = None  # mode set by another party, and its time
        self._mode_told = ""  # last reported mode of the failsafe
        self._calm_since_ns: int | None = None  # since then without failsafe
        self._resumed_until_ns = 0
        self._disarmed = False  # since the last landing
        self._since_ns = 0
        self._steady_since_ns: int | None = None
        self._wish: LandingRequest | None = None
        self._aim = Aim()
        self._refused: list[Vector] = []
        self._route = Route(parameters)
        self._over_since_ns: int | None = None  # over the point, in this approach
        self._safe_since_ns: int | None = None
        self._outage = Outage()
        self._unordered_told_ns: int | None = None
        self._late_ns = 0
        self._started_ns = 0
        self._battery_said_ns: int | None = None
        self._texts: list[tuple[Severity, str]] = []
        self._pending_select: Vector | None = None
        self._asked: Vector | None = None  # newest selected point
        self._last: Situation | None = None  # newest situation with a position

    # ---- operator -------------------------------------------------------------------------------

    def land_at_best(self, situation: Situation) -> Reply:
        """Accept the order to land at the best zone, or at the one reached soonest if the battery is low."""
        return self._hand_over(situation, LandingRequest(urgent=self._is_low(situation)))

    def land_in_zone(self, situation: Situation, zone_id: int) -> Reply:
        """Accept the order to land in a zone by its ID."""
        zone = _zone(situation, zone_id)
        if zone is None:
            return Reply(False, f"no zone {zone_id}")
        return self._hand_over(situation, LandingRequest(zone.best.enu_m, zone_id))

    def land_at_point(self, situation: Situation, enu_m: Vector) -> Reply:
        """Accept the order to land at a point of the operator's choice, if it proves safe."""
        return self._hand_over(situation, LandingRequest(enu_m))

    def land_at_selected(self, situation: Situation) -> Reply:
        """Accept the order to land at the selected point: the confirmation of a selection."""
        selected = situation.selected
        if self._asked is not None and (selected is None or not same_place(selected.enu_m, self._asked)):
            return Reply(False, "selection not judged yet: confirm again")
        if selected is None:
            return Reply(False, "nothing selected")
        return self.land_at_point(situation, selected.enu_m)

    def land_now(self, situation: Situation) -> Reply:
        """Accept the order to land at the zone reached soonest, from any mode: it is also the hand-over."""
        if self.phase in (Phase.FINAL, Phase.DESCEND):
            return Reply(True, "landing already")
        refusal = _not_flying(situation)
        if refusal is not None:
            return refusal
        if situation.estimate_lost:
            return Reply(False, f"{situation.estimate_lost} lost: fly by hand")
        self._custody.on_leave_request(situation)
        return self._start(situation, LandingRequest(urgent=True))

    def select_point(self, enu_m: Vector) -> Reply:
        """Select a point without flying to it."""
        if self.phase in FLYING - {Phase.HOLD}:
            return Reply(False, "busy landing: abort first")
        self._pending_select = self._asked = enu_m
        self.order_count += 1
        return Reply(True, "watching the point")

    def select_zone(self, situation: Situation, zone_id: int) -> Reply:
        """Select the best point of a zone, to be confirmed."""
        zone = _zone(situation, zone_id)
        return Reply(False, f"no zone {zone_id}") if zone is None else self.select_point(zone.best.enu_m)

    def abort(self, situation: Situation) -> Reply:
        """Break off and hover at survey height."""
        if self.phase not in FLYING:
            return Reply(False, "nothing to abort")
        if self.phase is Phase.FINAL and self._aim.height_left_m < self._p.commit_height_m:
            return Reply(False, "below commit height: landing")
        self._wish = None
        if self.phase is Phase.SURVEY and not situation.guided:  # an emergency that does not command yet
            self._say(Severity.NOTICE, f"emergency cancelled: {situation.mode} stays")
            self._rest(Phase.IDLE, situation)
            return Reply(True, "aborting")
        self._break_off(situation, "operator", hold=True)
        return Reply(True, "aborting")

    def _hand_over(self, s: Situation, wish: LandingRequest) -> Reply:
        refusal = _not_flying(s)
        if refusal is not None:
            return refusal
        if self.phase in (Phase.FINAL, Phase.DESCEND):
            return Reply(False, "descending: abort first")
        if not s.guided:
            return Reply(False, "set GUIDED first")
        if s.estimate_lost:
            return Reply(False, f"{s.estimate_lost} lost: fly by hand")
        return self._start(s, wish)

    def _start(self, s: Situation, wish: LandingRequest) -> Reply:
        self._wish = wish
        self._refused.clear()
        self._started_ns = s.now_ns
        self._start_survey(s)
        self._since_ns = s.now_ns - round(self._p.survey_s * 1e9)  # the present map counts as the survey
        return Reply(True, "landing")

    # ---- every step -----------------------------------------------------------------------------

    def step(self, s: Situation) -> Orders:
        """Return the orders for the present situation (call it at 10 Hz or faster)."""
        self._follow_jumps(s)
        self._aim.measure(s.position_enu_m, s.selected)
        self._hand_over_seen.follow(s)
        orders = self._act(s)
        velocity = orders.velocity_enu_ms
        self._asked_up_ms = None if velocity is None else float(velocity[2])
        if not s.heard:  # the pilot may have chosen another mode meanwhile
            orders = replace(orders, mode=None)
        if orders.mode == "land":
            self._custody.on_land_request(s)
        elif orders.mode == "guided":
            self._custody.on_guided_request()
        texts, self._texts = tuple(self._texts), []
        select, self._pending_select = self._pending_select, None
        self._asked = select if select is not None else self._asked
        return replace(orders, select_enu_m=select, texts=texts)

    @property
    def aim_enu_m(self) -> Vector | None:
        """Target point (3,) at the measured ground height, None while the vehicle flies to none."""
        on_the_way = self.phase in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL)
        return self._aim.on_ground_enu_m if on_the_way and self._aim.enu_m is not None else None

    def change_frame(self, moved: Callable[[Vector], Vector]) -> None:
        """Convert stored positions to another map frame; `moved` maps a point to it."""
        self._last = None
        asked = self._asked if self._pending_select is None else self._pending_select
        if asked is not None:
            self._asked = self._pending_select = moved(asked)
        if self.tally.chosen_enu_m is not None:
            self.tally.chosen_enu_m = moved(self.tally.chosen_enu_m)
        if self._aim.enu_m is not None:
            self._aim.set_target(moved(self._aim.on_ground_enu_m))

    def is_selected(self, situation: Situation, enu_m: Vector) -> bool:
        """Return whether this point is the newest selection and is judged by the newest report."""
        asked, selected = self._pending_select, situation.selected
        asked = self._asked if asked is None else asked
        if selected is None or not same_place(selected.enu_m, enu_m):
            return False
        return asked is None or same_place(asked, enu_m)

    @property
    def mapping(self) -> bool:
        """Whether scans are mapped: not close to the point, where rotors blow up dust."""
        low = self._aim.height_left_m < self._p.dust_height_m
        if self.phase is Phase.LANDED:  # the next flight may go below the point
            return not (low and self._aim.away_m < self._p.footprint_m + self._p.dust_height_m)
        return not (low and self.phase is Phase.FINAL)

    def _act(self, s: Situation) -> Orders:
        self._heed_battery(s)
        if (blamed := self._blame_failsafe(s)) is not None:
            return blamed
        if self.phase in FLYING:
            breach = self._required.breach(
                self._stage,
                s,
                self._aim,
                self._custody,
                asked_up_ms=self._asked_up_ms,
                off_point_m=self._p.off_point_m,
            )
            reacted = None if breach is None else self._react(breach, s)
            if reacted is not None:
                return reacted
            if s.position_enu_m is None or s.velocity_enu_ms is None:
                return self._without_pose(s)
            if self.phase not in (Phase.FINAL, Phase.CLIMB, Phase.HOLD) and self._custody.lands_for_us(s):
                return self._leave_landing(s)
        match self.phase:
            case Phase.IDLE | Phase.LANDED:
                return self._wait(s)
            case Phase.SURVEY:
                return self._survey(s)
            case Phase.APPROACH:
                return self._approach(s)
            case Phase.DESCEND:
                return self._descend(s)
            case Phase.FINAL:
                return self._final(s)
            case Phase.CLIMB | Phase.HOLD:
                return self._climb(s)
            case Phase.FAILSAFE:
                return self._in_failsafe(s)

    @property
    def _stage(self) -> Stage:
        low = self._aim.height_left_m <= self._p.commit_height_m
        return Stage.COMMITTED if self.phase is Phase.FINAL and low else Stage(self.phase.value)

    def _react(self, breach: Breach, s: Situation) -> Orders | None:
        """Execute the reaction to a breach; None where the phase goes on."""
        match breach.reaction:
            case Reaction.ENDS:
                return self._finish(s)
            case Reaction.HANDS_OFF:
                return self._hands_off(breach, s)
            case Reaction.STAND_BACK:
                return self._stand_back(breach, s)
            case Reaction.BREAK_OFF if breach.precondition is not Precondition.POSITION:
                return self._break_off(s, breach.what)
            case Reaction.CALL:
                self._say(Severity.CRITICAL, f"{breach.what}: take over")
            case Reaction.TELL if breach.precondition is Precondition.GPS:
                self._say(Severity.CRITICAL, "GPS lost: the estimate drifts, be ready")
            case Reaction.TELL:
                cause = f" ({breach.what})" if breach.what else ""
                self._say(Severity.CRITICAL, f"autopilot failsafe{cause}: going on")
        return None

    def _hands_off(self, breach: Breach, s: Situation) -> Orders:
        if breach.precondition is Precondition.STICKS:
            text = f"pilot moves the sticks in {s.mode}: hands off"
        else:
            text = f"pilot set {s.mode}: hands off" if s.switched else f"{s.mode} set, not by SLZ: hands off"
        self._say(Severity.WARNING, text)
        self.tally.hands_off += 1
        self._rest(Phase.IDLE, s)
        self._taken = (s.mode, s.now_ns) if breach.precondition is Precondition.MODE else None
        return Orders()

    def _blame_failsafe(self, s: Situation) -> Orders | None:
        """Stand back if a failsafe reported only now explains a mode taken away a moment ago."""
        if self._taken is None or self.phase is not Phase.IDLE:
            return None
        mode, taken_ns = self._taken
        if s.mode != mode or s.now_ns - taken_ns > BLAMED_NS:
            self._taken = None
        elif s.failsafe or s.breached or s.estimate_lost:
            self.tally.hands_off -= 1
            return self._stand_back(Breach(Precondition.MODE, Reaction.STAND_BACK, mode), s)
        return None

    # ---- the autopilot's failsafe ---------------------------------------------------------------

    def _stand_back(self, breach: Breach, s: Situation) -> Orders:
        """Stop commanding: the autopilot flies by its own failsafe, or without an estimate."""
        self._taken = None
        cause = breach.what if breach.precondition is Precondition.ESTIMATE else s.cause
        self._say(Severity.CRITICAL, f"failsafe{f' ({cause})' if cause else ''}: {s.mode} flies, take over")
        self.tally.failsafes.append(cause or "failsafe")
        self._hand_over_seen.withdraw()
        self._mode_told, self._calm_since_ns = s.mode, None
        self._rest(Phase.FAILSAFE, s)
        return Orders()

    def _in_failsafe(self, s: Situation) -> Orders:
        """Wait for the end of the failsafe and report its mode; a new hand-over is needed afterwards."""
        if s.connected and (not s.armed or s.on_ground is True):
            self._say(Severity.WARNING, "on the ground by the autopilot's failsafe")
            self._rest(Phase.IDLE, s)
            return Orders()
        if s.mode != self._mode_told:
            self._mode_told = s.mode
            self._say(Severity.CRITICAL, f"failsafe: {s.mode} flies, take over")
        if s.failsafe or s.breached or s.estimate_lost or not s.connected:
            self._calm_since_ns = None
        elif self._calm_since_ns is None:
            self._calm_since_ns = s.now_ns
        elif s.now_ns - self._calm_since_ns > OVER_NS:
            self._say(Severity.WARNING, f"failsafe over, {s.mode} flies: hand over again")
            self._unordered_told_ns = s.now_ns
            self._rest(Phase.IDLE, s)
        return Orders()

    # ---- restart in flight ----------------------------------------------------------------------

    def resume_landing(self, s: Situation, enu_m: Vector) -> None:
        """Resume watching the autopilot's landing at a point, which a previous companion began."""
        self._aim.set_target(enu_m)
        self._aim.measure(s.position_enu_m, s.selected)
        self.tally.chosen_enu_m = self._pending_select = self._aim.enu_m
        self._route.start_search(_known(s.position_enu_m), s.height_above_home_m, -np.inf)
        self._custody.adopt_landing(s)
        self._say(Severity.WARNING, f"restarted in {s.mode}: watching the landing again")
        self._go(Phase.FINAL, s)
        self._resumed_until_ns = s.now_ns + RESUMED_NS

    def report_restart(self, s: Situation, how: str) -> None:
        """Report the start in flight (`how`), and its consequence."""
        if s.landing:
            self._say(Severity.CRITICAL, f"{how} in {s.mode}: landing not watched, take over")
        elif self._auto and s.guided and self._hand_over_seen.given:
            self._say(Severity.WARNING, f"{how} in flight: going on")
        else:
            self._say(Severity.WARNING, f"{how} in flight, {s.mode}: hand over again")

    def _finish(self, s: Situation) -> Orders:
        if self.phase is not Phase.FINAL:
            self._say(Severity.NOTICE, "disarmed")
            self._rest(Phase.IDLE, s)
            return Orders()
        off_m = self._aim.away_m
        self.tally.off_point_m = off_m if np.isfinite(off_m) else None
        if off_m > self._p.off_point_m:
            self._say(Severity.WARNING, f"landed {off_m:.1f} m off the point")
        else:
            self._say(Severity.NOTICE, f"landed, {off_m:.2f} m off the point")
        self._rest(Phase.LANDED, s)
        self._disarmed = False
        return self._wait(s)

    def _rest(self, phase: Phase, s: Situation) -> None:
        self._wish = None
        self._custody.clear()
        self._outage.reset()
        self._go(phase, s)

    # ---- phases ---------------------------------------------------------------------------------

    def _wait(self, s: Situation) -> Orders:
        """In auto mode start when the vehicle has been airborne, guided and level for two seconds.

        After a landing the target is streamed until the vehicle is armed again: ArduPilot reports the end of
        the stream as "PrecLand: Target Lost" at CRITICAL, disarmed or not, which a pilot takes for a fault.
        """
        if self.phase is Phase.LANDED and self._rests(s):
            return Orders(target_enu_m=self._aim.on_ground_enu_m)
        steady = (
            self._auto
            and s.fit
            and self._hand_over_seen.given
            and not s.estimate_lost
            and s.connected
            and s.armed
            and s.guided
            and s.on_ground is False
            and s.position_enu_m is not None
            and s.velocity_enu_ms is not None
            and abs(float(s.velocity_enu_ms[2])) < 0.3
            and s.height_above_home_m > min(5.0, self._p.survey_height_m)
        )
        self._tell_unordered(s)
        if not steady:
            self._steady_since_ns = None
        elif self._steady_since_ns is None:
            self._steady_since_ns = s.now_ns
        elif s.now_ns - self._steady_since_ns > STEADY_NS:
            self._refused.clear()
            self._wish = LandingRequest(urgent=self._is_low(s))
            self._start_survey(s)
        return Orders()

    def _tell_unordered(self, s: Situation) -> None:
        """Report now and then that the guided mode has no effect without a new hand-over."""
        alone = self._auto and s.connected and s.armed and s.guided and s.on_ground is False
        if not alone or self._hand_over_seen.given:
            self._unordered_told_ns = None
        elif self._unordered_told_ns is None or s.now_ns - self._unordered_told_ns > CALL_AGAIN_NS:
            self._unordered_told_ns = s.now_ns
            self._say(Severity.WARNING, f"{s.mode} without a hand-over: hand over again")

    def _rests(self, s: Situation) -> bool:
        """Return whether the vehicle has stood where it landed since then, and was not armed again."""
        self._disarmed = self._disarmed or (s.connected and not s.armed)
        return s.on_ground is True and not (s.armed and self._disarmed)

    def _start_survey(self, s: Situation) -> None:
        if s.position_enu_m is None:
            self._say(Severity.WARNING, "no position: waiting")
            self._route.forget()
        else:
            # After an abort close to the ground, an order does not end the climb.
            least_m = self._route.height_m if self.phase in FLYING else -np.inf
            self._route.start_search(s.position_enu_m, s.height_above_home_m, least_m)
        self._say(Severity.INFO, "surveying")
        self._outage.reset()
        self._go(Phase.SURVEY, s)

    def _survey(self, s: Situation) -> Orders:
        position = _known(s.position_enu_m)
        if not s.guided:
            return self._take_over(s)
        if not self._route.begun:
            self._start_survey(s)
            return Orders(velocity_enu_ms=STOPPED)
        if not s.lidar_ok:
            return self._without_lidar(s)
        self._outage.on_present(s.now_ns)
        if self._wish is not None and self._wish.enu_m is not None:
            return self._approach_point(s, self._wish.enu_m, self._wish.zone_id)
        zone = self._choice(s)
        if zone is not None:
            return self._approach_point(s, zone.best.enu_m, zone.id)
        if s.now_ns - self._since_ns > round(self._p.survey_s * 1e9) + SEARCH_NS:
            self._say(Severity.CRITICAL, "no zone found: take over")
            self._go(Phase.HOLD, s)
            return Orders(velocity_enu_ms=STOPPED)
        offset = self._route.to_corner(position, self._way(s))
        return self._route.orders_towards(position, offset, self._p.survey_speed_ms)

    def _choice(self, s: Situation) -> Zone | None:
        """Return the zone to fly to once the survey has lasted: a near one, else one to be looked at.

        The latter is a zone of the far map, or of the survey prior.
        """
        urgent = self._wish is not None and self._wish.urgent
        if s.report is None or (not urgent and s.now_ns - self._since_ns < self._p.survey_s * 1e9):
            return None
        if urgent:
            return soonest(s.report, self._refused, self._p, _known(s.position_enu_m))
        return (
            choose(s.report.zones, self._refused, self._p)
            or choose(s.report.far.zones, self._refused, self._p)
            or look_at(s.report, self._refused)
        )

    def _take_over(self, s: Situation) -> Orders:
        """Request the guided mode after an emergency order; give up if the autopilot refuses."""
        if s.now_ns - self._started_ns > TAKE_OVER_NS:
            self._say(Severity.CRITICAL, f"{s.mode} stays: not landing")
            self._rest(Phase.IDLE, s)
            return Orders()
        return Orders(mode="guided", velocity_enu_ms=STOPPED)

    def _approach_point(self, s: Situation, enu_m: Vector, zone_id: int | None) -> Orders:
        self._aim.set_target(enu_m)
        self._aim.measure(s.position_enu_m, s.selected)
        self.tally.zone_id, self.tally.chosen_enu_m = zone_id, self._aim.enu_m
        self._pending_select = self._aim.enu_m
        self._over_since_ns = self._safe_since_ns = None
        where = f"zone {zone_id}" if zone_id is not None else "the point"
        self._say(Severity.INFO, f"approaching {where}")
        self._go(Phase.APPROACH, s)
        return Orders(velocity_enu_ms=STOPPED)

    def _approach(self, s: Situation) -> Orders:
        """Fly over the point, and stay there until it has been safe for two seconds."""
        position, velocity = _known(s.position_enu_m), _known(s.velocity_enu_ms)
        if not s.lidar_ok:
            return self._without_lidar(s)
        self._outage.on_present(s.now_ns)
        judged = self._aim.judgement(s.selected)
        offset = _known(self._aim.enu_m)[:2] - position[:2]
        over = self._aim.away_m < 1.0 and float(np.hypot(*velocity[:2])) < 0.5
        if over and self._over_since_ns is None:
            self._over_since_ns = s.now_ns
        if judged is PointState.UNSAFE:
            return self._break_off(s, "point unsafe")
        if not (over and judged is PointState.SAFE):
            self._safe_since_ns = None
        elif self._safe_since_ns is None:
            self._safe_since_ns = s.now_ns
        elif s.now_ns - self._safe_since_ns > STEADY_NS:
            self._say(Severity.INFO, "descending")
            self._go(Phase.DESCEND, s)
        unseen = self._over_since_ns is not None and s.now_ns - self._over_since_ns > UNSEEN_NS
        if over and judged is PointState.UNKNOWN and unseen:
            return self._break_off(s, "point not seen")
        if self._way(s) is Way.TOO_HIGH:
            return self._break_off(s, "way blocked")
        if s.now_ns > self._late_ns:
            return self._break_off(s, "point not reached")
        return self._route.orders_towards(position, offset, self._p.approach_speed_ms)

    def _descend(self, s: Situation) -> Orders:
        """Sink over the selected point, streaming the landing target, until LAND can take over."""
        reason = self._why_not(s) or ("point not reached" if s.now_ns > self._late_ns else None)
        if reason:
            return self._break_off(s, reason)
        left_m, away_m, target = self._aim.height_left_m, self._aim.away_m, self._aim.on_ground_enu_m
        steady = s.now_ns - self._since_ns > TARGET_NS
        if left_m <= self._p.final_height_m and steady and away_m < 0.7:
            self._say(Severity.INFO, "final: LAND")
            self._go(Phase.FINAL, s)
            return Orders(mode="land", target_enu_m=target)
        floor = self._p.final_height_m - 1.0 - left_m
        sink = level(min(0.0, floor), self._p.descent_speed_ms) if away_m < 1.5 else 0.0
        horizontal = towards(target[:2] - _known(s.position_enu_m)[:2], self._p.approach_speed_ms)
        return Orders(velocity_enu_ms=np.array([*horizontal, sink]), target_enu_m=target)

    def _final(self, s: Situation) -> Orders:
        """Watch the autopilot land; break off if the point turns unsafe while it can be seen."""
        late = s.now_ns > self._late_ns
        if not self._committed:
            unseen = (
                s.now_ns < self._resumed_until_ns and self._aim.judgement(s.selected) is PointState.UNKNOWN
            )
            reason = None if unseen else self._why_not(s)
            reason = reason or ("does not land" if late else None)
            if reason:
                return self._break_off(s, reason)
        elif late:
            self._call("not landing", s)
        slow = s.guided and s.now_ns - self._since_ns > SECOND
        if slow:  # refused, or lost on the way: stop the vehicle's last setpoint
            return Orders(mode="land", velocity_enu_ms=STOPPED, target_enu_m=self._aim.on_ground_enu_m)
        return Orders(target_enu_m=self._aim.on_ground_enu_m)

    @property
    def _committed(self) -> bool:
        """Whether the last verified state of the point holds, because only dust would be seen this low."""
        return self._aim.height_left_m <= max(self._p.commit_height_m, self._p.dust_height_m)

    def _climb(self, s: Situation) -> Orders:
        """After an abort: guided mode, climb to survey height, then survey or wait for the operator."""
        position = _known(s.position_enu_m)
        up = np.array([0.0, 0.0, self._p.climb_speed_ms])
        left_m = self._route.height_m - float(position[2])
        if s.lidar_ok or left_m > 1.0:  # climbing needs no map
            self._tell_return(s)
        if left_m <= 1.0:
            self._late_ns = self._limit_ns(s)
        elif s.now_ns > self._late_ns:
            self._call("not climbing", s)
        if not s.guided:
            return Orders(mode="guided", velocity_enu_ms=up)
        if left_m > 1.0:
            return Orders(velocity_enu_ms=up)
        if not s.lidar_ok:
            return self._without_lidar(s)
        if self.phase is Phase.HOLD:
            return Orders(velocity_enu_ms=STOPPED)
        if s.now_ns - self._since_ns < STEADY_NS:
            return Orders(velocity_enu_ms=STOPPED)
        self._say(Severity.INFO, "choosing again")
        if self._wish is not None:
            self._wish = LandingRequest(urgent=self._wish.urgent or self._is_low(s))
        self._go(Phase.SURVEY, s)
        self._since_ns = s.now_ns - round(self._p.survey_s * 1e9)
        return Orders(velocity_enu_ms=STOPPED)

    # ---- faults ---------------------------------------------------------------------------------

    def _without_lidar(self, s: Situation) -> Orders:
        """Stop; call the pilot after ten seconds."""
        self._waits_for(s.blind, s)
        return Orders(velocity_enu_ms=STOPPED)

    def _without_pose(self, s: Situation) -> Orders:
        """Hold by the autopilot's own estimate; break off a landing that cannot be watched any more."""
        if self.phase is Phase.FINAL and self._committed:
            return Orders()
        if self.phase is Phase.SURVEY and not s.guided:
            return self._take_over(s)
        if self.phase in (Phase.DESCEND, Phase.FINAL):
            self._break_off(s, "position lost")
        self._waits_for("position lost", s)
        return Orders(mode=None if s.guided else "guided", velocity_enu_ms=STOPPED)

    def _leave_landing(self, s: Situation) -> Orders:
        """Leave a landing mode entered after it was given up: nobody chose this ground."""
        self._say(Severity.WARNING, "LAND came late: climbing")
        self._go(Phase.CLIMB, s)
        return Orders(mode="guided", velocity_enu_ms=STOPPED)

    def _follow_jumps(self, s: Situation) -> None:
        """Shift stored positions by a jump of the position estimate: the vehicle did not move."""
        last = self._last
        if s.position_enu_m is None:
            return
        self._last = s
        if last is None or last.epoch == s.epoch:
            return
        if self.phase in FLYING:
            self._move(last, s)
        if self.phase in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL):
            self._pending_select = self.tally.chosen_enu_m = self._aim.enu_m
        elif self._asked is not None or self._pending_select is not None:  # lost with the map
            self._asked = self._pending_select = None
            if self.phase in (Phase.IDLE, Phase.LANDED, Phase.HOLD):
                self._say(Severity.WARNING, "selection lost: select again")

    def _move(self, last: Situation, s: Situation) -> None:
        """Shift by the jump if it exceeds possible motion: the vehicle may have braked in a gap."""
        speed_ms = (_or_zero(last.velocity_enu_ms) + _or_zero(s.velocity_enu_ms)) / 2
        elapsed_s = (s.now_ns - last.now_ns) * 1e-9
        jump_m = _known(s.position_enu_m) - _known(last.position_enu_m) - speed_ms * elapsed_s
        self._say(Severity.WARNING, "position jumped")
        if np.linalg.norm(jump_m) <= motion_m(elapsed_s, self._p.pose_timeout_s):
            return
        self._route.move(jump_m)
        self._refused = [point + jump_m for point in self._refused]
        self._aim.move(jump_m)

    def _call(self, trouble: str, s: Situation) -> None:
        """Call the pilot, again each minute, about a vehicle that does not obey; keep commanding it."""
        self._say(Severity.CRITICAL, f"{trouble}: take over")
        self._late_ns = s.now_ns + STUCK_NS

    def _waits_for(self, what: str, s: Situation) -> None:
        self._safe_since_ns = None
        if self._outage.on_missing(what, s.now_ns):
            self._say(Severity.WARNING, f"{what}: holding")
        thing, _, state = what.partition(" ")
        if self._outage.calls_for(thing, s.now_ns):
            self._say(Severity.CRITICAL, f"{thing} still {state}: take over")
            if self.phase is not Phase.HOLD:
                self._go(Phase.HOLD, s)

    def _tell_return(self, s: Situation) -> None:
        """Report once that the input of a call is back: the vehicle hovers until the next order."""
        if thing := self._outage.on_present(s.now_ns):
            self._say(Severity.WARNING, f"{thing} back: hovering, order again")

    def _heed_battery(self, s: Situation) -> None:
        """With a low battery, land at the zone reached soonest, and call the pilot while there is none.

        Before a hand-over only warn.
        """
        if s.battery_pct is not None and s.battery_pct > self._p.battery_land_pct + RECHARGED_PCT:
            self._battery_said_ns = None
        said_ns = self._battery_said_ns
        if not self._is_low(s):
            return
        if said_ns is not None and (s.now_ns - said_ns <= CALL_AGAIN_NS or not self._lacks_zone(s)):
            return
        on_its_way = self._wish is not None and self.phase in (Phase.SURVEY, Phase.APPROACH, Phase.CLIMB)
        if self._lacks_zone(s):
            self._say(Severity.CRITICAL, "battery low, no zone: take over")
        elif on_its_way:
            self._say(Severity.CRITICAL, "battery low: landing at the nearest zone")
        elif self.phase in (Phase.IDLE, Phase.LANDED, Phase.HOLD) and s.armed and s.on_ground is not True:
            self._say(Severity.CRITICAL, "battery low: land")
        else:  # the autopilot's landing, a failsafe, or on the ground: no warning yet
            return
        self._battery_said_ns = s.now_ns
        if said_ns is None and on_its_way:
            self._wish = LandingRequest(urgent=True)
            if self.phase is Phase.APPROACH and self._is_nearer_elsewhere(s):
                self._go(Phase.SURVEY, s)

    def _is_low(self, s: Situation) -> bool:
        return s.battery_pct is not None and 0 < self._p.battery_land_pct >= s.battery_pct

    def _soonest(self, s: Situation) -> Zone | None:
        if s.report is None or s.position_enu_m is None:
            return None
        return soonest(s.report, self._refused, self._p, s.position_enu_m)

    def _lacks_zone(self, s: Situation) -> bool:
        """Return whether a landing is ordered, no point is flown to, and no zone is known."""
        looks = self.phase in (Phase.SURVEY, Phase.CLIMB, Phase.HOLD) and self._wish is not None
        return looks and self._soonest(s) is None

    def _is_nearer_elsewhere(self, s: Situation) -> bool:
        zone = self._soonest(s)
        if zone is None or s.position_enu_m is None:
            return False
        return bool(np.hypot(*(zone.best.enu_m - s.position_enu_m)[:2]) < self._aim.away_m)

    # ---- parts ----------------------------------------------------------------------------------

    def _way(self, s: Situation) -> Way:
        way = self._route.way(s)
        if way is Way.CLIMBING:
            self._say(Severity.INFO, "obstacle ahead: climbing")
        return way

    def _why_not(self, s: Situation) -> str | None:
        """Return the reason against going on with the descent, or None."""
        if not s.lidar_ok:
            return s.blind
        judged = self._aim.judgement(s.selected)
        return None if judged is PointState.SAFE else f"point {judged.value}"

    def _break_off(self, s: Situation, reason: str, hold: bool = False) -> Orders:
        """Leave the point: stop, or climb at once where the autopilot is landing."""
        self.tally.aborts += 1
        self.tally.abort_reasons.append(reason)
        self._say(Severity.WARNING, f"abort: {reason}")
        if self._aim.enu_m is not None and not hold:
            self._refused.append(self._aim.enu_m)
        landing = self.phase is Phase.FINAL
        self._go(Phase.HOLD if hold else Phase.CLIMB, s)
        if landing:
            return Orders(mode="guided", velocity_enu_ms=np.array([0.0, 0.0, self._p.climb_speed_ms]))
        return Orders(velocity_enu_ms=STOPPED)

    def _go(self, phase: Phase, s: Situation) -> None:
        self.phase = phase
        self.order_count += phase not in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL)
        self._since_ns = s.now_ns
        self._late_ns = self._limit_ns(s)
        self._steady_since_ns = None
        self._route.unblocked()

    def _limit_ns(self, s: Situation) -> int:
        """Return the time limit of the phase, begun now: a minute and twice its travel time from now."""
        way_s = 0.0
        match self.phase:
            case Phase.APPROACH:
                way_s = self._aim.away_m / self._p.approach_speed_ms
            case Phase.DESCEND:
                way_s = self._aim.height_left_m / self._p.descent_speed_ms
            case Phase.FINAL:
                way_s = self._aim.height_left_m / LANDING_MS
            case Phase.CLIMB | Phase.HOLD if s.position_enu_m is not None:
                way_s = max(0.0, self._route.height_m - float(s.position_enu_m[2])) / self._p.climb_speed_ms
        return s.now_ns + STUCK_NS + round(2e9 * way_s)

    def _say(self, severity: Severity, text: str) -> None:
        self._texts.append((severity, f"SLZ: {text}"))


def _zone(s: Situation, zone_id: int) -> Zone | None:
    """Return a zone by its ID, of the active map or of the survey prior."""
    if s.report is None:
        return None
    prior = () if s.report.prior is None else s.report.prior.zones
    return next((zone for zone in (*s.report.zones, *prior) if zone.id == zone_id), None)


def _not_flying(s: Situation) -> Reply | None:
    """Return the refusal of an order to land, None if the vehicle can obey."""
    if not s.connected:
        return Reply(False, "no autopilot")
    if not s.armed or s.on_ground is True:
        return Reply(False, "not flying")
    return None


def _or_zero(vector: Vector | None) -> Vector:
    return np.zeros(3) if vector is None else vector


def _known(vector: Vector | None) -> Vector:
    if vector is None:
        raise RuntimeError("position unknown")
    return vector
