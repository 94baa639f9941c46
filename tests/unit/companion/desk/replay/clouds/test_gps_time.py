"""GPS times of stored clouds: their meaning is the one that puts them into the flight."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from companion.desk.replay.gps_time import first_by_header, resolve_times

BEGIN_NS = 1_750_000_000_000_000_000
EPOCH_S, LEAP_S, WEEK_S = 315_964_800, 18, 604_800
SECONDS = np.linspace(0, 300, 601)  # of the flight
SUNDAY_S = 1_750_550_382  # since 1970: 2025-06-22 00:00:00 of GPS

Header = Literal["standard", "week"]


def span_ns(begin_s: float) -> tuple[int, int]:
    return round(begin_s * 1e9), round((begin_s + 300) * 1e9)


def written(kind: str, begin_s: float) -> np.ndarray:
    """Return the times of a flight as several writers count them."""
    gps_s = begin_s - EPOCH_S + LEAP_S + SECONDS
    return {
        "standard": gps_s - 1e9,
        "week": gps_s % WEEK_S,
        "week that runs on": gps_s - gps_s[0] // WEEK_S * WEEK_S,
        "gps": gps_s,
        "unix": begin_s + SECONDS,
    }[kind]


@pytest.mark.parametrize("begin_s", [1_750_000_000, SUNDAY_S - 150], ids=["midweek", "over the week's end"])
@pytest.mark.parametrize("header", ["standard", "week"])
@pytest.mark.parametrize("kind", ["standard", "week", "week that runs on", "gps", "unix"])
def test_every_meaning_is_found_whatever_the_header_says(kind: str, header: Header, begin_s: int) -> None:
    found = resolve_times(written(kind, begin_s), header, span_ns(begin_s))
    assert found.fits.all()
    assert found.kind == kind.split()[0]
    np.testing.assert_allclose(found.stamp_ns - begin_s * 10**9, SECONDS * 1e9, atol=500)


@pytest.mark.parametrize(
    ("day", "gps_s"),
    [
        ("2020-01-01T00:00:00", 1_261_872_018),
        ("2010-06-01T00:00:00", 959_385_615),
        ("2017-01-01T00:00:00", 1_167_264_018),
    ],
)
def test_times_of_gps_are_ahead_of_the_time_of_day_by_leap_seconds(day: str, gps_s: int) -> None:
    at_ns = int(np.datetime64(day, "ns").astype(np.int64))
    assert resolve_times(np.array([gps_s - 1e9]), "standard", (at_ns, at_ns)).stamp_ns == at_ns
    for late_s in (0, 3600):
        span = (at_ns, at_ns + late_s * 10**9)
        assert resolve_times(np.array([gps_s % 604_800.0]), "week", span).stamp_ns == at_ns


def test_times_that_do_not_fit_leave_the_others_as_they_are() -> None:
    times = written("standard", 1_750_000_000)
    strange = np.array([0.0, np.nan, np.inf, -1e300, times[0] - 3600, times[-1] + 3600])
    times[10 : 10 + len(strange)] = strange
    found = resolve_times(times, "standard", span_ns(1_750_000_000))
    assert np.flatnonzero(~found.fits).tolist() == list(range(10, 10 + len(strange)))
    assert (found.stamp_ns[~found.fits] == 0).all()
    wanted = SECONDS[found.fits] * 1e9
    np.testing.assert_allclose(found.stamp_ns[found.fits] - BEGIN_NS, wanted, atol=500)


@pytest.mark.parametrize("days", [1, 7])
@pytest.mark.parametrize("kind", ["standard", "gps", "unix"])
@pytest.mark.parametrize("header", ["standard", "week"])
def test_times_of_another_flight_fit_nowhere(kind: str, days: int, header: Header) -> None:
    times = written(kind, 1_750_000_000 - 86_400 * days)
    assert not resolve_times(times, header, span_ns(1_750_000_000)).fits.any()


def test_times_of_another_day_of_the_week_fit_nowhere() -> None:
    times = written("week", 1_750_000_000 - 86_400)
    assert not resolve_times(times, "week", span_ns(1_750_000_000)).fits.any()


def test_what_the_header_means_is_said_in_words() -> None:
    times = np.concatenate([[-np.inf, np.nan], written("standard", 1_750_000_000)])
    assert first_by_header(times, "standard", span_ns(0)) == "2025-06-15 15:06:44"  # 14 leap seconds in 1970
    assert first_by_header(times, "standard", span_ns(1_750_000_000)) == "2025-06-15 15:06:40"
    assert first_by_header(written("week", 1_750_000_000), "week", span_ns(0)) == "54418 s of a GPS week"
    assert first_by_header(np.array([1e300]), "standard", span_ns(0)) == "1e+300 s"
