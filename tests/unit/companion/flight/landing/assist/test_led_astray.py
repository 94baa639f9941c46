"""What must not go wrong in a landing of the autopilot's own: stray, stale, sudden and repeated things."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.assist.landing_here import Here
from companion.flight.landing.assist.landing_places import nearest_place
from companion.flight.landing.situation import MissingInput, Phase, Severity
from slz import Intrusion, MovingObject, Nearby, PointState
from tests.unit.companion.flight.landing.assist.ground_around import CELL_M, HALF_M, blocks, ground_around
from tests.unit.companion.flight.landing.assist.test_assist import (
    BELOW,
    EAST,
    flying,
    here,
    is_in,
    landing,
    target,
    untargeted,
)
from tests.unit.companion.flight.landing.flight import Flight, zone


def test_a_target_that_is_not_followed_calls_the_pilot_before_the_touchdown() -> None:
    """Mission NAV_LAND without param2, RTL_ALT_FINAL, land_repo_active, PrecLand failsafe: straight down."""
    flight = landing(EAST)  # the point mass sinks straight down, 12 m from the target
    flight.until(lambda f: f.position[2] < 0.5)
    calls = [t for t, sev in zip(flight.texts, flight.severities, strict=True) if sev is Severity.CRITICAL]
    assert calls


def test_a_gap_of_one_pose_does_not_end_it() -> None:
    flight = landing(EAST)
    flight.having(blind=True).step()
    flight.having(blind=False).run(1)
    assert is_in(EAST, target(flight))


def test_a_flicker_of_the_estimate_does_not_end_it() -> None:
    flight = landing(EAST)
    flight.having(estimate_lost="EKF position").step()
    flight.having(estimate_lost="").run(1)
    assert is_in(EAST, target(flight))


def test_a_way_that_was_free_at_60_m_is_judged_anew_where_px4_lands_from_30_m() -> None:
    flight = Flight([], auto=False, assist="offer", height=60.0)
    wall = ((5.0, -30.0, 6.0, 30.0), 40.0)
    flight.having(mode="AUTO.RTL", around=ground_around([EAST], [wall])).run(0.3)
    flight.having(lands_itself=True, follows_target=True).run(0.3)  # sinks to RTL_DESCEND_ALT
    flight.position[2] = 30.0
    flight.having(lands_itself=False).run(1)  # loiters, RTL_LAND_DELAY
    flight.having(lands_itself=True).run(1)
    assert target(flight) is None


def test_a_stick_ends_act() -> None:
    flight = untargeted(assist="act")
    flight.having(lands_itself=False, sticks_us=(1500, 1500)).run(1)
    assert flight.executive.phase is Phase.APPROACH
    flight.having(sticks_us=(1900, 1500)).run(2)
    assert flight.executive.phase is Phase.IDLE


def test_act_takes_nothing_over_in_the_last_metres() -> None:
    flight = Flight([], auto=False, assist="act", height=1.4)
    flight.having(mode="LOITER", around=ground_around([(-0.5, -0.5, 0.0, 0.0)])).run(0.3)
    flight.having(mode="AUTO.LAND", lands_itself=True, follows_target=False).run(0.3)
    flight.having(lands_itself=False)
    heights = [float(flight.position[2]) for _ in range(200) if flight.step() is not None]
    assert flight.executive.tally.chosen_enu_m is None
    assert max(heights) < 2.0


def hill() -> Nearby:
    """The vehicle is over a hill; the place is 12 m aside and 10 m lower."""
    flat = ground_around([EAST])
    ground = np.full_like(flat.ground_m, -10.0)
    ground[blocks((-6.0, -6.0, 6.0, 6.0))] = 0.0
    return Nearby(-HALF_M, -HALF_M, CELL_M, ground, ground.copy(), flat.landable)


def test_three_metres_over_a_hill_no_target_far_aside_begins() -> None:
    flight = Flight([], height=3.0).having(around=hill())
    place = nearest_place(flight.situation(), flight.parameters)
    assert place is None or place.away_m <= 1.5


def test_below_is_not_safe_where_somebody_walks_and_the_target_is_elsewhere() -> None:
    walker = MovingObject(1, 0, np.array([3.0, 0.0]), np.array([-1.0, 0.0]), 0.4, 1.8, 0.0)
    flight = flying(BELOW, EAST).having(moving=lambda _: (walker,), around=ground_around([BELOW, EAST]))
    flight.having(mode="LAND", lands_itself=True, follows_target=True).run(0.3)
    assert is_in(EAST, target(flight))
    assert "SLZ: LAND: safe below, led down" not in flight.texts
    assert here(flight).here is not Here.SAFE


def test_an_abort_that_is_not_obeyed_yet_streams_no_other_target_into_lands_way() -> None:
    near = (6.0, -3.0, 10.0, 3.0)
    flight = Flight([zone(1, 15, 0)], assist="offer").having(around=ground_around([near]))
    flight.fly_to(Phase.FINAL).run(1)
    first = target(flight)
    flight.having(obeys=False, lands_itself=True, follows_target=True, state=lambda *_: PointState.UNSAFE)
    flight.run(0.5)
    assert flight.executive.phase is Phase.CLIMB
    assert flight.mode == "LAND"
    now = target(flight)
    assert now is None or np.hypot(*(now - first)[:2]) < 0.1


def test_a_withdrawn_map_leads_nowhere() -> None:
    flight = flying(EAST).having(lidar_ok=False, lost=MissingInput.MAP_INVALID, around=ground_around([EAST]))
    flight.having(mode="LAND", lands_itself=True, follows_target=True).run(1)
    assert target(flight) is None


def test_after_a_stick_a_landed_state_that_flaps_does_not_lead_again() -> None:
    flight = landing(EAST, mode="AUTO.RTL", height=30.0)
    flight.having(sticks_us=(1500, 1500)).run(0.2)
    flight.having(sticks_us=(1700, 1500)).run(0.5)
    flight.having(sticks_us=(1500, 1500)).run(0.5)
    assert target(flight) is None
    flight.having(lands_itself=False).step()
    flight.having(lands_itself=True).run(0.5)
    assert not flight.executive.assist.leads


def test_rc_failsafe_in_forward_flight_is_led() -> None:
    """The receiver holds, or centres, what it had when the pilot flew on: nobody moves a stick."""
    flight = flying(EAST).having(sticks_us=(1500, 1750)).run(0.5)
    flight.having(mode="LAND", lands_itself=True, follows_target=True, failsafe=True).run(0.5)
    assert flight.executive.assist.leads


def test_rc_failsafe_whose_receiver_centres_is_led() -> None:
    flight = flying(EAST).having(sticks_us=(1500, 1620)).run(0.5)
    flight.having(mode="LAND", lands_itself=True, follows_target=True, failsafe=True).run(0.2)
    flight.having(sticks_us=(1500, 1500)).run(0.5)
    assert flight.executive.assist.leads


def test_a_wall_before_the_stopping_place_blocks_the_way() -> None:
    wall = ((8.0, -8.0, 9.0, 8.0), 30.0)
    flight = Flight([], height=20.0).having(around=ground_around([(16.0, -3.0, 20.0, 3.0)], [wall]))
    flight.velocity = np.array([8.0, 0.0, 0.0])  # stops at 12.8 m by 2.5 m/s2, before the wall by 4.5
    assert nearest_place(flight.situation(), flight.parameters) is None


def test_a_mission_that_sinks_in_steps_calls_the_pilot_once() -> None:
    flight = flying().having(mode="AUTO.MISSION")
    for _ in range(5):
        flight.having(lands_itself=True, follows_target=True).run(0.5).having(lands_itself=False).run(0.5)
    assert flight.texts.count("SLZ: AUTO.MISSION: nothing safe in reach") <= 1


def test_somebody_on_the_target_in_the_last_metre_is_told() -> None:
    flight = landing(BELOW, height=4.0)
    flight.until(lambda f: f.position[2] < 1.4)
    n = len(flight.texts)
    flight.having(intrusion=Intrusion(np.zeros(3), 1.8, 0, 5), state=lambda *_: PointState.UNSAFE).run(0.8)
    assert flight.texts[n:]


def test_a_jump_before_a_landing_moves_the_offered_target_or_withdraws_it() -> None:
    flight = flying(EAST)
    flight.jump(6.0, 0.0, 0.0)
    flight.having(lidar_ok=False, lost=MissingInput.MAP_BEGINS)  # the report is still that of the map before
    flight.having(mode="LAND", lands_itself=True, follows_target=True).step()
    t = target(flight)
    assert t is None or is_in((16.0, -3.0, 22.0, 3.0), t)


def test_act_needs_a_battery_that_is_good_and_a_map() -> None:
    flight = flying(EAST, assist="act").having(lidar_ok=False)
    flight.having(mode="AUTO.LAND", lands_itself=True, follows_target=False).run(0.5)
    assert flight.executive.phase is Phase.IDLE


def test_act_needs_wind_that_it_may_fly_in_and_gps_that_is_used() -> None:
    flight = flying(EAST, assist="act").having(gps_glitching=True)
    flight.having(mode="AUTO.LAND", lands_itself=True, follows_target=False).run(0.5)
    assert flight.executive.phase is Phase.IDLE


def test_not_led_because_of_sticks_sends_no_target() -> None:
    flight = flying(EAST).having(sticks_us=(1500, 1750)).run(0.5)
    flight.having(mode="LAND", lands_itself=True, follows_target=True).run(5)
    assert "SLZ: LAND: sticks moved, not led" in flight.texts
    assert target(flight) is None


def test_not_led_because_gps_is_lost_with_the_mode_sends_no_target() -> None:
    flight = flying(EAST)
    flight.having(gps_lost=True, mode="LAND", lands_itself=True, follows_target=True).run(5)
    assert "SLZ: LAND: GPS lost, not led" in flight.texts
    assert target(flight) is None


def test_a_place_that_vanishes_as_the_landing_begins_gets_no_target() -> None:
    flight = flying(EAST).having(around=ground_around([]))
    flight.having(mode="LAND", lands_itself=True, follows_target=True).run(5)
    assert "SLZ: LAND: nothing safe in reach" in flight.texts
    assert target(flight) is None


def test_after_sticks_in_our_own_landing_no_other_place_is_streamed() -> None:
    flight = Flight([zone(1, 15, 0)], assist="offer").having(around=ground_around([(6.0, -3.0, 10.0, 3.0)]))
    flight.having(sticks_us=(1500, 1500)).fly_to(Phase.FINAL)
    flight.having(lands_itself=True, follows_target=True).run(0.5)
    flight.having(sticks_us=(1900, 1500)).run(3)
    assert flight.executive.phase is Phase.IDLE
    assert flight.mode == "LAND"
    assert target(flight) is None
