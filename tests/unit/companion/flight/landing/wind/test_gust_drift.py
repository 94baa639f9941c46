"""Room for the drift by gusts around a point that is chosen without an order."""

import pytest

from companion.flight.geometry.wind import Wind
from companion.flight.landing.landing_wind import gust_drift_m
from tests.unit.companion.flight.landing.flight import Flight, Phase, zone

GUSTY = Wind(0.0, 5.0, 11.0, "autopilot")


def test_the_drift_is_a_tenth_of_a_second_of_what_gusts_exceed_the_mean() -> None:
    assert gust_drift_m(GUSTY) == pytest.approx(0.6)
    assert gust_drift_m(Wind(0.0, 5.0, 5.0, "tilt")) == 0.0
    assert gust_drift_m(None) == 0.0


@pytest.mark.parametrize(("wind", "east_m"), [(GUSTY, -30), (None, 30)])
def test_in_gusts_a_zone_without_room_for_the_drift_is_passed_over(wind: Wind | None, east_m: float) -> None:
    flight = Flight([zone(1, 30, 0, clearance=1.0), zone(2, -30, 0, clearance=1.2)])
    flight.wind = wind
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(east_m, abs=1)


def test_an_ordered_zone_is_landed_in_all_the_same() -> None:
    flight = Flight([zone(1, 30, 0, clearance=1.0)], auto=False)
    flight.wind = GUSTY
    flight.run(1)
    assert flight.executive.orders.land_in_zone(flight.situation(), 1).accepted
    flight.fly_to(Phase.LANDED)
