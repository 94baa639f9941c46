"""Reactions of the executive to failures, as stated in docs/reactions.md."""

import numpy as np
import pytest

from companion.flight.landing.situation import MissingInput, Phase, VehicleCommands
from slz import PointState
from tests.unit.companion.flight.landing.flight import Flight, replace, zone


def is_commanding(commands: VehicleCommands) -> bool:
    return (
        commands.velocity_enu_ms is not None or commands.mode is not None or commands.target_enu_m is not None
    )


# ---- a vehicle that does not obey ------------------------------------------------------------------


def test_a_landing_that_does_not_sink_is_broken_off() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.sinks = False
    flight.until(lambda f: f.executive.phase is Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["does not land"]
    assert flight.mode == "GUIDED"


def test_a_landing_that_hangs_below_commit_height_calls_the_pilot() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.0)
    flight.sinks = False
    flight.run(150)
    assert flight.executive.phase is Phase.FINAL
    assert 1 <= sum("not landing: take over" in text for text in flight.texts) <= 3


def test_a_vehicle_that_does_not_climb_calls_the_pilot_and_is_asked_on() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.state = lambda _height, _point: PointState.UNSAFE
    flight.sinks = flight.obeys = False
    flight.run(150)
    assert flight.executive.phase is Phase.HOLD  # who called the pilot begins nothing afterwards
    assert 1 <= sum("not climbing: take over" in text for text in flight.texts) <= 3
    assert flight.commands[-1][3].mode == "guided"


def test_a_vehicle_pressed_down_while_it_holds_is_given_its_time_to_climb() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    flight.lidar_ok = False
    flight.fly_to(Phase.HOLD).run(100)

    def pressed_down(seconds: int) -> bool:
        for _ in range(10 * seconds):
            flight.step()
            flight.position[2] = 25.0
        return any("not climbing: take over" in text for text in flight.texts)

    assert not pressed_down(55)
    assert pressed_down(20)


# ---- position ------------------------------------------------------------------------------------


def test_a_position_lost_in_final_breaks_off_and_holds() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 8)
    flight.blind = True
    flight.run(1)
    assert flight.mode == "GUIDED"
    assert np.allclose(flight.velocity, 0)
    assert flight.executive.tally.abort_reasons == ["position lost"]
    flight.run(15)
    assert flight.executive.phase is Phase.HOLD
    assert any("position still lost: take over" in text for text in flight.texts)


def test_a_position_lost_below_commit_height_lets_the_autopilot_land() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.2)
    flight.blind = True
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("lost", [MissingInput.LIDAR_LOST, MissingInput.POSITION_LOST])
def test_what_the_pilot_was_called_for_is_told_when_it_is_back_and_nothing_begins(lost: MissingInput) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    flight.lost = lost
    flight.lidar_ok, flight.blind = False, lost is MissingInput.POSITION_LOST
    flight.fly_to(Phase.HOLD).run(40)
    flight.lidar_ok, flight.blind = True, False
    flight.run(60)
    assert flight.executive.phase is Phase.HOLD
    assert flight.texts.count(f"SLZ: {lost.thing} back: hovering, order again") == 1


@pytest.mark.parametrize(
    "gaps",
    [
        [(MissingInput.SCANS_LATE, 3.0, 0.0), (MissingInput.MAP_LATE, 3.0, 0.0)] * 3,
        [(MissingInput.LIDAR_LOST, 6.0, 0.2)] * 3,
    ],
    ids=["what is missing changes", "it comes back for an instant"],
)
def test_an_outage_lasts_until_everything_is_back_for_a_second(
    gaps: list[tuple[MissingInput, float, float]],
) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    for what, seconds, back_s in gaps:
        flight.lidar_ok, flight.lost = False, what
        flight.run(seconds)
        flight.lidar_ok = True
        flight.run(back_s)
    assert sum("take over" in text for text in flight.texts) == 1
    assert "holding" not in "".join(flight.texts[flight.texts.index(_call(flight)) :])
    assert flight.executive.phase is Phase.HOLD


def test_a_map_late_after_a_lost_link_has_its_own_time_to_come() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    flight.lidar_ok = False
    link, late = MissingInput.LINK_LOST, MissingInput.MAP_LATE
    for flight.lost, seconds in ((link, 8.0), (late, 6.0), (link, 1.0), (late, 2.0)):
        flight.run(seconds)
    assert not any("take over" in text for text in flight.texts)
    flight.run(2)
    assert "SLZ: map still late: take over" in flight.texts


