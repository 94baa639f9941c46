"""Target of the autopilot's own landings: when it is sent, where it is, when it moves, and when it ends."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.assist.landing_here import LandingHere
from companion.flight.landing.situation import Phase, Severity, Vector
from slz import Intrusion, PointState
from tests.unit.companion.flight.landing.assist.ground_around import Area, ground_around
from tests.unit.companion.flight.landing.flight import Flight, zone

EAST: Area = (10.0, -3.0, 16.0, 3.0)
WEST: Area = (-18.0, -3.0, -12.0, 3.0)
BELOW: Area = (-3.0, -3.0, 3.0, 3.0)


def flying(*landable: Area, assist: str = "offer", height: float = 20.0, **settings: object) -> Flight:
    """A vehicle in LOITER, flown by its pilot."""
    flight = Flight([], auto=False, assist=assist, height=height, **settings)
    return flight.having(mode="LOITER", around=ground_around(landable)).run(1)


def landing(*landable: Area, mode: str = "LAND", **more: object) -> Flight:
    """The same, in a landing that the autopilot makes by itself."""
    return flying(*landable, **more).having(mode=mode, lands_itself=True, follows_target=True).run(0.2)  # type: ignore[arg-type]


def target(flight: Flight) -> Vector | None:
    return flight.commands[-1][3].target_enu_m


def here(flight: Flight) -> LandingHere:
    now = flight.executive.assist.now
    assert now is not None
    return now


def is_in(area: Area, place: Vector | None) -> bool:
    west, south, east, north = area
    return place is not None and west <= place[0] <= east and south <= place[1] <= north


# ---- where it leads ---------------------------------------------------------------------------------


def test_the_target_is_sent_before_a_landing_begins() -> None:
    assert is_in(EAST, target(flying(EAST, WEST)))


@pytest.mark.parametrize("mode", ["LAND", "RTL", "AUTO"])
def test_a_landing_is_led_to_the_nearest_safe_place(mode: str) -> None:
    flight = landing(EAST, WEST, mode=mode)
    assert is_in(EAST, target(flight))
    assert f"SLZ: {mode}: led 12 m E to safe ground" in flight.texts
    assert flight.selected is not None
    assert is_in(EAST, flight.selected)


def test_over_safe_ground_it_leads_straight_down() -> None:
    flight = landing(BELOW, EAST)
    assert is_in(BELOW, target(flight))
    assert "SLZ: LAND: safe below, led down" in flight.texts


def test_nothing_is_commanded() -> None:
    flight = landing(EAST, WEST).run(25)
    assert all(one.velocity_enu_ms is None and one.mode is None for *_, one in flight.commands)


def test_without_a_safe_place_in_reach_there_is_no_target_and_the_pilot_reads_where_one_is() -> None:
    flight = flying().having(zones=[zone(7, -30, -30)]).run(0.2)
    flight.having(mode="LAND", lands_itself=True, follows_target=True).run(3)
    assert target(flight) is None
    assert flight.texts.count("SLZ: LAND: nothing safe, nearest 42 m SW") == 1
    assert (
        flight.severities[flight.texts.index("SLZ: LAND: nothing safe, nearest 42 m SW")] is Severity.CRITICAL
    )


def test_a_place_found_later_is_taken() -> None:
    flight = landing()
    assert target(flight) is None
    assert is_in(EAST, target(flight.having(around=ground_around([EAST])).run(0.3)))


def test_a_start_in_a_landing_waits_for_its_map_before_it_calls_the_pilot() -> None:
    flight = flying().having(mode="LAND", lands_itself=True, follows_target=True, lidar_ok=False)
    assert not any("LAND" in text for text in flight.run(2.5).texts)
    assert "SLZ: LAND: LiDAR lost, not led" in flight.run(1.0).texts


def test_off_it_sends_nothing_and_still_knows_what_landing_here_means() -> None:
    flight = landing(EAST, assist="off")
    assert target(flight) is None
    assert flight.texts == []
    assert here(flight).text == "12 m E, free way"


@pytest.mark.parametrize(
    ("landable", "text", "number"),
    [((BELOW,), "safe", 0.0), ((EAST,), "12 m E, free way", 12.3), ((), "none within reach", -1.0)],
)
def test_what_landing_here_means_is_known_all_the_time(
    landable: tuple[Area, ...], text: str, number: float
) -> None:
    now = here(flying(*landable))
    assert now.text == text
    assert now.number_m == pytest.approx(number, abs=0.1)


def test_where_nothing_is_in_reach_the_nearest_zone_is_named() -> None:
    assert (
        flying().having(zones=[zone(7, 0, 60)]).run(0.2).executive.assist.now.text.endswith("nearest 60 m N")
    )
    assert LandingHere().text == "none within reach"


def test_without_a_map_it_says_so_and_not_that_nothing_is_safe() -> None:
    now = here(flying(BELOW).having(lidar_ok=False).run(0.2))
    assert now.text == "no map"
    assert np.isnan(now.number_m)


def test_on_the_ground_nothing_is_said_of_a_landing() -> None:
    assert flying(BELOW).having(armed=False).run(0.2).executive.assist.now is None


# ---- how it stays and moves -------------------------------------------------------------------------


def test_the_target_stays_where_a_nearer_place_comes_up() -> None:
    flight = landing(EAST)
    first = target(flight)
    after = target(flight.having(around=ground_around([EAST, BELOW])).run(2))
    assert first is not None
    assert after is not None
    assert np.array_equal(first[:2], after[:2])


def test_an_unsafe_target_moves_to_the_next_place() -> None:
    flight = landing((10.0, -1.0, 12.0, 1.0), WEST)
    flight.having(state=lambda _, point: PointState.UNSAFE if point[0] > 0 else PointState.SAFE).run(1)
    assert is_in(WEST, target(flight))
    assert "SLZ: target unsafe: led 14 m W instead" in flight.texts
    assert flight.executive.assist.tally.moved == 1


def test_somebody_on_the_target_moves_it_at_once() -> None:
    flight = landing(BELOW, EAST)
    came = Intrusion(np.zeros(3), 1.8, 0, 5)
    flight.having(intrusion=came, state=lambda *_: PointState.UNSAFE).step()
    assert flight.executive.assist.tally.moved == 1


def test_an_unsafe_target_without_another_place_stays_and_calls_the_pilot() -> None:
    flight = landing((10.0, -1.0, 12.0, 1.0))
    before = target(flight)
    after = target(flight.having(state=lambda *_: PointState.UNSAFE).run(3))
    assert before is not None
    assert after is not None
    assert np.array_equal(before[:2], after[:2])
    assert flight.texts.count("SLZ: target unsafe, none near: take over") == 1


def test_what_nobody_judges_any_more_stays() -> None:
    flight = landing(EAST, WEST).having(state=lambda *_: PointState.UNKNOWN, lidar_ok=False).run(5)
    assert is_in(EAST, target(flight))


def test_a_jump_of_the_position_moves_the_target_with_it() -> None:
    flight = landing(EAST)
    before = target(flight)
    flight.jump(4.0, -3.0, 0.0)
    flight.step()
    after = target(flight)
    assert before is not None
    assert after is not None
    assert after[:2] - before[:2] == pytest.approx([4.0, -3.0], abs=0.2)
    assert flight.selected == pytest.approx(after, abs=0.1)


def test_the_target_is_sent_without_a_pause_until_the_vehicle_is_disarmed() -> None:
    flight = landing(BELOW).run(30)
    assert flight.position[2] == 0
    flight.having(lands_itself=False).run(2)  # it stands, and reports no landing any more
    first = len(flight.commands)
    assert all(one.target_enu_m is not None for *_, one in flight.commands[20:first])
    flight.having(armed=False).step()
    assert target(flight) is None
    assert any("off the target" in text for text in flight.texts)


def test_a_touchdown_is_told_where_the_mode_changes_on_the_ground() -> None:
    """PX4 leaves AUTO.RTL for AUTO.LOITER when it stands, and disarms later."""
    flight = landing(BELOW, mode="AUTO.RTL")
    flight.position[2] = 0.0
    flight.having(mode="AUTO.LOITER", lands_itself=False).run(0.2)
    assert any(text.startswith("SLZ: AUTO.RTL: landed, 0.") for text in flight.texts)


def test_a_low_landing_gets_no_target_far_aside() -> None:
    assert target(landing(EAST, height=4.0)) is None


# ---- how it ends ------------------------------------------------------------------------------------


def test_sticks_end_it_within_a_step_and_for_the_whole_landing() -> None:
    flight = landing(EAST, height=30.0)
    flight.having(sticks_us=(1500, 1500)).run(0.2)
    flight.having(sticks_us=(1700, 1500)).step()
    assert target(flight) is None
    assert "SLZ: LAND: sticks moved, no longer led" in flight.texts
    assert target(flight.having(sticks_us=(1500, 1500)).run(3)) is None


@pytest.mark.parametrize(
    ("lost", "what"),
    [
        ({"gps_lost": True}, "GPS"),
        ({"estimate_lost": "EKF position"}, "EKF position"),
        ({"blind": True}, "position"),
    ],
)
def test_without_an_estimate_there_is_no_target(lost: dict[str, object], what: str) -> None:
    assert target(flying(EAST).having(**lost).run(0.2)) is None
    flight = landing(EAST).having(**lost).run(1.3)
    assert target(flight) is None
    assert f"SLZ: LAND: {what} lost, no longer led" in flight.texts


def test_another_mode_ends_it_and_the_next_landing_is_led_again() -> None:
    flight = landing(EAST).having(mode="LOITER", lands_itself=False).run(0.5)
    assert not flight.executive.assist.leads
    flight.having(mode="RTL", lands_itself=True).run(0.2)
    assert flight.executive.assist.tally.led == 2


def test_an_order_to_land_has_its_own_target() -> None:
    flight = Flight([zone(1, 20, 0)], assist="offer").having(around=ground_around([WEST]))
    flight.fly_to(Phase.DESCEND).run(1)
    assert target(flight) == pytest.approx([20, 0, 0])


# ---- act --------------------------------------------------------------------------------------------


def untargeted(**more: object) -> Flight:
    """A landing that takes no target, as PX4's AUTO.LAND."""
    flight = flying(EAST, **more)  # type: ignore[arg-type]
    return flight.having(mode="AUTO.LAND", lands_itself=True, follows_target=False).run(0.3)


