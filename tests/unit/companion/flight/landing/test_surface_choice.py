"""Landings on roofs and low vegetation: chosen last, and only confirmed; and suspected water."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import params
from companion.flight.landing.orders.confirmation import Confirmation, Ground
from companion.flight.landing.zone_choice import choose, confirmable, look_at, soonest
from slz import PointState, SurfaceHere, SurfaceKind
from slz.surface.surface_kinds import UNKNOWN_SURFACE
from tests.unit.companion.flight.landing.flight import Flight, Phase, Severity, zone

BARE, ROOF = SurfaceHere(SurfaceKind.BARE, 0.9), SurfaceHere(SurfaceKind.ROOF, 0.99, raised_m=25.2)
CROP = SurfaceHere(SurfaceKind.LOW_VEGETATION, 0.9)
LAKE = SurfaceHere(SurfaceKind.WATER, 0.95, water=0.95)
P = params.build({})
HERE = np.zeros(3)
ROOF_ZONE = zone(2, 30, 0, surface=ROOF)
AGAIN = "zone 2: roof, 25 m up: order again to confirm"


def airborne(*zones: object, **settings: object) -> Flight:
    """A flight that waits for an order."""
    return Flight(list(zones), auto=False, **settings).run(3)  # type: ignore[arg-type]


def ordered_twice(flight: Flight, pause_s: float = 2.0) -> Flight:
    assert not flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.run(pause_s)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    return flight


# ---- choice --------------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", [ROOF, CROP])
def test_a_zone_to_be_confirmed_is_not_chosen(surface: SurfaceHere) -> None:
    zones = [zone(1, 10, 0, surface=surface), zone(2, 20, 0, surface=BARE)]
    found = choose(zones, [], P)
    assert found is not None
    assert found.id == 2
    assert choose(zones[:1], [], P) is None
    allowed = choose(zones[:1], [], params.build({"roof": "allow", "vegetation": "allow"}))
    assert allowed is zones[0]


def test_a_zone_to_be_confirmed_is_not_looked_at_either() -> None:
    flight = Flight([]).having(prior_zones=[zone(1, 10, 0, surface=ROOF), zone(2, 20, 0)])
    report = flight.situation().report
    assert report is not None
    found = look_at(report, [], P)
    assert found is not None
    assert found.id == 2


def test_the_soonest_zone_is_one_that_needs_no_confirmation_wherever_that_is_known() -> None:
    flight = Flight([zone(1, 10, 0, surface=ROOF), zone(2, 5, 0, surface=CROP), zone(3, 60, 0)])

    def soonest_id() -> int | None:
        report = flight.situation().report
        assert report is not None
        found = soonest(report, [], P, HERE)
        return None if found is None else found[0].id

    assert soonest_id() == 3
    flight.zones.pop()
    flight.prior_zones = [zone(4, 90, 0)]
    assert soonest_id() == 4
    flight.prior_zones = []
    assert soonest_id() == 2


def test_the_zone_to_ask_for_is_the_best_certain_one_that_needs_it() -> None:
    zones = [zone(1, 0, 0), zone(2, 10, 0, certainty=0.1, surface=ROOF), zone(3, 20, 0, surface=CROP)]
    found = confirmable(zones, P)
    assert found is not None
    assert found.id == 3
    assert confirmable(zones[:2], P) is None


@pytest.mark.parametrize(("surface", "words"), [(ROOF, "a roof, 25 m up"), (CROP, "low vegetation")])
def test_an_emergency_takes_what_is_left_and_says_what_it_is(surface: SurfaceHere, words: str) -> None:
    flight = airborne(zone(2, 30, 0, surface=surface))
    assert flight.executive.orders.land_now(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    text = f"SLZ: landing on {words}"
    assert flight.texts.count(text) == 1
    assert flight.severities[flight.texts.index(text)] is Severity.WARNING
    assert flight.executive.tally.aborts == 0


def test_an_emergency_says_it_once_when_the_surface_shows_on_the_way() -> None:
    flight = airborne(zone(2, 60, 0, surface=BARE))
    flight.executive.orders.land_now(flight.situation())
    flight.fly_to(Phase.APPROACH).run(2)
    flight.having(surface=lambda _point: ROOF).fly_to(Phase.LANDED)
    assert flight.texts.count("SLZ: landing on a roof, 25 m up") == 1


def test_a_low_battery_turns_away_from_the_way_to_bare_ground_for_no_roof() -> None:
    flight = airborne(zone(1, 3, 0, surface=ROOF), battery_land_pct=20.0)
    flight.executive.orders.land_at_point(flight.situation(), np.array([90.0, 0.0, 0.0]))
    flight.fly_to(Phase.APPROACH).run(1)
    flight.having(battery_pct=5.0).run(2)
    assert flight.executive.progress.is_urgent
    aim = flight.executive.aim_enu_m
    assert aim is not None
    assert aim[0] == 90.0


# ---- confirmation --------------------------------------------------------------------------------


def test_an_order_onto_a_roof_is_accepted_when_it_comes_again() -> None:
    flight = airborne(ROOF_ZONE)
    reply = flight.executive.orders.land_in_zone(flight.situation(), 2)
    assert (reply.accepted, reply.reason, reply.asks) == (False, AGAIN, True)
    assert flight.executive.phase is Phase.IDLE
    flight.run(2)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.fly_to(Phase.LANDED)
    assert "SLZ: approaching zone 2: roof, 25 m up" in flight.texts
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("pause_s", [0.0, 0.5, 31.0])
def test_a_repeated_packet_is_no_confirmation_and_neither_is_an_order_much_later(pause_s: float) -> None:
    flight = airborne(ROOF_ZONE)
    assert not flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.run(pause_s)
    assert not flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.run(1.5)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted


def test_another_order_confirms_nothing() -> None:
    flight = airborne(ROOF_ZONE, zone(3, -30, 0, surface=CROP))
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).reason == AGAIN
    flight.run(2)
    reason = flight.executive.orders.land_in_zone(flight.situation(), 3).reason
    assert reason == "zone 3: low vegetation: order again to confirm"
    flight.run(2)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).reason == AGAIN


def test_a_selected_point_is_confirmed_the_same_way() -> None:
    flight = airborne(ROOF_ZONE)
    flight.executive.orders.select_zone(flight.situation(), 2)
    flight.run(1)
    reply = flight.executive.orders.land_at_selected(flight.situation())
    assert reply.reason == "the point: roof, 25 m up: order again to confirm"
    flight.run(2)
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)


@pytest.mark.parametrize("rule", ["roof", "vegetation"])
def test_a_profile_that_allows_it_asks_for_nothing(rule: str) -> None:
    surface = ROOF if rule == "roof" else CROP
    flight = airborne(zone(2, 30, 0, surface=surface), **{rule: "allow"})
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted


def test_a_confirmed_zone_ordered_again_on_the_way_needs_no_second_confirmation() -> None:
    flight = ordered_twice(airborne(ROOF_ZONE)).fly_to(Phase.APPROACH).run(1)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.fly_to(Phase.LANDED)


def test_a_confirmation_ends_with_its_landing() -> None:
    flight = ordered_twice(airborne(ROOF_ZONE)).fly_to(Phase.APPROACH)
    flight.executive.orders.abort(flight.situation())
    flight.run(2)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).reason == AGAIN


def test_a_jump_of_the_estimate_leaves_the_confirmation() -> None:
    flight = ordered_twice(airborne(ROOF_ZONE)).fly_to(Phase.APPROACH).run(1)
    flight.surface = lambda _point: ROOF
    flight.jump(4.0, 0.0, 0.0)
    flight.fly_to(Phase.LANDED)
    assert not any("not confirmed" in text for text in flight.texts)


def test_ground_is_the_same_by_zone_or_by_place_and_by_kind() -> None:
    here = Ground(np.zeros(3), 2, ROOF)
    assert here.is_same(Ground(np.array([40.0, 0.0, 0.0]), 2, replace(ROOF, raised_m=3.0)))
    assert here.is_same(Ground(np.array([0.5, 0.0, 9.0]), None, ROOF))
    assert not here.is_same(Ground(np.array([3.0, 0.0, 0.0]), None, ROOF))
    assert not here.is_same(Ground(np.zeros(3), 2, CROP))


def test_a_confirmation_is_used_up() -> None:
    confirmation, here = Confirmation(), Ground(np.zeros(3), 2, ROOF)
    given = [confirmation.is_given(here, second * 10**9) for second in (0, 2, 4, 6)]
    assert given == [False, True, False, True]


# ---- what shows on the way -----------------------------------------------------------------------


@pytest.mark.parametrize("phase", [Phase.APPROACH, Phase.DESCEND, Phase.FINAL])
@pytest.mark.parametrize(("surface", "words"), [(ROOF, "roof, 25 m up"), (CROP, "low vegetation")])
def test_ground_that_turns_out_to_need_a_confirmation_breaks_off(
    phase: Phase, surface: SurfaceHere, words: str
) -> None:
    flight = Flight([zone(1, 40, 0, surface=BARE)]).fly_to(phase)
    flight.run(1)
    flight.having(surface=lambda _point: surface).run(0.2)
    assert flight.executive.phase is Phase.CLIMB
    assert flight.executive.tally.abort_reasons == [f"{words}: not confirmed"]


def test_a_confirmed_roof_that_is_a_crop_breaks_off() -> None:
    flight = ordered_twice(airborne(ROOF_ZONE)).fly_to(Phase.DESCEND)
    flight.having(surface=lambda _point: CROP).fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["low vegetation: not confirmed"]


def test_a_landing_taken_up_after_a_restart_was_confirmed_before() -> None:
    flight = Flight([], auto=False, height=6.0).having(mode="LAND", surface=lambda _point: ROOF)
    flight.executive.resume_landing(flight.situation(), np.zeros(3))
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_suspected_water_is_named_where_a_landing_breaks_off() -> None:
    flight = Flight([zone(1, 40, 0)]).fly_to(Phase.DESCEND)
    flight.surface, flight.state = lambda _point: LAKE, lambda _height, _point: PointState.UNKNOWN
    flight.fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["point unknown: may be water"]


def test_suspected_water_is_named_in_the_approach() -> None:
    flight = Flight([zone(1, 40, 0)]).fly_to(Phase.APPROACH)
    flight.surface, flight.state = lambda _point: LAKE, lambda _height, _point: PointState.UNSAFE
    flight.fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["point unsafe: may be water"]


# ---- question to the pilot -----------------------------------------------------------------------


def test_without_another_zone_the_pilot_is_asked_each_half_minute_while_the_survey_goes_on() -> None:
    flight = Flight([ROOF_ZONE], survey_s=5).run(20)
    text = "SLZ: zone 2: roof, 25 m up: confirm"
    assert flight.texts.count(text) == 1
    assert flight.severities[flight.texts.index(text)] is Severity.WARNING
    asked_s = next(at for at, _, _, commands in flight.commands if any(text == t for _, t in commands.texts))
    assert asked_s > 5
    flight.run(60)
    assert flight.texts.count(text) == 3
    assert flight.executive.phase is Phase.SURVEY
    flight.zones.append(zone(3, 30, 30))
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.zone_id == 3


def test_nobody_is_asked_where_another_zone_can_be_taken() -> None:
    flight = Flight([ROOF_ZONE, zone(3, 30, 30, surface=UNKNOWN_SURFACE)]).fly_to(Phase.LANDED)
    assert not any("confirm" in text for text in flight.texts)


def test_the_zone_that_was_asked_for_is_landed_in_when_confirmed() -> None:
    flight = Flight([ROOF_ZONE]).until(lambda f: any(text.endswith(": confirm") for text in f.texts))
    ordered_twice(flight).fly_to(Phase.LANDED)
    assert flight.executive.tally.zone_id == 2