def _call(flight: Flight) -> str:
    return next(text for text in flight.texts if "take over" in text)


@pytest.mark.parametrize("lost", [MissingInput.LIDAR_LOST, MissingInput.POSITION_LOST])
def test_what_is_lost_while_it_hovers_is_told_too(lost: MissingInput) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    flight.executive.orders.abort(flight.situation())
    flight.run(5)
    flight.lost, flight.lidar_ok, flight.blind = lost, False, lost is MissingInput.POSITION_LOST
    flight.run(11)
    assert flight.texts[-2:] == [f"SLZ: {lost.text}: holding", f"SLZ: {lost.thing} still lost: take over"]
    assert flight.executive.phase is Phase.HOLD


def test_a_position_found_again_is_used_again() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.DESCEND)
    flight.blind = True
    flight.run(4)
    flight.blind = False
    flight.zones.append(zone(2, -20, 0))
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] < -19


def test_a_position_lost_twice_for_a_moment_is_not_lost_for_long() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], climb_speed_ms=1.0).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 5)
    for seconds in (11, 1):
        flight.blind = True
        flight.run(0.2)
        flight.blind = False
        flight.run(seconds)
    assert flight.executive.phase is Phase.CLIMB
    assert not any("take over" in text for text in flight.texts)
    flight.fly_to(Phase.LANDED)


def test_after_a_lost_lidar_the_point_must_be_safe_for_two_seconds_again() -> None:
    flight = Flight([zone(1, 10, 0)])
    flight.state = lambda _h, _point: PointState.UNKNOWN
    flight.fly_to(Phase.APPROACH).run(12)
    flight.state = lambda _h, _point: PointState.SAFE
    flight.run(1)
    flight.lidar_ok = False
    flight.run(5)
    flight.lidar_ok = True
    flight.run(1)
    assert flight.executive.phase is Phase.APPROACH
    flight.run(2)
    assert flight.executive.phase is Phase.DESCEND


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH])
def test_a_jump_of_the_estimated_height_does_not_move_the_vehicle(phase: Phase) -> None:
    flight = Flight([zone(1, 80, 0)]).fly_to(phase).run(1)
    flight.jump(0, 0, 12.0)
    flight.run(10)
    assert flight.position[2] == pytest.approx(30, abs=0.5)


def test_a_jump_in_the_approach_does_not_move_the_place_it_flies_to() -> None:
    flight = Flight([zone(1, 40, 0)]).fly_to(Phase.APPROACH).run(1)
    flight.jump(9.0, -4.0, 1.0)
    flight.fly_to(Phase.LANDED)
    assert flight.position[:2] == pytest.approx([40, 0], abs=0.5)
    assert flight.executive.tally.aborts == 0


def test_a_jump_below_commit_height_does_not_move_the_target_away_from_the_vehicle() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.2)
    flight.jump(5.0, 0, 3.0)
    commands = flight.step()
    assert commands.target_enu_m is not None
    assert commands.target_enu_m - flight.estimate_is_off_m == pytest.approx([10, 0, 0], abs=0.2)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_a_reboot_without_a_jump_leaves_the_place_it_flies_to() -> None:
    """It braked while nothing was heard: that it is not where its speed would have led is no jump."""
    flight = Flight([zone(1, 80, 0)]).fly_to(Phase.APPROACH).run(4)
    flight.blind = True
    flight.run(2)
    flight.jump(0, 0, 0)
    flight.blind = False
    flight.fly_to(Phase.LANDED)
    assert flight.position[:2] == pytest.approx([80, 0], abs=0.2)


def test_a_jump_found_after_a_gap_moves_the_place_it_flies_to() -> None:
    flight = Flight([zone(1, 80, 0)]).fly_to(Phase.APPROACH).run(4)
    flight.blind = True
    flight.run(1)
    flight.jump(0, 9, 0)
    flight.blind = False
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(80, abs=4)
    assert flight.position[1] == pytest.approx(0, abs=0.2)


