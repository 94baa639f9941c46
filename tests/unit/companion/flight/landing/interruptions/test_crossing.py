"""What moves towards the point shortly before the touchdown."""

from __future__ import annotations

import numpy as np
import pytest

from slz import MovingObject
from tests.unit.companion.flight.landing.flight import Flight, Phase, PointState, zone

PERSON = {"radius_m": 0.3, "height_m": 1.7}
CAR = {"radius_m": 2.2, "height_m": 1.5}


def crosser(
    flight: Flight, at_s: float, beside_m: float = 0.0, speed_ms: float = 1.5, **size: float
) -> MovingObject:
    """Return an object that passes the zone's point at a time, so far beside it."""
    size = size or PERSON
    start = np.array([5.0 + beside_m, 5.0 - speed_ms * (at_s - flight.time_s)])
    return MovingObject(
        1, flight.now_ns, start, np.array([0.0, speed_ms]), size["radius_m"], size["height_m"]
    )


def landing(passes_s: float, beside_m: float = 0.0, below_m: float = 4.0, **size: float) -> Flight:
    """Return a landing in which something passes some seconds after the vehicle came below a height."""
    flight = Flight([zone(1, 5, 5)], height=20.0)
    flight.fly_to(Phase.FINAL).until(lambda f: f.position[2] < below_m)
    at_s = flight.time_s + passes_s
    flight.moving = lambda f: (crosser(f, at_s, beside_m, **size),)
    return flight


def test_for_who_crosses_it_waits_above_the_point_and_lands_then() -> None:
    flight = landing(4.0)
    flight.until(lambda f: any("person crossing: waiting" in text for text in f.texts))
    flight.run(1.5)
    assert flight.executive.phase is Phase.DESCEND
    height_m = flight.position[2]
    flight.run(2.0)
    assert flight.position[2] > height_m - 0.2
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    assert np.hypot(*(flight.position[:2] - 5.0)) < 1


def test_who_stays_there_is_waited_for_a_while_only() -> None:
    flight = landing(0.0, speed_ms=0.01)
    flight.fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["object of 1.7 m moves in"]
    waited = sum("crossing: waiting" in text for text in flight.texts)
    assert waited == 1


def test_the_ground_may_be_unsafe_while_somebody_is_on_it_and_some_seconds_after() -> None:
    flight = Flight([zone(1, 5, 5)], height=20.0)
    flight.fly_to(Phase.DESCEND).until(lambda f: f.position[2] < 16)
    passes_s = flight.time_s + 2.0
    flight.moving = lambda f: (crosser(f, passes_s),)
    crosses = (passes_s - 1.5, passes_s + 3.0)
    flight.state = lambda _height, _point: (
        PointState.UNSAFE if crosses[0] < flight.time_s < crosses[1] else PointState.SAFE
    )
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    assert any("person crossing" in text for text in flight.texts)


def test_the_map_may_show_somebody_who_has_left_and_whose_track_is_lost() -> None:
    """A map is as old as its window."""
    flight = Flight([zone(1, 5, 5)], height=20.0)
    flight.fly_to(Phase.DESCEND).until(lambda f: f.position[2] < 16)
    passes_s = flight.time_s + 4.0
    flight.moving = lambda f: (crosser(f, passes_s),) if f.time_s < passes_s + 1.5 else ()
    shown = (passes_s + 2.2, passes_s + 3.7)
    flight.state = lambda _height, _point: (
        PointState.UNSAFE if shown[0] < flight.time_s < shown[1] else PointState.SAFE
    )
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_what_stands_on_the_ground_after_somebody_left_breaks_the_landing_off() -> None:
    flight = Flight([zone(1, 5, 5)], height=20.0)
    flight.fly_to(Phase.DESCEND).until(lambda f: f.position[2] < 16)
    passes_s = flight.time_s + 2.0
    flight.moving = lambda f: (crosser(f, passes_s),)
    flight.state = lambda _height, _point: (
        PointState.UNSAFE if flight.time_s > passes_s - 1.5 else PointState.SAFE
    )
    flight.fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["point unsafe"]
    assert flight.time_s < passes_s + 17.0


