"""Look from aside at ground that may be water, before anything is decided about it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.flight.landing.looks.oblique_look import FARTHEST_M, LOOK_NS
from slz import PointState, SurfaceHere, SurfaceKind
from slz.terrain.footing import Footing
from tests.unit.companion.flight.landing.flight import Flight, Phase, zone

TEXT = "SLZ: may be water: looking from aside"
LOOK_S = LOOK_NS * 1e-9


def suspected(water: float) -> SurfaceHere:
    return SurfaceHere(SurfaceKind.BARE, 1 - water, water)


def looking(flight: Flight) -> bool:
    return TEXT in flight.texts


def over_wet_ground(water: float, height: float = 15.0, state: PointState = PointState.SAFE) -> Flight:
    """A flight over its point, which may be water."""
    flight = Flight([zone(1, 30, 0)], height=height, survey_height_m=height - 0.5)
    flight.surface = lambda _point: suspected(water)
    flight.state = lambda _height, _point: state
    return flight


def ring(flight: Flight, centre: tuple[float, float], seconds: float) -> np.ndarray:
    """Fly on; return distance from a point and bearing there, each tenth of a second."""
    track = []
    for _ in range(round(seconds * 10)):
        flight.step()
        away = flight.position[:2] - centre
        track.append((math.hypot(*away), math.degrees(math.atan2(*away)), flight.position[2]))
    return np.array(track)


@pytest.mark.parametrize("height", [12.0, 20.0])
def test_the_point_is_seen_at_45_degrees_all_along_a_ring_at_the_same_height(height: float) -> None:
    flight = over_wet_ground(0.04, height).until(looking)
    track = ring(flight, (30.0, 0.0), LOOK_S - 0.5)
    round_it = track[np.argmax(track[:, 0] > 0.85 * height) :]
    incidence_deg = np.degrees(np.arctan(round_it[:, 0] / height))
    assert 35 < incidence_deg.min() < incidence_deg.max() < 55
    assert np.ptp(np.unwrap(round_it[:, 1], period=360)) > 90
    assert np.ptp(track[:, 2]) < 0.5


@pytest.mark.parametrize(("height", "radius_m"), [(4.0, 5.0), (60.0, 25.0)])
def test_the_ring_is_neither_within_five_metres_nor_beyond_25(height: float, radius_m: float) -> None:
    flight = over_wet_ground(0.04, height).until(looking)
    track = ring(flight, (30.0, 0.0), LOOK_S - 0.5)
    assert track[:, 0].max() == pytest.approx(radius_m, abs=2.1)
    assert FARTHEST_M == 25.0


@pytest.mark.parametrize("water", [0.0, 0.02, 0.95])
def test_ground_that_is_hardly_water_and_ground_that_surely_is_take_no_look(water: float) -> None:
    flight = over_wet_ground(water).fly_to(Phase.LANDED)
    assert not looking(flight)


def test_the_landing_goes_on_after_a_look_that_leaves_the_point_safe() -> None:
    flight = over_wet_ground(0.04).fly_to(Phase.LANDED)
    assert flight.texts.count(TEXT) == 1
    assert flight.executive.tally.aborts == 0


def test_a_look_ends_when_the_suspicion_does() -> None:
    flight = over_wet_ground(0.04).until(looking)
    flight.run(4)
    flight.surface = lambda _point: suspected(0.01)
    begun_s = flight.time_s
    flight.fly_to(Phase.DESCEND)
    assert flight.time_s - begun_s < 10


def test_ground_that_stays_unknown_as_water_is_left_soon_after_the_look() -> None:
    flight = over_wet_ground(0.5, state=PointState.UNKNOWN).until(looking)
    begun_s = flight.time_s
    flight.fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["point not seen: may be water"]
    assert LOOK_S + 5 < flight.time_s - begun_s < LOOK_S + 15


def test_an_emergency_takes_no_look() -> None:
    flight = over_wet_ground(0.04).run(3)
    flight.executive.orders.land_now(flight.situation())
    flight.fly_to(Phase.LANDED)
    assert not looking(flight)


def test_a_look_into_blocked_air_ends_without_a_climb() -> None:
    flight = over_wet_ground(0.04)
    flight.blocked = lambda f: looking(f) and float(np.hypot(*f.velocity_wanted[:2])) > 1.0
    flight.fly_to(Phase.LANDED)
    assert looking(flight)
    assert not any("climbing" in text for text in flight.texts)


def test_the_closer_look_comes_after_the_one_from_aside() -> None:
    flight = over_wet_ground(0.04)
    flight.having(footing=Footing(unseen=0.2)).fly_to(Phase.LANDED)
    said = [text for text in flight.texts if "looking" in text]
    assert said == [TEXT, "SLZ: 20% of 0.3 m hazards unseen: looking closer"]


# ---- in the survey -------------------------------------------------------------------------------


def surveying(water: float, *zones: object) -> Flight:
    flight = Flight(list(zones), survey_s=5, height=20.0)  # type: ignore[arg-type]
    flight.below = suspected(water)
    return flight


def test_suspected_ground_below_is_looked_at_once_the_survey_found_no_zone() -> None:
    flight = surveying(0.3).fly_to(Phase.SURVEY).run(4)
    assert not looking(flight)
    flight.until(looking)
    centre = flight.position[:2].copy()
    track = ring(flight, tuple(centre), LOOK_S - 1)
    assert 18 < track[:, 0].max() < 22  # 20 m of height are reported
    flight.run(300)
    assert flight.texts.count(TEXT) == 3


def test_a_zone_found_meanwhile_ends_the_look() -> None:
    flight = surveying(0.3).until(looking)
    flight.run(3)
    flight.zones.append(zone(1, 30, 0))
    flight.run(0.5)
    assert flight.executive.phase is Phase.APPROACH


def test_ground_below_that_is_not_suspected_is_not_looked_at() -> None:
    flight = surveying(0.01).fly_to(Phase.SURVEY).run(40)
    assert not looking(flight)


def test_every_new_survey_may_look_again() -> None:
    flight = surveying(0.3).until(looking)
    flight.run(20)
    flight.executive.orders.abort(flight.situation())
    flight.run(3)
    flight.executive.orders.land_at_best(flight.situation())
    flight.run(3)
    assert flight.texts.count(TEXT) == 2
