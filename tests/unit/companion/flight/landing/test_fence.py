"""Points, ways, search and heights inside the autopilot's fence."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import params
from companion.flight.geometry.geofence import Boundary, Geofence
from companion.flight.landing.situation import Phase
from companion.flight.landing.ways.way_choice import paths
from slz import SAFE, UNSAFE, PointState, SurfaceHere, SurfaceKind
from tests.unit.companion.flight.landing.flight import Flight, zone
from tests.unit.companion.flight.landing.ways.corridors import made

MARGIN_M = 4.0
NEAR, FAR = zone(1, 10, 0), zone(2, 33, 0)
ROOF = SurfaceHere(SurfaceKind.ROOF, 0.99, 0.0, 20.0)


def circle(radius_m: float, **more: object) -> Geofence:
    return Geofence(Boundary(np.zeros((1, 2)), radius_m, True), margin_m=MARGIN_M, **more)  # type: ignore[arg-type]


def wall(east_m: float) -> Geofence:
    """An area of exclusion across the way to the east, 4 m thick and 100 m long."""
    corners = np.array([(east_m, -50), (east_m + 4, -50), (east_m + 4, 50), (east_m, 50)], float)
    return Geofence(areas=(Boundary(corners, 0.0, False),), margin_m=MARGIN_M)


def least_room_m(flight: Flight, fence: Geofence) -> float:
    """Return the least room within a fence that the vehicle had in the next two minutes."""
    rooms = []
    for _ in range(1200):
        flight.step()
        rooms.append(float(fence.room_m(flight.position)[0]))
    return min(rooms)


# ---- orders ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fence", "reason"),
    [
        (circle(25), "zone 2 beyond the fence"),
        (circle(36), "zone 2 beyond the fence"),  # inside, and nearer to it than the margin
        (wall(16), "way to zone 2 beyond the fence"),
        (Geofence(lowest_m=12.0), "zone 2 beyond the fence"),  # it cannot sink to where LAND takes over
        (circle(40), "landing"),
        (Geofence(), "landing"),
    ],
)
def test_an_order_to_a_zone_beyond_the_fence_is_refused(fence: Geofence, reason: str) -> None:
    flight = Flight([NEAR, FAR], auto=False)
    flight.having(fence=fence).step()
    reply = flight.executive.orders.land_in_zone(flight.situation(), 2)
    assert (reply.accepted, reply.reason) == (reason == "landing", reason)
    assert len(f"SLZ: {reply.reason}") <= 50


def test_an_order_to_a_point_and_the_confirmation_of_a_selection_are_refused_too() -> None:
    flight = Flight([NEAR], auto=False)
    flight.having(fence=circle(25)).step()
    point = np.array([0.0, 33.0, 0.0])
    assert flight.executive.orders.land_at_point(flight.situation(), point).reason == "point beyond the fence"
    assert flight.executive.orders.select_point(point).accepted  # it is only watched
    flight.run(1)
    assert flight.executive.orders.land_at_selected(flight.situation()).reason == "point beyond the fence"
    assert flight.executive.phase is Phase.IDLE


# ---- choices --------------------------------------------------------------------------------------


@pytest.mark.parametrize("urgent", [False, True])
def test_a_zone_beyond_the_fence_is_never_chosen(urgent: bool) -> None:
    flight = Flight([FAR, zone(3, -12, 4, certainty=0.97)], auto=not urgent)
    flight.having(fence=circle(25)).run(1)
    if urgent:
        assert flight.executive.orders.land_now(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert np.hypot(*(flight.position[:2] - [-12, 4])) < 1


def test_zones_of_the_far_map_and_of_a_survey_are_left_out_too() -> None:
    flight = Flight([])
    flight.having(far_zones=[FAR], prior_zones=[replace(FAR, id=100_001)], fence=circle(25)).run(60)
    assert flight.executive.phase is Phase.SURVEY
    assert flight.executive.emergency(flight.situation()) is None


def test_the_pilot_reads_which_zone_is_beyond_the_fence_each_half_minute() -> None:
    flight = Flight([FAR, replace(FAR, id=7)])
    flight.having(fence=circle(25)).run(70)
    said = [text for text in flight.texts if "fence" in text]
    assert said == ["SLZ: zone 2 beyond the fence"] * 3
    flight.having(fence=Geofence()).fly_to(Phase.LANDED)


def test_a_roof_beyond_the_fence_is_not_asked_for() -> None:
    flight = Flight([zone(4, 33, 0, surface=ROOF)])
    flight.having(fence=circle(25)).run(40)
    assert not any("confirm" in text for text in flight.texts)


@pytest.mark.parametrize("phase", [Phase.APPROACH, Phase.DESCEND, Phase.FINAL])
def test_a_fence_that_is_drawn_around_less_breaks_the_landing_off(phase: Phase) -> None:
    flight = Flight([zone(1, 16, 0), zone(3, -6, 0, certainty=0.97)]).fly_to(phase)
    flight.having(fence=circle(18)).until(lambda f: f.executive.phase is Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["point beyond the fence"]
    flight.fly_to(Phase.LANDED)
    assert abs(flight.position[0] + 6) < 1


def test_the_cost_of_a_step_does_not_grow_with_the_zones_beyond(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each point asked for costs up to half a millisecond, in the loop that sends the setpoints."""
    asked, room_m = [], Geofence.room_m

    def counted(self: Geofence, places_m: np.ndarray) -> np.ndarray:
        asked.append(len(np.atleast_2d(places_m)))
        return room_m(self, places_m)

    monkeypatch.setattr(Geofence, "room_m", counted)
    flight = Flight([zone(k, 40 + k, 0) for k in range(1, 65)])
    flight.prior_zones = [zone(100_000 + k, 40 + k, 9) for k in range(1, 1001)]
    flight.having(fence=circle(25)).run(10)
    asked.clear()
    flight.step()
    situation = flight.situation()
    assert flight.executive.emergency(situation) is None
    assert len(flight.executive.zones_beyond_fence(situation)) == 1064
    assert len(asked) < 12


