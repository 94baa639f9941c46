"""The landing executive, flown with a point mass."""

import numpy as np
import pytest

from companion.flight.landing.situation import Phase
from slz import PointState
from tests.unit.companion.flight.landing.flight import Flight, zone


def test_auto_surveys_chooses_and_lands_on_the_point() -> None:
    flight = Flight([zone(1, 20, 10), zone(2, 5, 5, clearance=0.5)]).fly_to(Phase.LANDED)
    assert flight.phases == [
        Phase.IDLE,
        Phase.SURVEY,
        Phase.APPROACH,
        Phase.DESCEND,
        Phase.FINAL,
        Phase.LANDED,
    ]
    assert np.hypot(*(flight.position[:2] - [20, 10])) < 0.5
    assert flight.executive.tally.zone_id == 1
    assert flight.executive.tally.aborts == 0


def test_landing_target_streams_for_longer_than_the_autopilot_needs_before_land() -> None:
    flight = Flight([zone(1, 3, 2)], final_height_m=29.0).fly_to(Phase.FINAL)
    streamed = [time for time, _, mode, commands in flight.commands if commands.target_enu_m is not None]
    assert streamed[-1] - streamed[0] >= 2.5


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"mode": "LOITER"}, "not guided"),
        ({"armed": False}, "not armed"),
        ({"connected": False}, "no autopilot"),
        ({"auto": False}, "not asked"),
    ],
)
def test_nothing_is_commanded_before_the_operator_handed_over(change: dict[str, object], why: str) -> None:
    flight = Flight([zone(1, 0, 0)], auto=bool(change.pop("auto", True)))
    for name, value in change.items():
        setattr(flight, name, value)
    flight.run(20)
    assert flight.is_silent_since(0), why


def test_auto_waits_for_the_take_off_to_end() -> None:
    flight = Flight([zone(1, 0, 0)], height=12.0).having(velocity=np.array([0, 0, 2.0]))
    for _ in range(50):
        flight.step()
        flight.velocity = np.array([0, 0, 2.0])
    assert flight.executive.phase is Phase.IDLE


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL])
def test_hands_off_from_the_step_the_pilot_changes_the_mode(phase: Phase) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(phase)
    if phase is Phase.FINAL:
        flight.until(lambda f: f.mode == "LAND")
    assert flight.having(mode="LOITER").silent_for(10)
    assert flight.executive.phase is Phase.IDLE
    assert any("hands off" in text for text in flight.texts)


def test_pilot_s_guided_hands_over_again() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    flight.having(mode="LOITER").run(5)
    flight.having(mode="GUIDED").fly_to(Phase.LANDED)


@pytest.mark.parametrize("height", [25.0, 10.0, 3.0])
def test_point_that_turns_unsafe_above_commit_height_is_left_for_another(height: float) -> None:
    flight = Flight([zone(1, 10, 0, clearance=6), zone(2, -30, 0, clearance=6)])
    flight.state = lambda h, point: (
        PointState.UNSAFE
        if point[0] > 0 and (h < height or flight.executive.tally.aborts)
        else PointState.SAFE
    )
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 1
    assert flight.executive.tally.abort_reasons == ["point unsafe"]
    assert np.hypot(*(flight.position[:2] - [-30, 0])) < 0.5


def test_reports_of_less_than_three_seconds_end_no_approach() -> None:
    """High above the point they may have had few returns; those of three seconds end it."""
    flight = Flight([zone(1, 60, 0)]).fly_to(Phase.APPROACH)
    for wrong_s, aborts in ((2.5, 0), (3.5, 1)):
        flight.run(1.05 - flight.time_s % 1.0)
        flight.having(state=lambda _h, _point: PointState.UNSAFE).run(wrong_s)
        flight.having(state=lambda _h, _point: PointState.SAFE).run(2.0)
        assert flight.executive.tally.aborts == aborts


def test_below_commit_height_the_landing_goes_on() -> None:
    flight = Flight([zone(1, 10, 0)], commit_height_m=1.5)
    flight.state = lambda h, _point: PointState.UNSAFE if h < 1.2 else PointState.SAFE
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("state", [PointState.UNKNOWN, PointState.UNSAFE])
def test_a_point_never_found_safe_is_never_descended_to(state: PointState) -> None:
    flight = Flight([zone(1, 10, 0)])
    flight.having(state=lambda _h, _point: state).run(200)
    assert Phase.DESCEND not in flight.phases
    assert flight.position[2] > 25


@pytest.mark.parametrize("away_m", [10, 60, 200])
def test_a_point_has_thirty_seconds_to_be_seen_from_above_however_long_the_way_was(away_m: int) -> None:
    flight = Flight([zone(1, away_m, 0)]).having(state=lambda _h, _point: PointState.UNKNOWN)
    flight.fly_to(Phase.APPROACH).until(lambda f: abs(f.position[0] - away_m) < 1)
    arrived_s = flight.time_s
    flight.run(25)
    assert flight.executive.phase is Phase.APPROACH
    flight.fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["point not seen"]
    assert 30 < flight.time_s - arrived_s < 35  # the last metre slows it down


