"""Mean and gust of a wind."""

import math

import numpy as np
import pytest

from companion.flight.fusion.wind_estimate import WindAverage
from companion.flight.geometry.wind import Wind

S = 1_000_000_000


def blown(*speeds_ms: float, east: float = -1.0, north: float = 0.0) -> WindAverage:
    """Return the average of one wind a second."""
    average = WindAverage("tilt")
    for second, speed in enumerate(speeds_ms):
        average.add(speed * np.array([east, north]), second * S)
    return average


def at_end(average: WindAverage, seconds: float) -> Wind:
    wind = average.at(round(seconds * S))
    assert wind is not None
    return wind


def test_a_steady_wind_is_its_mean_and_its_gust_and_comes_from_behind_its_motion() -> None:
    wind = at_end(blown(*[6.0] * 40), 39)
    assert (wind.speed_ms, wind.gust_ms) == pytest.approx((6.0, 6.0))
    assert math.degrees(wind.from_rad) == pytest.approx(90)
    np.testing.assert_allclose(wind.towards_enu_ms, [-6.0, 0.0], atol=1e-9)


def test_it_is_unknown_in_the_first_five_seconds_and_five_after_the_last() -> None:
    average = blown(*[6.0] * 6)
    assert blown(*[6.0] * 5).at(4 * S) is None
    assert average.at(5 * S) is not None
    assert average.at(10 * S) is not None
    assert average.at(10 * S + 1) is None


def test_all_of_a_short_time_counts_alike_and_thirty_seconds_of_a_long_one() -> None:
    assert at_end(blown(*[2.0] * 5, *[8.0] * 5), 9).speed_ms == pytest.approx(5.0, abs=0.7)
    long = at_end(blown(*[2.0] * 200, *[8.0] * 30), 229)
    assert long.speed_ms == pytest.approx(8.0 - 6.0 * math.exp(-1), abs=0.2)


def test_the_gust_is_the_greatest_of_the_last_minute() -> None:
    speeds = [5.0] * 20 + [11.0] + [5.0] * 100
    assert at_end(blown(*speeds[:70]), 69).gust_ms == 11.0
    assert at_end(blown(*speeds), 120).gust_ms == pytest.approx(5.0, abs=0.5)


def test_a_gap_or_a_clock_that_goes_back_begins_anew() -> None:
    for later in (100, 2):
        average = blown(*[9.0] * 20)
        for second in range(later, later + 8):
            average.add(np.array([0.0, -3.0]), second * S)
        assert at_end(average, later + 7).speed_ms == pytest.approx(3.0)
        assert at_end(average, later + 7).gust_ms == pytest.approx(3.0)