def test_a_way_is_judged_as_by_all_its_places() -> None:
    rng, judged = np.random.default_rng(5), []
    triangle = Boundary(np.array([(0, 0), (40, 5), (20, 30)], float), 0.0, False)
    fence = Geofence(Boundary(np.zeros((1, 2)), 70.0, True), (triangle,), margin_m=MARGIN_M)
    for begin, end in rng.uniform(-80, 80, (300, 2, 2)):
        rooms = fence.room_m(begin + np.linspace(0, 1, 4000)[:, None] * (end - begin))
        left_m = rooms.min() - min(0.0, rooms[0])
        if left_m >= 0 or left_m < -0.2:
            judged.append(bool(left_m >= 0))
            assert fence.holds_way(begin, end) is judged[-1]
    assert 50 < sum(judged) < len(judged) - 50


# ---- ways -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("fence", [circle(30), wall(10), wall(-12)])
def test_the_search_stays_inside(fence: Geofence) -> None:
    assert least_room_m(Flight([], height=20.0), fence) < -1
    flight = Flight([], height=20.0).having(fence=fence)
    assert least_room_m(flight, fence) >= -0.5
    assert np.ptp([c.velocity_enu_ms[0] for *_, c in flight.commands if c.velocity_enu_ms is not None]) > 1


def test_a_search_without_a_corner_inside_hovers() -> None:
    flight = Flight([], height=20.0)
    flight.having(fence=circle(3)).run(30)
    assert float(np.hypot(*flight.position[:2])) < 1


def test_a_look_from_aside_stays_inside() -> None:
    flight = Flight([zone(1, 10, 0)], height=20.0)
    flight.surface = lambda _point: SurfaceHere(SurfaceKind.BARE, 0.95, 0.05)
    flight.having(fence=circle(22)).until(lambda f: any("looking from aside" in text for text in f.texts))
    assert least_room_m(flight, flight.fence) >= -0.5


def test_a_path_that_begins_beyond_the_fence_is_left_out() -> None:
    p = params.load("helicopter")
    free = paths(made(), p, least_state=int(SAFE), route_over_point_m=60.0)
    fenced = paths(made(), p, least_state=int(SAFE), route_over_point_m=60.0, fence=wall(20))
    assert {path.bearing_deg for path in fenced} < {path.bearing_deg for path in free}
    assert not any(60 < path.bearing_deg < 120 for path in fenced)
    assert any(240 < path.bearing_deg < 300 for path in fenced)