def test_a_point_far_away_that_is_found_safe_from_above_is_landed_on() -> None:
    flight = Flight([zone(1, 200, 0)])
    flight.state = lambda _h, _p: PointState.SAFE if flight.position[0] > 199.9 else PointState.UNKNOWN
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_lost_lidar_in_the_descent_breaks_off_and_then_asks_the_pilot() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 8)
    flight.having(lidar_ok=False).run(60)
    assert flight.executive.tally.abort_reasons == ["LiDAR lost"]
    assert flight.mode == "GUIDED"
    assert flight.position[2] > 25
    assert np.allclose(flight.velocity, 0)
    assert any("take over" in text for text in flight.texts)


def test_an_abort_insists_until_the_autopilot_obeys() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], final_height_m=25.0).fly_to(Phase.FINAL)
    flight.until(lambda f: f.mode == "LAND")
    flight.state = lambda _h, point: PointState.UNSAFE if point[0] > 0 else PointState.SAFE
    flight.having(obeys=False).run(4)
    assert flight.mode == "LAND"
    assert all(commands.mode == "guided" for *_, commands in flight.commands[-30:])
    flight.having(obeys=True).fly_to(Phase.LANDED)
    assert flight.position[0] < -19


def test_no_zone_means_no_landing() -> None:
    flight = Flight([zone(1, 0, 0, certainty=0.5)]).run(120)
    assert flight.executive.phase is Phase.SURVEY
    assert flight.position[2] > 25


def test_a_search_that_finds_no_zone_ends_in_a_hover_and_calls_the_pilot() -> None:
    flight = Flight([]).fly_to(Phase.SURVEY)
    flight.run(300)
    assert flight.executive.phase is Phase.SURVEY
    flight.run(10)
    assert flight.executive.phase is Phase.HOLD
    flight.run(60)
    assert flight.texts.count("SLZ: no zone found: take over") == 1
    assert flight.severities[flight.texts.index("SLZ: no zone found: take over")].name == "CRITICAL"
    assert np.allclose(flight.velocity, 0)


def test_after_a_search_without_a_zone_a_new_order_searches_anew() -> None:
    flight = Flight([], auto=False).run(1)
    flight.executive.orders.land_at_best(flight.situation())
    flight.until(lambda f: f.executive.phase is Phase.HOLD, 400)
    flight.zones.append(zone(1, 10, 0))
    assert flight.executive.orders.land_at_best(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)


@pytest.mark.parametrize(("zone_m", "jumps"), [(80.0, False), (80.0, True), (20.0, False)])
def test_a_search_stays_within_half_the_map_of_where_it_began(zone_m: float, jumps: bool) -> None:
    flight = Flight([], zone_m=zone_m).fly_to(Phase.SURVEY)
    farthest_m = 0.0
    while flight.time_s < 280:
        flight.step()
        farthest_m = max(farthest_m, float(np.hypot(*flight.position[:2])))
        if jumps and round(flight.time_s, 1) % 30 == 0:
            flight.jump(9.0, -4.0, 0.0)
    assert farthest_m < zone_m / 2 + 1
    assert zone_m < 80 or farthest_m > 0.8 * zone_m / 2


@pytest.mark.parametrize(("east", "north"), [(40, 0), (0, 40), (-30, -30)])
def test_the_nose_points_aside_of_the_course_for_the_lidar_to_see_ahead(east: float, north: float) -> None:
    flight = Flight([zone(1, east, north)], crab_deg=60.0).fly_to(Phase.APPROACH).run(1)
    yaw = flight.step().yaw_rad
    assert yaw is not None
    course = np.arctan2(flight.velocity[0], flight.velocity[1])
    assert np.degrees(yaw - course) % 360 == pytest.approx(60)


def test_without_a_pose_the_vehicle_stops() -> None:
    flight = Flight([zone(1, 50, 0)]).fly_to(Phase.APPROACH).run(1).having(blind=True)
    commands = flight.step()
    assert commands.velocity_enu_ms is not None
    assert np.allclose(commands.velocity_enu_ms, 0)


def test_ground_of_a_survey_is_flown_to_and_left_again_unless_live_maps_call_it_safe() -> None:
    flight = Flight([]).having(prior_zones=[zone(100_001, 15, 5, certainty=0.5)])
    flight.having(state=lambda _h, _point: PointState.UNKNOWN).run(120)
    assert Phase.APPROACH in flight.phases
    assert not {Phase.DESCEND, Phase.FINAL} & set(flight.phases)
    assert flight.position[2] > 25
    assert flight.executive.tally.abort_reasons[0] == "point not seen"


def test_ground_of_a_survey_that_live_maps_call_safe_is_landed_on() -> None:
    flight = Flight([])
    flight.having(prior_zones=[zone(100_001, 15, 5, certainty=0.5)]).fly_to(Phase.LANDED)
    assert np.hypot(*(flight.position[:2] - [15, 5])) < 0.5


def test_a_zone_that_was_seen_goes_before_one_of_a_survey() -> None:
    flight = Flight([zone(1, 40, 10)]).having(prior_zones=[zone(100_001, 1, 1, certainty=0.5)])
    assert flight.fly_to(Phase.LANDED).executive.tally.zone_id == 1


def test_in_an_emergency_a_survey_s_zone_will_do_when_nothing_else_is_known() -> None:
    flight = Flight([], auto=False)
    flight.prior_zones = [zone(100_002, 60, 0, certainty=0.5), zone(100_001, 20, 0, certainty=0.5)]
    assert flight.executive.orders.land_now(flight.situation()).accepted
    flight.fly_to(Phase.APPROACH)
    assert flight.executive.tally.zone_id == 100_001
