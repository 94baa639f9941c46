"""Unit and epoch of point times, inferred over a recording and robust to garbage."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from companion.flight.sensors.decoders.point_clock import PointClock
from companion.flight.sensors.decoders.point_cloud import Decoded, StampedCloud, clock_of, decode

BEGIN_NS = 1_750_000_000_000_000_000
PERIOD_NS = 100_000_000
N = 60
AFTER_NS = np.linspace(0, 0.97 * PERIOD_NS, N).round()

Times = Callable[[np.ndarray, int], np.ndarray]  # of nanoseconds after a stamp


def cloud(
    stamp_ns: int, times: np.ndarray, field: str = "time", form: str = "f8", points: np.ndarray | None = None
) -> StampedCloud:
    table = np.zeros(len(times), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), (field, "<" + form)])
    places = np.arange(3.0 * len(times)).reshape(-1, 3) + 1 if points is None else points
    for k, axis in enumerate("xyz"):
        table[axis] = places[:, k]
    table[field] = times
    return StampedCloud(stamp_ns, "lidar", table)


def recording(
    times: Times, form: str = "f8", field: str = "time", period_ns: int = PERIOD_NS, count: int = 20
) -> list[StampedCloud]:
    stamps = [BEGIN_NS + k * period_ns for k in range(count)]
    return [cloud(stamp, times(AFTER_NS, stamp), field, form) for stamp in stamps]


def decoded(clouds: Sequence[StampedCloud], which: int = 3) -> Decoded:
    clock = clock_of(clouds)
    known = clock if isinstance(clock, PointClock) else None
    return decode(clouds[which].table, clouds[which].stamp_ns, known)


def check_times(found: Decoded, stamp_ns: int, within_ns: float) -> None:
    assert found.timed
    np.testing.assert_allclose(found.returns.stamp_ns - stamp_ns, AFTER_NS, atol=within_ns)


UNITS: dict[str, tuple[str, str, Times, float]] = {
    "seconds": ("time", "f4", lambda after, _: after * 1e-9, 10),
    "seconds that end with the stamp": ("time", "f4", lambda after, _: (after - PERIOD_NS) * 1e-9, 10),
    "milliseconds": ("time", "f4", lambda after, _: after * 1e-6, 10),
    "microseconds": ("time", "f4", lambda after, _: after * 1e-3, 10),
    "whole microseconds": ("t", "u4", lambda after, _: np.round(after * 1e-3), 501),
    "whole microseconds, signed": ("t", "i4", lambda after, _: np.round(after * 1e-3), 501),
    "whole milliseconds": ("t", "u2", lambda after, _: np.round(after * 1e-6), 500_001),
    "whole milliseconds in a byte": ("t", "u1", lambda after, _: np.round(after * 1e-6), 500_001),
    "nanoseconds": ("offset_time", "u4", lambda after, _: after, 1),
    "nanoseconds in a float": ("time", "f4", lambda after, _: after, 10),
    "shares of the sweep": ("time", "f4", lambda after, _: after / (0.97 * PERIOD_NS), 0.031 * PERIOD_NS),
    "seconds since 1970": ("timestamp", "f8", lambda after, at: (at + after) * 1e-9, 500),
    "milliseconds since 1970": ("timestamp", "f8", lambda after, at: (at + after) * 1e-6, 500),
    "microseconds since 1970": ("timestamp", "f8", lambda after, at: (at + after) * 1e-3, 500),
    "nanoseconds since 1970": ("timestamp", "f8", lambda after, at: at + after, 500),
}


@pytest.mark.parametrize(("field", "form", "times", "within_ns"), UNITS.values(), ids=UNITS)
def test_the_unit_of_times_is_told_by_the_span_of_a_cloud(
    field: str, form: str, times: Times, within_ns: float
) -> None:
    clouds = recording(times, form, field)
    found = decoded(clouds)
    ends = times(AFTER_NS, BEGIN_NS)[0] < 0
    check_times(found, clouds[3].stamp_ns - PERIOD_NS * ends, within_ns)
    assert (found.false_times, found.no_return) == (0, 0)


def test_times_that_count_from_a_simulation_s_start_are_since_the_stamp() -> None:
    clouds = [cloud(k * PERIOD_NS, AFTER_NS * 1e-9) for k in range(1, 20)]
    check_times(decoded(clouds), clouds[3].stamp_ns, 10)


@pytest.mark.parametrize("later_s", [60, 31_536_000, 1_750_000_000])
def test_a_clock_that_is_set_between_the_clouds_examined_changes_no_unit(later_s: int) -> None:
    """Over decades, nanoseconds would pass for seconds."""
    stamps = [BEGIN_NS + k * PERIOD_NS - later_s * 10**9 * (k < 5) for k in range(10)]
    clouds = [cloud(stamp, AFTER_NS, "offset_time", "u4") for stamp in stamps]
    clock = clock_of(clouds)
    assert isinstance(clock, PointClock)
    assert (clock.unit, clock.absolute) == ("ns", False)
    check_times(decoded(clouds), clouds[3].stamp_ns, 1)


def test_a_thinned_recording_keeps_its_unit() -> None:
    """Of ten clouds one is left, a tenth of the time between them."""
    clouds = recording(lambda after, _: after * 1e-6, "f4", period_ns=10 * PERIOD_NS)
    check_times(decoded(clouds), clouds[3].stamp_ns, 10)


def test_two_sensors_on_one_topic_keep_their_unit() -> None:
    stamps = [BEGIN_NS + k * PERIOD_NS + late for k in range(20) for late in (0, 2_000_000)]
    clouds = [cloud(stamp, AFTER_NS * 1e-9) for stamp in stamps]
    check_times(decoded(clouds), clouds[3].stamp_ns, 10)


def test_the_first_field_whose_times_are_understood_is_taken() -> None:
    clouds = []
    for plain in recording(lambda after, _: after * 0.0):
        table = np.zeros(N, [*plain.table.dtype.descr, ("timestamp", "<f8")])
        for name in plain.table.dtype.names or ():
            table[name] = plain.table[name]
        table["timestamp"] = (plain.stamp_ns + AFTER_NS) * 1e-9
        clouds.append(StampedCloud(plain.stamp_ns, "lidar", table))
    check_times(decoded(clouds), clouds[3].stamp_ns, 500)


UNKNOWN: dict[str, tuple[str, Times, str]] = {
    "all the same": ("f4", lambda after, _: after * 0, "all points of a cloud have one time"),
    "seconds since 1970 in too few digits": ("f4", lambda after, at: (at + after) * 1e-9, "one time"),
    "eight sweeps long": ("f8", lambda after, _: 8 * after * 1e-9, "cannot be told by its span"),
    "not finite": ("f8", lambda after, _: after * np.nan, "no times"),
    "garbage": (
        "f8",
        lambda after, _: np.where(np.arange(N) % 2, 1e300, after),
        "cannot be told by its span",
    ),
    "since the sensor's start": ("f8", lambda after, at: (at - BEGIN_NS + after) * 1e-9 + 99, "neither from"),
    "GPS time": ("f8", lambda after, at: (at + after) * 1e-9 - 315_964_782, "counts neither from 1970"),
}


@pytest.mark.parametrize(("form", "times", "why"), UNKNOWN.values(), ids=UNKNOWN)
def test_what_times_mean_is_not_guessed(form: str, times: Times, why: str) -> None:
    clouds = recording(times, form)
    verdict = clock_of(clouds)
    assert isinstance(verdict, str)
    assert why in verdict
    found = decoded(clouds)
    assert not found.timed
    assert len(found.returns) == N
    assert (found.returns.stamp_ns == clouds[3].stamp_ns).all()


def test_shares_of_sweeps_that_come_now_and_then_are_not_used() -> None:
    rng = np.random.default_rng(1)
    stamps = BEGIN_NS + np.cumsum(rng.uniform(0.02, 0.4, 20) * 1e9).astype(np.int64)
    clouds = [cloud(int(stamp), AFTER_NS / AFTER_NS[-1]) for stamp in stamps]
    assert "cannot be told" in str(clock_of(clouds))
    assert "cannot be told" in str(clock_of(clouds[:1]))


MISSING: dict[str, tuple[Any, float]] = {
    "NaN with time 0": (np.nan, 0.0),
    "NaN with time NaN": (np.nan, np.nan),
    "zeros with time 0": (0.0, 0.0),
    "zeros with a time of nowhere": (0.0, 1e300),
}


@pytest.mark.parametrize(("place", "time"), MISSING.values(), ids=MISSING)
@pytest.mark.parametrize("every", [2, 60])
def test_points_without_a_return_have_no_say_in_the_times(place: float, time: float, every: int) -> None:
    absent = np.arange(N) % every == 1
    clouds = []
    for plain in recording(lambda after, at: (at + after) * 1e-9, field="timestamp"):
        times = np.where(absent, time, plain.table["timestamp"])
        places = np.ones((N, 3))
        places[absent] = place
        clouds.append(cloud(plain.stamp_ns, times, "timestamp", points=places))
    found = decoded(clouds)
    assert found.timed
    assert (found.no_return, found.false_times) == (absent.sum(), 0)
    wanted = AFTER_NS[~absent]
    np.testing.assert_allclose(found.returns.stamp_ns - clouds[3].stamp_ns, wanted, atol=500)


@pytest.mark.parametrize("wrong", [3_604_361_924.0, 1e300, np.nan, -5e9, np.inf])
def test_garbage_in_some_times_costs_those_points(wrong: float) -> None:
    bad = np.isin(np.arange(N), (7, 40))
    clouds = recording(lambda after, _: np.where(bad, wrong, after))
    found = decoded(clouds)
    assert (found.false_times, found.no_return) == (2, 0)
    np.testing.assert_array_equal(found.returns.stamp_ns - clouds[3].stamp_ns, AFTER_NS[~bad])
    np.testing.assert_array_equal(found.returns.xyz_sensor_m[:, 0], clouds[3].table["x"][~bad])


def test_a_cloud_with_times_of_another_clock_than_the_others_has_its_stamp() -> None:
    clouds = recording(lambda after, at: (at + after) * 1e-9)
    strange = cloud(clouds[3].stamp_ns, (clouds[3].stamp_ns + AFTER_NS) * 1e-9 + 37)
    mostly = cloud(clouds[4].stamp_ns, np.where(np.arange(N) % 3, np.nan, clouds[4].table["time"]))
    clouds[3:5] = [strange, mostly]
    for which in (3, 4):
        found = decoded(clouds, which)
        assert not found.timed
        assert (found.returns.stamp_ns == clouds[which].stamp_ns).all()
    check_times(decoded(clouds, 5), clouds[5].stamp_ns, 500)