def test_the_way_out_below_something_leads_away_from_the_fence() -> None:
    flight = Flight([zone(1, 0, 0)], height=20.0).having(corridors=lambda _flight: made())
    flight.until(lambda f: f.executive.phase is Phase.FINAL and f.position[2] < 6)
    flight.zones.clear()
    flight.state = lambda _height, _point: PointState.UNSAFE
    clear = {(90, 60.0): int(SAFE), (270, 30.0): int(SAFE)}
    flight.corridors = lambda _flight: made(clear, all_of=int(UNSAFE))
    flight.fence = wall(MARGIN_M + 1)
    flight.blocked_above = lambda f: bool(abs(f.position[0]) < 3 and 6 < f.position[2] < 10)
    flight.fly_to(Phase.SURVEY)
    assert flight.position[0] < -2


@pytest.mark.parametrize(
    ("position", "asked", "limited"),
    [
        ((0, 0, 20), (0, 0, 2), (0, 0, 2)),
        ((0, 0, 39.5), (0, 0, 2), (0, 0, 1)),
        ((0, 0, 41), (0, 0, 2), (0, 0, 0)),
        ((0, 0, 41), (0, 0, -2), (0, 0, -2)),
        ((0, 0, 5.5), (0, 0, -2), (0, 0, -1)),
        ((0, 0, 4), (0, 0, -2), (0, 0, 0)),
        ((0, 0, 4), (0, 0, 2), (0, 0, 2)),
        ((38, 0, 20), (5, 0, 0), (4, 0, 0)),
        ((46, 0, 20), (3, 4, 0), (0, 0, 0)),
        ((48, 0, 20), (3, 0, 1), (0, 0, 1)),
        ((48, 0, 20), (-3, 0, 0), (-3, 0, 0)),  # back
    ],
)
def test_velocities_stop_before_margin_ceiling_and_floor_and_lead_back_from_beyond(
    position: tuple[float, ...], asked: tuple[float, ...], limited: tuple[float, ...]
) -> None:
    fence = circle(50, lowest_m=5.0, highest_m=40.0)
    velocity = fence.limited(np.array(position, float), np.array(asked, float), braking_ms2=1.0)
    assert velocity == pytest.approx(limited, abs=1e-9)


# ---- heights --------------------------------------------------------------------------------------


def test_the_flight_stays_below_the_ceiling() -> None:
    flight = Flight([zone(1, 10, 0)], height=15.0, survey_height_m=40.0)
    flight.fence = Geofence(highest_m=22.0)
    tops = []

    def descends(f: Flight) -> bool:
        tops.append(float(f.position[2]))
        return f.executive.phase is Phase.FINAL

    flight.until(descends)
    assert 21 < max(tops) <= 22.01
    flight.having(state=lambda _height, _point: PointState.UNSAFE).fly_to(Phase.SURVEY)
    assert 20 < flight.position[2] <= 22.01
    assert not any("not climbing" in text for text in flight.texts)


def test_an_obstacle_is_not_climbed_over_beyond_the_ceiling() -> None:
    flight = Flight([zone(1, 40, 0), zone(2, -20, 0, certainty=0.97)], height=20.0)
    flight.fence = Geofence(highest_m=28.0)
    flight.blocked = lambda f: bool(15 < f.position[0] < 30 and f.velocity_wanted[0] > 0)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.abort_reasons == ["way blocked"]
    assert sum("climbing" in text for text in flight.texts if "ahead" in text) == 1


def test_a_vehicle_above_the_ceiling_keeps_its_height_over_ground_higher_than_home() -> None:
    flight = Flight([], height=30.0)
    flight.home_m, flight.fence = -90.0, Geofence(highest_m=-7.0)  # a hill of 90 m, a ceiling of 83 m
    flight.run(60)
    assert flight.executive.phase is Phase.SURVEY
    assert math.isclose(flight.position[2], 30.0, abs_tol=0.5)
