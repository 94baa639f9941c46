"""Wind in the autopilot's messages: WIND, WIND_COV and HIGH_LATENCY2."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.wind_messages import MOST_MS, ImplausibleWindError, wind_velocity_ms
from tests.unit.companion.flight.link.messages import received

NAN, INF = math.nan, math.inf


def wind(direction: float, speed: float, speed_z: float = 0.0) -> Any:
    return received(mavlink.MAVLink_wind_message(direction, speed, speed_z))


def wind_cov(north: float, east: float) -> Any:
    return received(mavlink.MAVLink_wind_cov_message(1, north, east, NAN, NAN, NAN, NAN, 0.0, 0.0))


def high_latency(speed: int, heading: int) -> Any:
    values = dict.fromkeys(mavlink.MAVLink_high_latency2_message.fieldnames, 0)
    return received(
        mavlink.MAVLink_high_latency2_message(**values | {"windspeed": speed, "wind_heading": heading})
    )


@pytest.mark.parametrize(
    ("from_deg", "towards"),
    [(0, (0, -5)), (90, (-5, 0)), (180, (0, 5)), (-90, (5, 0)), (270, (5, 0)), (-180, (0, 5))],
)
def test_wind_from_ninety_degrees_blows_to_the_west(from_deg: float, towards: tuple[float, float]) -> None:
    assert wind_velocity_ms(wind(from_deg, 5.0), ARDUPILOT) == pytest.approx(towards, abs=1e-6)


def test_wind_cov_is_the_velocity_of_the_air() -> None:
    assert wind_velocity_ms(wind_cov(3.0, -4.0), PX4) == (-4.0, 3.0)


@pytest.mark.parametrize(("autopilot", "towards"), [(ARDUPILOT, (-6, 0)), (PX4, (6, 0))])
def test_the_heading_of_high_latency_is_from_in_ardupilot_and_towards_in_px4(
    autopilot: Autopilot, towards: tuple[float, float]
) -> None:
    assert wind_velocity_ms(high_latency(30, 45), autopilot) == pytest.approx(towards, abs=1e-6)


@pytest.mark.parametrize(
    "message", [wind(0, 0), wind_cov(NAN, 1), wind_cov(1, NAN), wind_cov(0, 0), high_latency(0, 90)]
)
def test_not_a_number_in_wind_cov_and_exactly_no_wind_are_unknown(message: Any) -> None:
    assert wind_velocity_ms(message, PX4) is None


@pytest.mark.parametrize(
    "message",
    [
        *(
            wind(NAN, 3),
            wind(90, NAN),
            wind(90, INF),
            wind(INF, 3),
            wind(90, -3),
            wind(90, 200),
            wind(1e9, 3),
        ),
        *(wind(90, MOST_MS + 1), wind_cov(INF, 0), wind_cov(0, -INF), wind_cov(60, 60)),
    ],
)
def test_numbers_that_no_wind_has_are_refused(message: Any) -> None:
    with pytest.raises(ImplausibleWindError):
        wind_velocity_ms(message, ARDUPILOT)
