"""Landing executive: a state machine for survey, approach, descent, landing and abort.

Without I/O: `step` maps the present situation to commands for the vehicle. It commands nothing before the
operator's hand-over, and nothing after another party changed the mode. Each phase has a file in `phases`,
each cause that ends or interrupts one a file in `interruptions`; `landing_state.py` holds what they share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from companion.flight.landing.aim import same_place
from companion.flight.landing.confirmation import Confirmation, Ground, ground_at
from companion.flight.landing.guidance import BRAKING_MS2
from companion.flight.landing.interruptions.late_abort import LateAbort
from companion.flight.landing.interruptions.low_battery import LowBattery
from companion.flight.landing.interruptions.missing_input import without_pose
from companion.flight.landing.interruptions.position_jump import PositionJump
from companion.flight.landing.interruptions.preconditions import (
    Breach,
    Precondition,
    Preconditions,
    Reaction,
    Stage,
)
from companion.flight.landing.interruptions.vehicle_class_announcer import VehicleClassAnnouncer
from companion.flight.landing.interruptions.withdrawal import MOST_CAUSE, Withdrawal
from companion.flight.landing.landing_state import LandingState, bracketed
from companion.flight.landing.outlook import Outlook, outlook
from companion.flight.landing.phases.approach import Approach
from companion.flight.landing.phases.climb import Climb
from companion.flight.landing.phases.descent import Descent
from companion.flight.landing.phases.survey import Survey
from companion.flight.landing.phases.waiting import Waiting
from companion.flight.landing.situation import (
    COMMANDING,
    STOPPED,
    Emergency,
    LandingRequest,
    Phase,
    Reply,
    Severity,
    Situation,
    Tally,
    Vector,
    VehicleCommands,
)
from companion.flight.landing.ways.approach_path import ApproachPath
from companion.flight.landing.ways.way_choice import paths
from companion.flight.landing.zone_choice import must_be_confirmed
from params import Parameters
from slz import SAFE, SelectedPoint, Zone

ENDING = (Reaction.ENDS, Reaction.HANDS_OFF, Reaction.STAND_BACK)


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
    state
        What the phases share.
    """

    def __init__(self, parameters: Parameters, auto: bool) -> None:
        self._p = parameters
        self.state = state = LandingState(parameters, auto)
        self._preconditions = Preconditions()
        self._withdrawal, self._battery = Withdrawal(state), LowBattery(state)
        self._jump, self._class_announcer = PositionJump(state), VehicleClassAnnouncer(state)
        self._late_abort = LateAbort(state)
        self._is_refused = False
        self._confirmation = Confirmation()
        self._ways_of: SelectedPoint | None = None
        self._ways: tuple[ApproachPath | None, ApproachPath | None] = None, None
        self._confirmed: Ground | None = None  # of the newest request with a confirmation
        self._waiting, self._approach = Waiting(state), Approach(state)
        self._survey, self._descent, self._climb = Survey(state, self._approach), Descent(state), Climb(state)
        self._commands_in: dict[Phase, Callable[[Situation], VehicleCommands]] = {
            Phase.IDLE: self._waiting.commands,
            Phase.LANDED: self._waiting.commands,
            Phase.SURVEY: self._survey.commands,
            Phase.APPROACH: self._approach.commands,
            Phase.DESCEND: self._descent.commands,
            Phase.FINAL: self._descent.final_commands,
            Phase.CLIMB: self._climb.commands,
            Phase.HOLD: self._climb.commands,
            Phase.FAILSAFE: self._withdrawal.commands,
        }

    @property
    def phase(self) -> Phase:
        """Present phase."""
        return self.state.phase

    @property
    def tally(self) -> Tally:
        """Events so far."""
        return self.state.tally

    @property
    def order_count(self) -> int:
        """Order counter: incremented when an order is accepted, aborted or finished.

        It shows that a repeated order is stale.
        """
        return self.state.order_count

    @property
    def aim_enu_m(self) -> Vector | None:
        """Target point (3,) at the measured ground height, None while the vehicle flies to none."""
        aim, on_the_way = self.state.aim, self.phase in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL)
        return aim.on_ground_enu_m if on_the_way and aim.enu_m is not None else None

    @property
    def mapping(self) -> bool:
        """Whether scans are mapped: not close to the point, where rotors blow up dust."""
        aim = self.state.aim
        low = aim.height_left_m < self._p.dust_height_m
        if self.phase is Phase.LANDED:  # the next flight may go below the point
            return not (low and aim.away_m < self._p.footprint_m + self._p.dust_height_m)
        return not (low and self.phase is Phase.FINAL)

    def is_selected(self, situation: Situation, enu_m: Vector) -> bool:
        """Return whether this point is the newest selection and is judged by the newest report."""
        selected = situation.selected
        if selected is None or not same_place(selected.enu_m, enu_m):
            return False
        newest = self.state.selection.enu_m
        return newest is None or same_place(newest, enu_m)

    def outlook(self, situation: Situation) -> Outlook:
        """Return what the vehicle does now and next, and what an abort would do."""
        return outlook(self.state, situation)

    def emergency(self, situation: Situation) -> Emergency | None:
        """Return where an emergency order would land now, None without a zone."""
        state = self.state
        found = state.soonest_zone_and_s(situation)
        if found is None:
            return None
        zone, seconds = found
        endurance_s = state.endurance.left_s(situation.now_ns)
        return Emergency(zone.id, seconds, None if endurance_s is None else seconds <= endurance_s)

    def what_is_lost(self, s: Situation) -> str:
        """Return the input that is lost without which no order to land is taken, else ""."""
        return s.estimate_lost or ("GPS" if self.state.gps_loss.is_on else "")

    def ways(self, situation: Situation) -> tuple[ApproachPath | None, ApproachPath | None]:
        """Return the best sloped clear way in to the selected point, and out of it, of the newest report."""
        selected, p = situation.selected, self._p
        if selected is None or selected.corridors is None:
            return None, None
        if selected is self._ways_of:
            return self._ways
        up_m = self.state.route.height_m - float(selected.enu_m[2])
        wind = situation.wind if p.into_wind == "on" else None
        high_m = max(up_m, p.survey_height_m)
        inward, outward = (
            paths(
                selected.corridors,
                p,
                least_state=int(SAFE),
                route_over_point_m=high_m,
                wind=wind,
                outbound=outbound,
                fence=situation.fence,
            )
            for outbound in (False, True)
        )
        self._ways_of = selected
        self._ways = next(iter(inward), None), next(iter(outward), None)
        return self._ways

    def zones_beyond_fence(self, situation: Situation) -> list[int]:
        """Return the IDs of the zones whose best point is beyond the autopilot's fence."""
        return sorted(self.state.zones_beyond_fence(situation))

    # ---- operator -------------------------------------------------------------------------------

    def land_at_best(self, situation: Situation) -> Reply:
        """Accept the order to land at the best zone, or at the one reached soonest if the battery is low."""
        return self._hand_over(situation, LandingRequest(urgent=self.state.is_battery_low(situation)))

    def land_in_zone(self, situation: Situation, zone_id: int) -> Reply:
        """Accept the order to land in a zone by its ID."""
        zone = _zone(situation, zone_id)
        if zone is None:
            return Reply(False, f"no zone {zone_id}")
        ground = Ground(zone.best.enu_m, zone_id, zone.best.surface)
        return self._hand_over(situation, LandingRequest(zone.best.enu_m, zone_id), ground)

    def land_at_point(self, situation: Situation, enu_m: Vector) -> Reply:
        """Accept the order to land at a point of the operator's choice, if it proves safe."""
        return self._hand_over(situation, LandingRequest(enu_m), ground_at(situation, enu_m))

    def land_at_selected(self, situation: Situation) -> Reply:
        """Accept the order to land at the selected point: the confirmation of a selection."""
        selected = situation.selected
        if not self.state.selection.is_judged_by(selected):
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
        lost = self.what_is_lost(situation)
        if lost:
            return Reply(False, f"{lost} lost: fly by hand")
        self.state.ownership.on_leave_request(situation)
        return self._start(situation, LandingRequest(urgent=True))

    def select_point(self, enu_m: Vector) -> Reply:
        """Select a point without flying to it."""
        if self.phase in COMMANDING - {Phase.HOLD}:
            return Reply(False, "busy landing: abort first")
        self.state.selection.select(enu_m)
        self.state.order_count += 1
        return Reply(True, "watching the point")

    def select_zone(self, situation: Situation, zone_id: int) -> Reply:
        """Select the best point of a zone, to be confirmed."""
        zone = _zone(situation, zone_id)
        return Reply(False, f"no zone {zone_id}") if zone is None else self.select_point(zone.best.enu_m)

    def abort(self, situation: Situation) -> Reply:
        """Break off and hover at survey height."""
        if self.phase not in COMMANDING:
            return Reply(False, "nothing to abort")
        if self.phase is Phase.FINAL and self.state.aim.height_left_m < self._p.commit_height_m:
            return Reply(False, "below commit height: landing")
        self.state.request = None
        if self.phase is Phase.SURVEY and not situation.guided:  # an emergency that does not command yet
            self.state.say(Severity.NOTICE, f"emergency cancelled: {situation.mode} stays")
            self.state.rest(Phase.IDLE, situation)
            return Reply(True, "aborting")
        self.state.break_off("operator", situation, hold=True)
        return Reply(True, "aborting")

    def _hand_over(self, s: Situation, request: LandingRequest, ground: Ground | None = None) -> Reply:
        refusal = _not_flying(s)
        if refusal is not None:
            return refusal
        if self.phase in (Phase.FINAL, Phase.DESCEND):
            return Reply(False, "descending: abort first")
        if not s.guided:
            return Reply(False, "set GUIDED first")
        lost = self.what_is_lost(s)
        if lost:
            return Reply(False, f"{lost} lost: fly by hand")
        too_windy = self.state.too_windy(s, request.urgent)
        if too_windy:
            return Reply(False, too_windy)
        outside = "" if request.enu_m is None else self.state.beyond_fence(s, request.enu_m, request.zone_id)
        if outside:
            return Reply(False, f"{outside} beyond the fence")
        if ground is not None and must_be_confirmed(ground.surface, self._p):
            if not self._is_confirmed(ground, s):
                return Reply(False, f"{ground.text}: order again to confirm", asks=True)
            self._confirmed = ground
            request = replace(request, confirmed=ground.surface.kind)
        return self._start(s, request)

    def _is_confirmed(self, ground: Ground, s: Situation) -> bool:
        """Return whether this order is the confirmation, or repeats one that the landing under way has."""
        request, confirmed = self.state.request, self._confirmed
        under_way = request is not None and request.confirmed is not None
        if under_way and confirmed is not None and confirmed.is_same(ground):
            return True
        return self._confirmation.is_given(ground, s.now_ns)

    def _start(self, s: Situation, request: LandingRequest) -> Reply:
        self.state.start(request, s)
        self.state.end_survey(s)
        return Reply(True, "landing")

    # ---- restart in flight ----------------------------------------------------------------------

    def resume_landing(self, situation: Situation, enu_m: Vector) -> None:
        """Resume watching the autopilot's landing at a point, which a previous companion began."""
        self.state.say(Severity.WARNING, f"restarted in {situation.mode}: watching the landing again")
        self._descent.resume(situation, enu_m)

    def report_restart(self, situation: Situation, how: str) -> None:
        """Report the start in flight (`how`), and its consequence."""
        s, say = situation, self.state.say
        if s.landing:
            say(Severity.CRITICAL, f"{how} in {s.mode}: landing not watched, take over")
        elif self.state.auto and s.guided and self.state.hand_over.given:
            say(Severity.WARNING, f"{how} in flight: going on")
        else:
            self.state.call_for_hand_over(how, s)

    def change_frame(self, moved: Callable[[Vector], Vector]) -> None:
        """Convert stored positions to another map frame; `moved` maps a point to it."""
        state = self.state
        self._jump.forget()
        if state.selection.enu_m is not None:
            state.selection.select(moved(state.selection.enu_m))
        if state.tally.chosen_enu_m is not None:
            state.tally.chosen_enu_m = moved(state.tally.chosen_enu_m)
        if state.tally.landed_enu_m is not None:
            state.tally.landed_enu_m = moved(state.tally.landed_enu_m)
        if state.aim.enu_m is not None:
            state.aim.set_target(moved(state.aim.on_ground_enu_m))

    # ---- every step -----------------------------------------------------------------------------

    def on_refusal(self) -> None:
        """Begin nothing any more after the pilot was called for a refused mode."""
        self._is_refused = True

    def step(self, s: Situation) -> VehicleCommands:
        """Return the commands for the present situation (call it at 10 Hz or faster)."""
        state = self.state
        self._jump.follow(s)
        state.aim.measure(s.position_enu_m, s.selected)
        state.follow_wind(s)
        state.route.highest_m = s.fence.highest_m
        state.gps_loss.follow(s)
        state.endurance.follow(s.now_ns, s.battery_pct)
        state.hand_over.follow(s)
        self._battery.update(s)
        self._class_announcer.update(s)
        commands = self._withdrawal.reclassify_as_failsafe(s) or self._reaction(s)
        if commands is None:
            commands = self._commands_in[self.phase](s)
        commands = _inside_fence(commands, s)
        if not s.heard:  # the pilot may have chosen another mode meanwhile
            commands = replace(commands, mode=None)
        if commands.mode == "land":
            state.ownership.on_land_request(s)
        elif commands.mode == "guided":
            state.ownership.on_guided_request()
        return replace(
            commands,
            select_enu_m=state.selection.collect(),
            texts=state.collect_texts(),
            lasting=state.collect_lasting(),
        )

    def _reaction(self, s: Situation) -> VehicleCommands | None:
        """Return the commands that an interruption demands; None where the phase goes on."""
        state = self.state
        if self.phase not in COMMANDING:
            return None
        breach = self._preconditions.breach(
            self._stage,
            s,
            state.aim,
            state.ownership,
            off_point_m=self._p.off_point_m,
            too_windy=state.too_windy(s),
            gps_loss=state.gps_loss,
        )
        ends = breach is not None and breach.reaction in ENDING
        if self._late_abort.is_void(s) and not ends:
            return self._descent.watch_again(s)
        if self._is_refused and s.guided and self.phase is Phase.FINAL:
            state.go(Phase.HOLD, s)
        self._is_refused = False
        reacted = None if breach is None else self._react(breach, s)
        if reacted is not None:
            return reacted
        if s.position_enu_m is None or s.velocity_enu_ms is None:
            taking_over = self.phase is Phase.SURVEY and not s.guided
            return self._survey.take_over(s) if taking_over else without_pose(state, s)
        leaves = self.phase is Phase.DESCEND and self._descent.waits
        landing = self.phase in (Phase.FINAL, Phase.CLIMB, Phase.HOLD) or leaves
        if not landing and state.ownership.lands_for_us(s):
            return self._climb.leave_landing(s)
        return None

    @property
    def _stage(self) -> Stage:
        committed = self.state.aim.height_left_m <= self._p.commit_height_m or self.state.gps_loss.is_on
        return Stage.COMMITTED if self.phase is Phase.FINAL and committed else Stage(self.phase.value)

    def _react(self, breach: Breach, s: Situation) -> VehicleCommands | None:
        """Execute the reaction to a breach; None where the phase goes on."""
        match breach.reaction:
            case Reaction.ENDS:
                return self._waiting.finish(s)
            case Reaction.HANDS_OFF:
                return self._withdrawal.hands_off(breach, s)
            case Reaction.STAND_BACK:
                return self._withdrawal.stand_back(breach, s)
            case Reaction.BREAK_OFF if breach.precondition is not Precondition.POSITION:
                by_wind = breach.precondition is Precondition.WIND
                return self.state.break_off(breach.what, s, keeps_point=by_wind)
            case Reaction.CALL:
                self.state.call(breach.what, s)
            case Reaction.HOLD if breach.precondition is Precondition.PLACE:
                return self._without_gps(breach, s)
            case Reaction.TELL if breach.precondition is Precondition.PLACE:
                self._report_gps_loss("landing at once")
            case Reaction.TELL if breach.precondition is Precondition.GPS:
                self.state.say(Severity.CRITICAL, f"GPS lost: going on by the {s.place_by}")
            case Reaction.TELL if breach.precondition is Precondition.GLITCH:
                self.state.say(Severity.CRITICAL, "GPS glitch: position may jump, be ready")
            case Reaction.TELL if breach.precondition is Precondition.DRIFT:
                text = f"GPS drifts off the {s.place_by}, {s.gps_drift_m:.1f} m in 10 s"
                self.state.say(Severity.CRITICAL, text)
            case Reaction.TELL:
                cause = bracketed(breach.what, MOST_CAUSE)
                self.state.say(Severity.CRITICAL, f"failsafe{cause}: going on")
        return None

    def _report_gps_loss(self, reaction: str) -> None:
        self.state.say(Severity.CRITICAL, f"GPS lost: {reaction}, be ready")

    def _without_gps(self, breach: Breach, s: Situation) -> VehicleCommands:
        """Land at once at a safe point that the vehicle is over, otherwise hover where it is."""
        state = self.state
        down = self._approach.descend_at_once(s) if self.phase is Phase.APPROACH else None
        if breach.is_new:
            self._report_gps_loss("hovering" if down is None else "landing at once")
        if down is not None:
            return down
        state.safe_since_ns = None
        state.restart_limit(s)
        if self.phase is Phase.SURVEY and not s.guided:
            return self._survey.take_over(s)
        return VehicleCommands(mode=None if s.guided else "guided", velocity_enu_ms=STOPPED)


def _zone(s: Situation, zone_id: int) -> Zone | None:
    """Return a zone by its ID, of the active map or of the survey prior."""
    if s.report is None:
        return None
    prior = () if s.report.prior is None else s.report.prior.zones
    return next((zone for zone in (*s.report.zones, *prior) if zone.id == zone_id), None)


def _inside_fence(commands: VehicleCommands, s: Situation) -> VehicleCommands:
    """Return the commands with a velocity that stops before the autopilot's fence."""
    if commands.velocity_enu_ms is None or s.position_enu_m is None:
        return commands
    inside_ms = s.fence.limited(s.position_enu_m, commands.velocity_enu_ms, BRAKING_MS2)
    return replace(commands, velocity_enu_ms=inside_ms)


def _not_flying(s: Situation) -> Reply | None:
    """Return the refusal of an order to land, None if the vehicle can obey."""
    if not s.connected:
        return Reply(False, "no autopilot")
    if s.no_command_reason:
        return Reply(False, f"{s.no_command_reason}: not commanded")
    if not s.armed or s.on_ground is True:
        return Reply(False, "not flying")
    return None
