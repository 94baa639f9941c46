"""Acceptance of the operator's orders: refused with a reason, or begun."""

from __future__ import annotations

from dataclasses import replace

from companion.flight.landing.aim import PointSelection
from companion.flight.landing.fenced_zones import beyond_fence
from companion.flight.landing.orders.confirmation import Confirmation, Ground, ground_at, must_be_confirmed
from companion.flight.landing.orders.mode_ownership import ModeOwnership
from companion.flight.landing.outage import GpsLoss
from companion.flight.landing.situation import (
    COMMANDING,
    LandingRequest,
    Phase,
    Reply,
    Severity,
    Situation,
    Vector,
)
from companion.flight.landing.transitions import LandingCore
from companion.flight.landing.ways.endurance import is_battery_low
from companion.flight.landing.wind.landing_wind import LandingWind
from slz import Zone


class OrderAcceptance:
    """Orders to land, select or abort; each method returns the answer to the operator."""

    def __init__(
        self,
        core: LandingCore,
        selection: PointSelection,
        ownership: ModeOwnership,
        wind: LandingWind,
        gps_loss: GpsLoss,
    ) -> None:
        self._p, self._progress, self._texts, self._transitions = core
        self._selection, self._ownership = selection, ownership
        self._wind, self._gps_loss = wind, gps_loss
        self._confirmation = Confirmation()
        self._confirmed: Ground | None = None  # of the newest request with a confirmation

    def land_at_best(self, situation: Situation) -> Reply:
        """Accept the order to land at the best zone, or at the one reached soonest if the battery is low."""
        return self._hand_over(situation, LandingRequest(urgent=is_battery_low(situation, self._p)))

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
        if not self._selection.is_judged_by(selected):
            return Reply(False, "selection not judged yet: confirm again")
        if selected is None:
            return Reply(False, "nothing selected")
        return self.land_at_point(situation, selected.enu_m)

    def land_now(self, situation: Situation) -> Reply:
        """Accept the order to land at the zone reached soonest, from any mode: it is also the hand-over."""
        if self._progress.phase in (Phase.FINAL, Phase.DESCEND):
            return Reply(True, "landing already")
        refusal = _not_flying(situation)
        if refusal is not None:
            return refusal
        lost = self.what_is_lost(situation)
        if lost:
            return Reply(False, f"{lost} lost: fly by hand")
        self._ownership.on_leave_request(situation)
        return self._start(situation, LandingRequest(urgent=True))

    def take_over_landing(self, situation: Situation, enu_m: Vector) -> Reply:
        """Lead a landing of the autopilot's to a place, from any mode, without an operator's order."""
        refusal = _not_flying(situation)
        if refusal is not None:
            return refusal
        self._ownership.on_leave_request(situation)
        return self._start(situation, LandingRequest(enu_m, urgent=True), taken_over=True)

    def select_point(self, enu_m: Vector) -> Reply:
        """Select a point without flying to it."""
        if self._progress.phase in COMMANDING - {Phase.HOLD}:
            return Reply(False, "busy landing: abort first")
        if self._progress.leads_own_landing:
            return Reply(False, "the autopilot lands: set another mode first")
        self._selection.select(enu_m)
        self._progress.order_count += 1
        return Reply(True, "watching the point")

    def select_zone(self, situation: Situation, zone_id: int) -> Reply:
        """Select the best point of a zone, to be confirmed."""
        zone = _zone(situation, zone_id)
        return Reply(False, f"no zone {zone_id}") if zone is None else self.select_point(zone.best.enu_m)

    def abort(self, situation: Situation) -> Reply:
        """Break off and hover at survey height."""
        if self._progress.phase not in COMMANDING:
            return Reply(False, "nothing to abort")
        if self._progress.phase is Phase.FINAL and self._progress.aim.height_left_m < self._p.commit_height_m:
            return Reply(False, "below commit height: landing")
        self._transitions.cancel_request()
        if (
            self._progress.phase is Phase.SURVEY and not situation.guided
        ):  # an emergency that does not command yet
            self._texts.say(Severity.NOTICE, f"emergency cancelled: {situation.mode} stays")
            self._transitions.end_request(Phase.IDLE, situation)
            return Reply(True, "aborting")
        self._transitions.break_off("operator", situation, hold=True)
        return Reply(True, "aborting")

    def _hand_over(self, s: Situation, request: LandingRequest, ground: Ground | None = None) -> Reply:
        refusal = _not_flying(s)
        if refusal is not None:
            return refusal
        if self._progress.phase in (Phase.FINAL, Phase.DESCEND):
            return Reply(False, "descending: abort first")
        if not s.guided:
            return Reply(False, "set GUIDED first")
        lost = self.what_is_lost(s)
        if lost:
            return Reply(False, f"{lost} lost: fly by hand")
        too_windy = self._wind.too_windy(s, request.urgent)
        if too_windy:
            return Reply(False, too_windy)
        outside = "" if request.enu_m is None else beyond_fence(s, self._p, request.enu_m, request.zone_id)
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
        request, confirmed = self._progress.request, self._confirmed
        under_way = request is not None and request.confirmed is not None
        if under_way and confirmed is not None and confirmed.is_same(ground):
            return True
        return self._confirmation.is_given(ground, s.now_ns)

    def _start(self, s: Situation, request: LandingRequest, *, taken_over: bool = False) -> Reply:
        self._transitions.begin_request(request, s, taken_over=taken_over)
        self._transitions.end_survey(s)
        return Reply(True, "landing")

    def what_is_lost(self, s: Situation) -> str:
        """Return the input that is lost without which no order to land is taken, else ""."""
        return s.estimate_lost or ("GPS" if self._gps_loss.is_on else "")


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
    if s.no_command_reason:
        return Reply(False, f"{s.no_command_reason}: not commanded")
    if not s.armed or s.on_ground is True:
        return Reply(False, "not flying")
    return None