@pytest.mark.parametrize("aborted", [False, True])
def test_a_selection_lost_with_the_map_is_said_to_be_lost_and_another_can_be_made(aborted: bool) -> None:
    flight = Flight([zone(1, 20, 0), zone(2, -10, 0)], auto=aborted)
    if aborted:
        flight.fly_to(Phase.DESCEND)
        flight.executive.orders.abort(flight.situation())
        flight.run(10)
    assert flight.executive.orders.select_zone(flight.situation(), 2).accepted
    flight.run(2)
    flight.jump(5.0, 0, 0)
    flight.run(5)
    assert flight.texts[-1] == "SLZ: selection lost: select again"
    assert flight.texts.count("SLZ: selection lost: select again") == 1
    assert flight.executive.orders.land_at_selected(flight.situation()).reason == "nothing selected"
    assert flight.executive.orders.select_zone(flight.situation(), 1).accepted
    flight.run(2)
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.APPROACH)


def test_a_jump_without_a_selection_loses_none() -> None:
    flight = Flight([zone(1, 20, 0)], auto=False).run(1)
    flight.jump(5.0, 0, 0)
    assert flight.run(1).texts == []


# ---- link ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("connected", [True, False])
def test_who_hears_nothing_asks_for_no_mode(connected: bool) -> None:
    """The way out may still be open: what the pilot chose meanwhile would be undone, again and again."""
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 8)
    flight.heard, flight.connected, flight.blind, flight.obeys = False, connected, True, False
    before = len(flight.commands)
    flight.run(20)
    assert not any(commands.mode for *_, commands in flight.commands[before:])


# ---- dust ----------------------------------------------------------------------------------------


def test_below_the_dust_height_nothing_is_mapped_and_the_last_state_holds() -> None:
    flight = Flight([zone(1, 10, 0)], dust_height_m=4.0)
    flight.state = lambda h, _point: PointState.UNSAFE if h < 3.8 else PointState.SAFE
    mapped = []
    while flight.executive.phase is not Phase.LANDED:
        flight.step()
        mapped.append((flight.position[2], flight.executive.mapping))
    assert flight.executive.tally.aborts == 0
    assert {on for height, on in mapped if height > 4.3} == {True}
    assert {on for height, on in mapped if height < 3.8} == {False}


def test_after_a_landing_mapping_begins_again_with_the_next_flight() -> None:
    flight = Flight([zone(1, 0, 0)]).fly_to(Phase.LANDED)
    assert not flight.executive.mapping
    flight.mode, flight.position[2], flight.velocity = "GUIDED", 20.0, np.zeros(3)
    flight.fly_to(Phase.SURVEY)
    assert flight.executive.mapping


def test_below_the_point_of_the_landing_before_the_next_flight_is_mapped() -> None:
    """From a roof or a hill down, before any order."""
    flight = Flight([zone(1, 0, 0)]).fly_to(Phase.LANDED)
    flight.mode, flight.position = "LOITER", np.array([60.0, 0.0, 15.0])
    flight.estimate_is_off_m = np.array([0.0, 0.0, -25.0])
    flight.run(1)
    assert flight.executive.phase is Phase.LANDED
    assert flight.executive.mapping


# ---- battery -------------------------------------------------------------------------------------


def test_a_low_battery_in_the_survey_lands_at_the_nearest_zone_at_once() -> None:
    flight = Flight([zone(1, 90, 0, clearance=9), zone(2, -8, 0)], survey_s=600.0).fly_to(Phase.SURVEY)
    flight.run(2)
    flight.battery_pct = 14.0
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-8, abs=0.5)
    assert any("battery low" in text for text in flight.texts)
    assert flight.time_s < 120


def test_a_low_battery_in_the_approach_lands_at_a_nearer_zone() -> None:
    flight = Flight([zone(1, 190, 0, clearance=9), zone(2, -8, 0)]).fly_to(Phase.APPROACH).run(2)
    flight.battery_pct = 14.0
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-8, abs=0.5)
    assert flight.executive.tally.aborts == 0


def test_a_low_battery_in_the_approach_changes_nothing_where_the_point_is_the_nearest() -> None:
    flight = Flight([zone(1, 20, 0, clearance=9), zone(2, -80, 0)]).fly_to(Phase.APPROACH).run(2)
    flight.battery_pct = 14.0
    flight.fly_to(Phase.LANDED)
    assert flight.phases.count(Phase.SURVEY) == 1