def test_offer_takes_over_no_landing() -> None:
    flight = untargeted()
    assert flight.executive.phase is Phase.IDLE
    assert "SLZ: AUTO.LAND: safe is 12 m E, takes no target" in flight.texts


def test_act_leads_a_landing_that_takes_no_target_to_the_place() -> None:
    flight = untargeted(assist="act")
    flight.having(lands_itself=False)
    flight.fly_to(Phase.DESCEND)
    assert is_in(EAST, flight.executive.aim_enu_m)


def test_act_takes_over_once_in_a_flight() -> None:
    flight = untargeted(assist="act")
    assert flight.executive.phase is Phase.APPROACH
    flight.run(1).having(mode="LOITER", lands_itself=False).run(1)
    assert flight.executive.phase is Phase.IDLE
    flight.having(mode="AUTO.LAND", lands_itself=True).run(1)
    assert flight.executive.phase is Phase.IDLE


@pytest.mark.parametrize("lost", [{"gps_lost": True}, {"blind": True}])
def test_act_takes_nothing_over_without_an_estimate(lost: dict[str, object]) -> None:
    flight = flying(EAST, assist="act").having(**lost)
    flight.having(mode="AUTO.LAND", lands_itself=True, follows_target=False).run(1)
    assert flight.executive.phase is Phase.IDLE


def test_over_safe_ground_act_takes_nothing_over() -> None:
    flight = flying(BELOW, assist="act")
    flight.having(mode="AUTO.LAND", lands_itself=True, follows_target=False).run(1)
    assert flight.executive.phase is Phase.IDLE


def test_the_longest_texts_fit_the_pilots_screen() -> None:
    assert len("SLZ: AUTO.LAND: safe is 28 m NE, takes no target") <= 50
    assert len("SLZ: AUTO.PRECLAND: nothing safe, nearest 120 m NE") <= 50
