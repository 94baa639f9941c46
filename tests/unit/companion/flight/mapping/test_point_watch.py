"""Watch over the selected point of a landing: from scans to one event, until a window has judged it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import params
from companion.flight.mapping.point_watch import HELD_NS, PointWatch
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
