"""Landing executive: a state machine for survey, approach, descent, landing and abort.

Without I/O: `step` maps the present situation to commands for the vehicle. It commands nothing before the
operator's hand-over, and nothing after another party changed the mode. Each phase has a file in `phases`,
with its checks in their order at the head; each event that ends or interrupts one has a file in
`interruptions`. `landing_progress.py` is the data that they share, `transitions.py` changes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from companion.flight.landing.aim import PointSelection, same_place
from companion.flight.landing.assist.assist import Assist
from companion.flight.landing.check_order import Check, decided
from companion.flight.landing.fenced_zones import FencedZones
from companion.flight.landing.guidance import BRAKING_MS2
from companion.flight.landing.interruptions.gps_loss import WithoutGps
from companion.flight.landing.interruptions.late_abort import LateAbort
from companion.flight.landing.interruptions.low_battery import LowBattery
from companion.flight.landing.interruptions.missing_input import MissingInputs
from companion.flight.landing.interruptions.position_jump import PositionJump
from companion.flight.landing.interruptions.preconditions import Preconditions
from companion.flight.landing.interruptions.reactions import Reactions
from companion.flight.landing.interruptions.withdrawal import VehicleClassAnnouncer, Withdrawal
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.orders.mode_ownership import HandOver, ModeOwnership
from companion.flight.landing.orders.order_acceptance import OrderAcceptance
from companion.flight.landing.outage import GpsLoss, Outage
from companion.flight.landing.outlook import Outlook, outlook
from companion.flight.landing.phases.approach import Approach
from companion.flight.landing.phases.climb import Climb
from companion.flight.landing.phases.descent import Descent
from companion.flight.landing.phases.survey import Survey
from companion.flight.landing.phases.waiting import Waiting
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.route import Route
from companion.flight.landing.situation import (
    COMMANDING,
    Emergency,
    Phase,
    Situation,
    Tally,
    Vector,
    VehicleCommands,
)
from companion.flight.landing.transitions import LandingCore, Transitions
from companion.flight.landing.ways.approach_path import ApproachPath
from companion.flight.landing.ways.endurance import Endurance
from companion.flight.landing.ways.way_choice import WaysOfPoint
from companion.flight.landing.wind.landing_wind import LandingWind
from companion.flight.landing.zone_choice import SoonestZone
from params import Parameters


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
    progress
        Data that the phases share.
    orders
        Acceptance of the operator's orders.
    checks
        Checks of each phase, in their order.
    reactions
        Reactions to interruptions, which are checked before the phase.
    assist
        Target of the landings that the autopilot makes by itself.
    """

    def __init__(self, parameters: Parameters, auto: bool) -> None:
        self.parameters = p = parameters
        self.progress, self._texts = progress, texts = LandingProgress(), PilotTexts()
        self._route, self._selection = route, selection = Route(p), PointSelection()
        self._ownership, self._gps_loss = ownership, gps_loss = ModeOwnership(), GpsLoss(p)
        hand_over, outage, endurance = HandOver(), Outage(), Endurance()
        wind = LandingWind(p, progress, texts, gps_loss)
        self._fenced = fenced = FencedZones(p)
        self._soonest = soonest = SoonestZone(p, progress, fenced, endurance)
        self._ways = WaysOfPoint(p, route)
        self.assist = Assist(p, progress, texts, selection, soonest)
        transitions = Transitions(p, progress, texts, route, selection, ownership, outage, wind, gps_loss)
        core = LandingCore(p, progress, texts, transitions)
        missing_inputs = MissingInputs(core, outage, gps_loss)
        without_gps = WithoutGps(core)
        approach = Approach(core, route, wind, missing_inputs)
        survey = Survey(core, route, wind, missing_inputs, fenced, soonest, approach)
        self._descent = Descent(core, wind, gps_loss, without_gps)
        climb = Climb(core, route, missing_inputs)
        self._waiting = Waiting(core, auto, hand_over, wind, gps_loss)
        withdrawal = Withdrawal(auto, progress, texts, transitions, hand_over)
        self.checks: dict[Phase, tuple[Check, ...]] = {
            Phase.IDLE: self._waiting.checks,
            Phase.LANDED: self._waiting.checks,
            Phase.SURVEY: survey.checks,
            Phase.APPROACH: approach.checks,
            Phase.DESCEND: self._descent.checks,
            Phase.FINAL: self._descent.final_checks,
            Phase.CLIMB: climb.checks,
            Phase.HOLD: climb.checks,
            Phase.FAILSAFE: withdrawal.checks,
        }
        self.reactions = Reactions(
            progress,
            texts,
            transitions,
            Preconditions(p, progress, ownership, wind, gps_loss),
            withdrawal,
            LateAbort(core, ownership, self._descent),
            without_gps,
            missing_inputs,
            self._waiting,
        )
        self._jump = PositionJump(p, progress, texts, route, selection, self.assist)
        self._followers: tuple[Callable[[Situation], None], ...] = (
            self._jump.follow,
            progress.aim.follow,
            wind.follow,
            route.follow,
            gps_loss.follow,
            endurance.follow,
            hand_over.follow,
            LowBattery(core, soonest).update,
            VehicleClassAnnouncer(progress, texts).update,
        )
        self.orders = OrderAcceptance(core, selection, ownership, wind, gps_loss)

    @property
    def phase(self) -> Phase:
        """Present phase."""
        return self.progress.phase

    @property
    def tally(self) -> Tally:
        """Events so far."""
        return self.progress.tally

    @property
    def order_count(self) -> int:
        """Order counter: incremented when an order is accepted, aborted or finished.

        It shows that a repeated order is stale.
        """
        return self.progress.order_count

    @property
    def aim_enu_m(self) -> Vector | None:
        """Target point (3,) at the measured ground height, None while the vehicle flies to none."""
        aim, on_the_way = self.progress.aim, self.phase in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL)
        return aim.on_ground_enu_m if on_the_way and aim.enu_m is not None else None

    @property
    def mapping(self) -> bool:
        """True if scans are mapped: not close to the point, where rotors blow up dust."""
        aim = self.assist.aim if self.assist.leads else self.progress.aim
        low = aim.height_left_m < self.parameters.dust_height_m
        if self.assist.leads:
            return not low
        if self.phase is Phase.LANDED:  # the next flight may go below the point
            return not (low and aim.away_m < self.parameters.footprint_m + self.parameters.dust_height_m)
        return not (low and self.phase is Phase.FINAL)

    def is_selected(self, situation: Situation, enu_m: Vector) -> bool:
        """Return whether this point is the newest selection and is judged by the newest report."""
        selected = situation.selected
        if selected is None or not same_place(selected.enu_m, enu_m):
            return False
        newest = self._selection.enu_m
        return newest is None or same_place(newest, enu_m)

    def outlook(self, situation: Situation) -> Outlook:
        """Return the present and next action of the vehicle, and the effect of an abort."""
        return outlook(situation, self.progress, self._route, self._gps_loss, self.parameters)

    def emergency(self, situation: Situation) -> Emergency | None:
        """Return where an emergency order would land now, None without a zone."""
        return self._soonest.emergency(situation)

    def what_is_lost(self, situation: Situation) -> str:
        """Return the input that is lost without which no order to land is taken, else ""."""
        return self.orders.what_is_lost(situation)

    def ways(self, situation: Situation) -> tuple[ApproachPath | None, ApproachPath | None]:
        """Return the best sloped clear way in to the selected point, and out of it, of the newest report."""
        return self._ways.in_and_out(situation)

    def zones_beyond_fence(self, situation: Situation) -> list[int]:
        """Return the IDs of the zones whose best point is beyond the autopilot's fence."""
        return sorted(self._fenced.beyond(situation))

    def resume_landing(self, situation: Situation, enu_m: Vector) -> None:
        """Resume watching the autopilot's landing at a point, which a previous companion began."""
        self._descent.resume_after_restart(situation, enu_m)

    def report_restart(self, situation: Situation, how: str) -> None:
        """Report the start in flight (`how`), and its consequence."""
        self._waiting.report_restart(situation, how)

    def change_frame(self, moved: Callable[[Vector], Vector]) -> None:
        """Convert stored positions to another map frame; `moved` maps a point to it."""
        selection, tally, aim = self._selection, self.progress.tally, self.progress.aim
        self._jump.forget()
        if selection.enu_m is not None:
            selection.select(moved(selection.enu_m))
        if tally.chosen_enu_m is not None:
            tally.chosen_enu_m = moved(tally.chosen_enu_m)
        if tally.landed_enu_m is not None:
            tally.landed_enu_m = moved(tally.landed_enu_m)
        if aim.enu_m is not None:
            aim.set_target(moved(aim.on_ground_enu_m))
        self.assist.change_frame(moved)

    def on_refusal(self) -> None:
        """Begin nothing any more after the pilot was called for a refused mode."""
        self.reactions.on_refusal()

    def step(self, s: Situation) -> VehicleCommands:
        """Return the commands for the present situation (call it at 10 Hz or faster)."""
        for follow in self._followers:
            follow(s)
        commands = self.reactions.commands(s)
        if commands is None:
            commands = decided(self.checks[self.phase], s)
        commands = self._assisted(_inside_fence(commands, s), s)
        if not s.heard:  # the pilot may have chosen another mode meanwhile
            commands = replace(commands, mode=None)
        if commands.mode == "land":
            self._ownership.on_land_request(s)
        elif commands.mode == "guided":
            self._ownership.on_guided_request()
        return replace(
            commands,
            select_enu_m=self._selection.collect(),
            texts=self._texts.collect_texts(),
            lasting=self._texts.collect_lasting(),
        )

    def _assisted(self, commands: VehicleCommands, s: Situation) -> VehicleCommands:
        """Return the commands with a target for landings of the autopilot's own; take some of them over."""
        target = self.assist.target(s, commanding=self.phase in COMMANDING)
        place = self.assist.place_to_take_over(s)
        if place is not None and self.orders.take_over_landing(s, place).accepted:
            self.assist.has_acted = True
        return commands if commands.target_enu_m is not None else replace(commands, target_enu_m=target)


def _inside_fence(commands: VehicleCommands, s: Situation) -> VehicleCommands:
    """Return the commands with a velocity that stops before the autopilot's fence."""
    if commands.velocity_enu_ms is None or s.position_enu_m is None:
        return commands
    inside_ms = s.fence.limited(s.position_enu_m, commands.velocity_enu_ms, BRAKING_MS2)
    return replace(commands, velocity_enu_ms=inside_ms)