@pytest.mark.parametrize("auto", [True, False])
def test_a_hand_over_with_a_low_battery_lands_at_the_nearest_zone_at_once(auto: bool) -> None:
    flight = Flight([zone(1, 90, 0, clearance=9), zone(2, -8, 0)], auto=auto, survey_s=600.0)
    flight.battery_pct = 14.0
    flight.run(1)
    if not auto:
        flight.executive.orders.land_at_best(flight.situation())
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-8, abs=0.5)


def test_a_battery_that_is_never_low_is_not_low_when_empty() -> None:
    flight = Flight([zone(1, 0, 0)], auto=False, battery_land_pct=0.0)
    flight.battery_pct = 0.0
    flight.run(3)
    assert not flight.texts


def test_a_low_battery_before_the_hand_over_is_said_once_and_commands_nothing() -> None:
    flight = Flight([zone(1, 0, 0)], auto=False)
    flight.battery_pct = 10.0
    flight.run(30)
    assert not any(is_commanding(commands) for *_, commands in flight.commands)
    assert sum("battery low" in text for text in flight.texts) == 1


@pytest.mark.parametrize("phase", [Phase.DESCEND, Phase.FINAL])
def test_a_low_battery_in_its_own_landing_is_not_told_to_land(phase: Phase) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(phase)
    flight.battery_pct = 10.0
    flight.fly_to(Phase.LANDED)
    assert not any("battery low" in text for text in flight.texts)


def test_a_battery_low_since_the_descent_is_told_when_that_is_broken_off() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.DESCEND)
    flight.battery_pct = 10.0
    flight.run(1)
    flight.executive.orders.abort(flight.situation())
    flight.run(5)
    assert sum("battery low" in text for text in flight.texts) == 1


def test_a_battery_low_since_the_ground_is_told_in_the_air() -> None:
    flight = Flight([zone(1, 10, 0)], auto=False, height=0.0)
    flight.battery_pct = 10.0
    flight.run(2)
    assert flight.texts == []
    flight.position = np.array([0.0, 0.0, 15.0])
    flight.run(2)
    assert flight.texts == ["SLZ: battery low: land"]


def test_a_low_battery_on_the_ground_is_nobody_s_concern() -> None:
    flight = Flight([], auto=False, height=0.0)
    flight.armed, flight.battery_pct = False, 5.0
    flight.run(2)
    assert flight.texts == []


def test_a_low_battery_without_a_map_goes_on_to_the_point_that_was_chosen() -> None:
    flight = Flight([zone(1, 60, 0)]).fly_to(Phase.APPROACH)
    flight.battery_pct = 5.0
    commands = flight.executive.step(replace(flight.situation(), report=None))
    assert [text for _, text in commands.texts] == ["SLZ: battery low: landing at the nearest zone"]
    assert flight.executive.phase is Phase.APPROACH
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(60, abs=0.5)


def test_a_low_battery_where_no_zone_is_left_goes_on_to_the_point_that_was_chosen() -> None:
    flight = Flight([zone(1, 60, 0)]).fly_to(Phase.APPROACH)
    flight.battery_pct, flight.zones = 5.0, []
    flight.fly_to(Phase.LANDED)
    assert flight.phases.count(Phase.APPROACH) == 1
    assert flight.position[0] == pytest.approx(60, abs=0.5)


@pytest.mark.parametrize("auto", [True, False])
def test_a_low_battery_without_a_zone_calls_the_pilot_again_and_again(auto: bool) -> None:
    flight = Flight([], auto=auto).run(1)
    if not auto:
        flight.executive.orders.land_at_best(flight.situation())
    flight.fly_to(Phase.SURVEY).run(20)
    flight.battery_pct = 14.0
    flight.run(1)
    assert flight.texts[-1] == "SLZ: battery low, no zone: take over"
    assert flight.severities[-1].name == "CRITICAL"
    flight.run(120)
    assert 4 <= flight.texts.count("SLZ: battery low, no zone: take over") <= 5
    flight.until(lambda f: f.executive.phase is Phase.HOLD)
    said = flight.texts.count("SLZ: battery low, no zone: take over")
    flight.run(120)
    assert flight.texts.count("SLZ: battery low, no zone: take over") > said + 2
    assert not any("landing at the nearest" in text for text in flight.texts)