def test_a_person_does_not_make_it_wait_for_a_vehicle_beside_him() -> None:
    flight = landing(4.0)
    at_s = flight.time_s + 4.0
    flight.having(moving=lambda f: (crosser(f, at_s), crosser(f, at_s, **CAR))).fly_to(Phase.CLIMB)
    assert not any("waiting" in text for text in flight.texts)


def test_below_two_metres_over_a_head_it_climbs() -> None:
    tall = {"radius_m": 0.5, "height_m": 3.1}
    flight = landing(4.0, below_m=4.0, **tall).fly_to(Phase.CLIMB)
    assert not any("waiting" in text for text in flight.texts)


def test_people_who_keep_coming_are_waited_for_a_minute_in_all() -> None:
    flight = landing(4.0)
    flight.moving = lambda f: (crosser(f, f.time_s + 4.0),) if f.time_s % 10 < 7 else ()
    began_s = flight.time_s
    flight.fly_to(Phase.CLIMB)
    assert flight.time_s - began_s < 100
    assert flight.executive.tally.abort_reasons == ["object of 1.7 m moves in"]


def test_a_vehicle_breaks_the_landing_off_and_the_point_is_tried_again() -> None:
    flight = landing(4.0, **CAR).fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["object of 1.5 m moves in"]
    flight.having(moving=lambda _: ()).fly_to(Phase.LANDED)
    assert np.hypot(*(flight.position[:2] - 5.0)) < 1


@pytest.mark.parametrize(("passes_s", "beside_m"), [(-4.0, 0.0), (25.0, 0.0), (4.0, 4.0)])
def test_who_passes_before_after_or_beside_does_not(passes_s: float, beside_m: float) -> None:
    assert landing(passes_s, beside_m).fly_to(Phase.LANDED).executive.tally.aborts == 0


@pytest.mark.parametrize(("beside_m", "size", "gives"), [(2.5, PERSON, 1), (4.1, CAR, 0), (3.7, CAR, 1)])
def test_people_keep_a_larger_berth_than_cars(beside_m: float, size: dict[str, float], gives: int) -> None:
    """1.5 m to the middle of a person, 0.7 m to a car; the footprint has 1 m."""
    flight = landing(4.0, beside_m, **size)
    flight.until(lambda f: f.executive.phase in (Phase.CLIMB, Phase.LANDED))
    waits = sum("crossing: waiting" in text for text in flight.texts)
    assert flight.executive.tally.aborts + waits == gives


def test_the_point_is_given_up_after_three_and_an_emergency_gives_way_once() -> None:
    """Children play around it: they would be there at every touchdown."""
    flight = Flight([zone(1, 5, 5), zone(2, 60, 5)], height=20.0)
    flight.moving = lambda f: (crosser(f, f.time_s + 4.0, **CAR),) if f.position[0] < 30 else ()
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 3
    assert flight.position[0] > 50

    urgent = Flight([zone(1, 5, 5)], height=20.0, auto=False)
    urgent.moving = lambda f: (crosser(f, f.time_s + 4.0),)
    urgent.run(1.0)
    assert urgent.executive.orders.land_now(urgent.situation()).accepted
    urgent.fly_to(Phase.LANDED)
    assert urgent.executive.tally.aborts == 1


def test_another_reason_does_not_keep_the_point() -> None:
    flight = landing(4.0, below_m=6.0)
    flight.state = lambda height, _point: PointState.UNSAFE if height < 5 else PointState.SAFE
    flight.fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["point unsafe"]
    assert len(flight.executive.progress.refused) == 1


def test_high_over_the_point_it_is_waited_and_below_commit_height_it_lands() -> None:
    high = landing(4.0, below_m=9.0).run(1.0)
    assert high.executive.tally.aborts == 0
    assert landing(1.5, below_m=1.4).fly_to(Phase.LANDED).executive.tally.aborts == 0
