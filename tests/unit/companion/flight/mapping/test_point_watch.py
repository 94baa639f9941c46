"""Watch over the selected point of a landing: from scans to one event, until a window has judged it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import params
from companion.flight.mapping.point_watch import HELD_NS, PointWatch
from companion.flight.mapping.window_pace import LEAST, SHARE, WindowPace
from slz import LocalFrame, Pipeline, Report, Scan, Window

FRAME = LocalFrame(47.0, 8.0, 400.0)
SENSOR = np.array([0.0, 0.0, 12.0])
S = 1_000_000_000


def ground(count: int) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.column_stack([rng.uniform(-12, 12, (count, 2)), rng.normal(0, 0.02, count)])


def report(east_m: float = 0.0) -> Report:
    """Return a report on level ground with a selected point."""
    pipeline = Pipeline(params.build({"zone_m": 60.0, "adaptive": "off"}))
    for start_ns in (0, S):
        points = ground(40_000)
        stamps = np.linspace(start_ns, start_ns + 0.9 * S, len(points)).astype(np.int64)
        found = pipeline.process(Window(points, stamps, SENSOR, FRAME, int(stamps[0]), int(stamps[-1])))
        pipeline.select(np.array([east_m, 0.0, 0.0]))
    return found


def scan(at_ns: int, *, person: bool) -> Scan:
    points = ground(4000)
    if person:
        points[:10] = (0.3, 0.2, 1.7)
    return Scan(points, np.full(len(points), at_ns), SENSOR, FRAME)


def test_an_intruder_is_one_event_and_is_held_until_a_window_judged_it() -> None:
    watch, events = PointWatch(0.01), []
    watch.on_intrusion.subscribe(lambda: events.append(1))
    watch.use_report(report())
    watch.add(scan(2 * S, person=False), 2 * S)
    assert watch.intrusion(2 * S) is None
    for k in range(4):
        watch.add(scan(3 * S + k * S // 20, person=True), 3 * S + k * S // 20)
    last_ns = 3 * S + 3 * S // 20
    assert len(events) == 1
    found = watch.intrusion(last_ns)
    assert found is not None
    assert abs(found.height_m - 1.7) < 0.1
    assert watch.intrusion(last_ns + HELD_NS - 1) is not None
    assert watch.intrusion(last_ns + HELD_NS) is None


def test_another_point_another_map_and_no_report_forget_it() -> None:
    first, other = report(), report(east_m=4.0)
    for change in (lambda w: w.use_report(other), lambda w: w.forget(),
                   lambda w: w.use_report(replace(first, selected=None))):  # fmt: skip
        watch = PointWatch(0.01)
        watch.add(scan(2 * S, person=True), 2 * S)
        assert watch.intrusion(2 * S) is None
        watch.use_report(first)
        watch.add(scan(2 * S, person=True), 2 * S)
        assert watch.intrusion(2 * S) is not None
        change(watch)
        assert watch.intrusion(2 * S) is None


# Windows longer on a slow computer.


def paced(
    fixed_s: float,
    per_s: float,
    *own: str,
    longest_s: float = 2.0,
    n: int = 200,
    alone: Callable[[float], float] = lambda _: 0.0,
) -> WindowPace:
    """The pace after windows that take so long to compute, whatever they hold, and for each second of it."""
    pace = WindowPace(params.load("quadcopter", list(own)))
    for _ in range(n):
        pace.follow(fixed_s + per_s * pace.window_s, longest_s, alone(pace.window_s))
    return pace


@pytest.mark.parametrize("window_s", [0.1, 1.0])
def test_a_computer_that_is_fast_enough_makes_windows_as_short_as_wanted(window_s: float) -> None:
    pace = paced(0.002, 0.05, f"window_s={window_s}")
    assert pace.window_s == pytest.approx(LEAST * window_s)


@pytest.mark.parametrize(("dense_s", "expected_s"), [(0.01, 0.1), (0.4, 0.4), (7.0, 1.0)])
def test_windows_are_so_long_that_half_of_the_returns_have_others_near(
    dense_s: float, expected_s: float
) -> None:
    """Up to the parameter: a sensor of few returns has none near even then."""
    pace = paced(0.002, 0.05, alone=lambda span_s: 1 / (1 + span_s / dense_s))
    assert pace.window_s == pytest.approx(expected_s, rel=0.02)


@pytest.mark.parametrize(("fixed_s", "per_s"), [(0.6, 0.0), (0.5, 0.1), (0.3, 0.2)])
def test_a_slower_one_makes_them_so_long_that_it_computes_for_no_more_than_its_share(
    fixed_s: float, per_s: float
) -> None:
    assert paced(fixed_s, per_s).window_s == pytest.approx(fixed_s / (SHARE - per_s), rel=0.01)


def test_no_window_is_longer_than_suits_the_flight() -> None:
    assert paced(0.5, 0.3, longest_s=0.5).window_s == 0.5


@pytest.mark.parametrize("fixed", ["adaptive=off", "mode=source"])
def test_fixed_windows_stay_as_they_are(fixed: str) -> None:
    assert paced(0.9, 0.3, fixed, "window_s=0.8").window_s == 0.8