def test_a_low_battery_lands_at_the_zone_found_after_the_pilot_was_called() -> None:
    flight = Flight([]).fly_to(Phase.SURVEY).run(20)
    flight.battery_pct = 14.0
    flight.run(40)
    flight.zones.append(zone(1, 30, 0))
    flight.fly_to(Phase.LANDED)
    assert flight.texts.count("SLZ: battery low, no zone: take over") == 2


def test_a_new_battery_is_watched_anew() -> None:
    flight = Flight([zone(1, 0, 0)], auto=False)
    for charge in (10.0, 14.0, 90.0, 12.0):
        flight.battery_pct = charge
        flight.run(3)
    assert sum("battery low" in text for text in flight.texts) == 2


def test_after_the_operator_s_abort_a_low_battery_commands_nothing_new() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.DESCEND)
    flight.executive.orders.abort(flight.situation())
    flight.battery_pct = 10.0
    flight.run(60)
    assert flight.executive.phase is Phase.HOLD


# ---- what is in the way --------------------------------------------------------------------------


def test_it_climbs_over_what_is_in_the_way() -> None:
    flight = Flight([zone(1, 40, 0)])
    flight.blocked = lambda f: 15 < f.position[0] < 25 and f.position[2] < 41
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    assert any("obstacle ahead: climbing" in text for text in flight.texts)


def test_what_is_too_high_to_pass_over_costs_the_point() -> None:
    flight = Flight([zone(1, 40, 0), zone(2, -30, 0)])
    flight.blocked = lambda f: f.position[0] > 15 and f.velocity_wanted[0] > 0
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.abort_reasons == ["way blocked"]
    assert flight.position[0] == pytest.approx(-30, abs=0.5)


def test_a_point_that_is_not_reached_is_given_up() -> None:
    flight = Flight([zone(1, 40, 0), zone(2, -30, 0)])
    head_wind = Flight.step

    def held(f: Flight) -> None:
        head_wind(f)
        f.position[0] = min(f.position[0], 20.0)

    while "point not reached" not in flight.executive.tally.abort_reasons:
        held(flight)
        assert flight.time_s < 200
    assert flight.executive.phase is Phase.CLIMB


# ---- emergency -----------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["LOITER", "GUIDED", "RTL"])
def test_an_emergency_lands_at_the_nearest_zone_from_any_mode(mode: str) -> None:
    flight = Flight([zone(1, 60, 0, clearance=9), zone(2, -10, 0)], auto=False)
    flight.mode = mode
    flight.run(1)
    assert flight.executive.orders.land_now(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-10, abs=0.5)
    assert flight.executive.tally.hands_off == 0


def test_an_emergency_goes_towards_a_far_zone_where_there_is_no_near_one() -> None:
    flight = Flight([], auto=False)
    flight.far_zones = [zone(3, 50, 0), zone(4, -20, 0)]
    flight.run(1)
    flight.executive.orders.land_now(flight.situation())
    flight.until(lambda f: f.executive.phase is Phase.APPROACH)
    assert flight.executive.tally.zone_id == 4


def test_an_emergency_ends_when_the_pilot_chooses_another_mode() -> None:
    flight = Flight([zone(1, 60, 0)], auto=False)
    flight.mode, flight.obeys = "LOITER", False
    flight.run(1)
    flight.executive.orders.land_now(flight.situation())
    flight.run(1)
    flight.mode = "ALT_HOLD"
    before = len(flight.commands)
    flight.run(10)
    assert not any(is_commanding(commands) for *_, commands in flight.commands[before:])


def test_an_emergency_is_given_up_when_the_autopilot_refuses_the_mode() -> None:
    flight = Flight([zone(1, 60, 0)], auto=False)
    flight.mode, flight.obeys = "LOITER", False
    flight.run(1)
    flight.executive.orders.land_now(flight.situation())
    flight.run(20)
    assert flight.executive.phase is Phase.IDLE
    assert any("LOITER stays" in text for text in flight.texts)


def test_an_emergency_without_a_position_is_given_up_too() -> None:
    flight = Flight([zone(1, 60, 0)], auto=False)
    flight.mode, flight.obeys = "LOITER", False
    flight.run(1)
    flight.blind = True
    flight.executive.orders.land_now(flight.situation())
    flight.run(20)
    assert flight.executive.phase is Phase.IDLE
    assert not is_commanding(flight.commands[-1][-1])


def test_an_emergency_aborted_before_the_mode_changed_leaves_the_mode_alone() -> None:
    flight = Flight([zone(1, 60, 0)], auto=False)
    flight.mode, flight.obeys = "LOITER", False
    flight.run(1)
    flight.executive.orders.land_now(flight.situation())
    flight.run(0.5)
    assert flight.executive.orders.abort(flight.situation()).accepted
    before = len(flight.commands)
    flight.run(20)
    assert not any(is_commanding(commands) for *_, commands in flight.commands[before:])


def test_an_order_without_a_position_begins_where_the_vehicle_is_then() -> None:
    flight = Flight([], auto=False, height=60.0).run(1)
    flight.executive.orders.land_at_best(flight.situation())
    flight.run(1)
    flight.mode = "LOITER"
    flight.run(1)
    flight.mode, flight.position, flight.blind = "GUIDED", np.array([500.0, 0.0, 20.0]), True
    flight.executive.orders.land_at_best(flight.situation())
    flight.run(1)
    flight.blind = False
    flight.run(5)
    assert flight.position[2] == pytest.approx(20, abs=0.5)


@pytest.mark.parametrize(("name", "value"), [("armed", False), ("connected", False)])
def test_an_emergency_is_refused_where_nothing_flies(name: str, value: object) -> None:
    flight = Flight([zone(1, 0, 0)], auto=False).run(1)
    setattr(flight, name, value)
    assert not flight.executive.orders.land_now(flight.situation()).accepted


# ---- modes on their way --------------------------------------------------------------------------


def test_a_landing_mode_that_shows_after_the_abort_is_ours_and_left_again() -> None:
    """LAND was ordered, the abort came before the autopilot had changed over."""
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], final_height_m=25.0)
    flight.until(lambda f: f.executive.phase is Phase.DESCEND)
    flight.obeys = False
    flight.fly_to(Phase.FINAL)
    flight.state = lambda _h, point: PointState.UNSAFE if point[0] > 0 else PointState.SAFE
    flight.step()
    assert flight.executive.phase is Phase.CLIMB
    flight.run(0.5)
    flight.mode = "LAND"
    flight.obeys = True
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0
    assert flight.position[0] < -19


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH, Phase.DESCEND])
def test_a_landing_mode_that_shows_when_it_already_looks_elsewhere_is_left_again(phase: Phase) -> None:
    """The request for LAND was under way while the position was lost; nobody chose the ground below."""
    flight = Flight([zone(1, 10, 0), zone(2, 10, 7)], final_height_m=29.5, approach_speed_ms=20.0)
    flight.until(lambda f: f.executive.phase is Phase.DESCEND)
    flight.obeys = False
    flight.fly_to(Phase.FINAL)
    flight.blind = True
    flight.step()
    flight.blind = False
    flight.executive.progress.phase = phase
    flight.run(0.5)
    assert flight.executive.phase is phase
    flight.mode = "LAND"
    flight.obeys = True
    flight.run(1.0)
    assert flight.executive.phase is Phase.CLIMB
    assert flight.mode == "GUIDED"
    assert "SLZ: LAND came late: climbing" in flight.texts
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0


def test_a_guided_mode_that_was_asked_for_and_shows_after_a_silence_is_ours() -> None:
    """It obeyed while its heartbeats were lost: nobody else has it, so the climb goes on."""
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)]).fly_to(Phase.FINAL).run(1.0)
    flight.blind, flight.obeys = True, False
    flight.run(2.0)
    assert flight.commands[-1][3].mode == "guided"
    flight.heard = False
    flight.run(1.0)
    flight.blind, flight.heard, flight.obeys = False, True, True
    flight.mode = "GUIDED"
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0
    assert flight.executive.tally.abort_reasons == ["position lost"]


def test_a_landing_mode_entered_while_nothing_was_heard_is_ours_and_broken_off() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], final_height_m=25.0)
    flight.until(lambda f: f.executive.phase is Phase.DESCEND)
    flight.obeys = False
    flight.fly_to(Phase.FINAL).run(0.3)
    flight.blind, flight.heard = True, False
    flight.run(4.5)
    flight.blind, flight.heard, flight.obeys = False, True, True
    flight.mode = "LAND"
    flight.run(1.0)
    assert flight.mode == "GUIDED"
    assert flight.executive.phase is Phase.CLIMB
    assert flight.executive.tally.hands_off == 0


def test_a_landing_mode_that_the_pilot_chooses_later_is_the_pilot_s() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], final_height_m=25.0).fly_to(Phase.FINAL)
    flight.until(lambda f: f.mode == "LAND")
    flight.state = lambda _h, point: PointState.UNSAFE if point[0] > 0 else PointState.SAFE
    flight.fly_to(Phase.APPROACH)
    flight.run(4)
    flight.mode, flight.obeys = "LAND", False
    before = len(flight.commands)
    flight.run(5)
    assert not any(is_commanding(commands) for *_, commands in flight.commands[before:])


@pytest.mark.parametrize("height", [8.0, 1.0])
def test_the_guided_mode_that_the_pilot_chooses_in_the_landing_is_the_pilot_s(height: float) -> None:
    flight = Flight([zone(1, 10, 0)], auto=False).run(1)
    flight.executive.orders.land_at_best(flight.situation())
    flight.fly_to(Phase.FINAL).until(lambda f: f.mode == "LAND" and f.position[2] < height)
    flight.mode = "GUIDED"
    before = len(flight.commands)
    flight.run(10)
    assert not any(is_commanding(commands) for *_, commands in flight.commands[before:])
    assert flight.executive.tally.hands_off == 1


def test_a_landing_mode_right_after_the_abort_of_a_landing_is_the_pilot_s() -> None:
    flight = Flight([zone(1, 10, 0)], final_height_m=25.0).fly_to(Phase.FINAL).run(0.3)
    flight.executive.orders.abort(flight.situation())
    flight.run(1)
    assert flight.mode == "GUIDED"
    flight.mode = "LAND"
    before = len(flight.commands)
    flight.run(5)
    assert not any(is_commanding(commands) for *_, commands in flight.commands[before:])


def test_a_landing_mode_that_is_refused_leaves_the_vehicle_where_it_is() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.DESCEND)
    flight.obeys = False
    flight.fly_to(Phase.FINAL).run(30)
    assert flight.executive.phase is Phase.FINAL
    assert flight.position[2] > 10


# ---- select, confirm -----------------------------------------------------------------------------


def test_a_zone_is_selected_and_then_confirmed() -> None:
    flight = Flight([zone(1, 20, 0, clearance=9), zone(2, -10, 0)], auto=False).run(1)
    assert not flight.executive.orders.land_at_selected(flight.situation()).accepted
    assert not flight.executive.orders.select_zone(flight.situation(), 9).accepted
    assert flight.executive.orders.select_zone(flight.situation(), 2).accepted
    flight.run(5)
    assert not any(is_commanding(commands) for *_, commands in flight.commands)
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-10, abs=0.5)


def test_a_confirmation_never_means_the_selection_before() -> None:
    flight = Flight([zone(1, 20, 0), zone(2, -10, 0)], auto=False).run(1)
    flight.executive.orders.select_zone(flight.situation(), 1)
    flight.run(5)
    flight.executive.orders.select_zone(flight.situation(), 2)
    reply = flight.executive.orders.land_at_selected(flight.situation())
    assert not reply.accepted
    assert "confirm again" in reply.reason
    flight.run(2)
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-10, abs=0.5)


def test_after_an_abort_another_zone_is_selected_and_confirmed() -> None:
    flight = Flight([zone(1, 20, 0, clearance=9), zone(2, -10, 0)]).fly_to(Phase.DESCEND)
    assert not flight.executive.orders.select_zone(flight.situation(), 2).accepted
    flight.executive.orders.abort(flight.situation())
    flight.run(3)
    assert flight.executive.orders.select_zone(flight.situation(), 2).accepted
    flight.run(3)
    assert flight.executive.phase is Phase.HOLD
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-10, abs=0.5)


def test_an_order_after_an_abort_does_not_end_the_climb() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -60, 0)], survey_height_m=3.0).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 5)
    flight.executive.orders.abort(flight.situation())
    flight.run(0.5)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.until(lambda f: f.position[0] < -55)
    assert flight.position[2] == pytest.approx(30, abs=1)


def test_a_far_zone_is_looked_at_when_the_survey_found_no_near_one() -> None:
    flight = Flight([])
    flight.far_zones = [zone(8, 70, 0)]
    flight.until(lambda f: f.executive.phase is Phase.APPROACH)
    assert flight.executive.tally.zone_id == 8
