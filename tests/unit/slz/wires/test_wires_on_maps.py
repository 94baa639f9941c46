"""Wires on the maps: ground below is refused, ways are blocked, and nothing becomes safer."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNKNOWN, UNSAFE, LocalFrame, Pipeline, Report, Window
from slz.grid import Box
from slz.landing_point.corridors import corridors
from slz.wires.detected_wire import SaggingCurve, Wire
from slz.wires.wire_detector import WireMarks
from tests.unit.slz.wires.worlds import Body, Catenary, approach, ground, seen, wire

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
LINE = Catenary(np.array([-25.0, 6.0, 9.0]), np.array([25.0, 6.0, 9.0]), 0.8)
WAY = approach([0.0, -6.0, 24.0], [0.0, 0.0, 14.0], 10)


def fly(bodies: list[Body], *own: str) -> tuple[Pipeline, list[Report]]:
    """Process a window from each place of the way."""
    settings = ["zone_m=60", "min_boundary_points=10", "register_m=0", "adaptive=off", *own]
    pipe, reports = Pipeline(params.load("quadcopter", settings), (0.0, 0.0)), []
    streams = [np.random.default_rng(seed) for seed in range(len(bodies))]
    for k, sensor in enumerate(WAY):
        parts = [body(rng, sensor) for body, rng in zip(bodies, streams, strict=True)]
        noise = [rng.normal(0, 0.01, part.shape) for part, rng in zip(parts, streams, strict=True)]
        parts[0][:, 2] += 0.04 * parts[0][:, 0]  # level ground may be water
        points = np.concatenate(parts) + np.concatenate(noise)
        stamps = np.full(len(points), k * 1_000_000_000, np.int64)
        rays = {"origin": np.zeros(len(points), np.uint16), "origins_enu_m": sensor[np.newaxis].copy()}
        reports.append(
            pipe.process(Window(points, stamps, sensor, FRAME, int(stamps[0]), int(stamps[0]), **rays))
        )
    return pipe, reports


def state(pipe: Pipeline) -> NDArray[np.uint8]:
    """States of the middle 48 x 48 m of the near map."""
    maps = pipe.maps(which="near")
    assert maps is not None
    row, col = maps.grid.index(-24.0, -24.0)
    return pipe.state("near", Box(row, row + 240, col, col + 240))


def with_gap(rng: np.random.Generator, sensor: Floats) -> Floats:
    """Return returns of the wire but for its middle 8 m."""
    points = wire(LINE, 0.6)(rng, sensor)
    return points[np.abs(points[:, 0]) > 4.0]


@pytest.fixture(scope="module")
def with_wire() -> tuple[Pipeline, list[Report]]:
    return fly([ground(40.0, half_m=20.0), with_gap])


@pytest.fixture(scope="module")
def without_wire() -> tuple[Pipeline, list[Report]]:
    return fly([ground(40.0, half_m=20.0)])


def test_the_report_has_the_wire_in_the_frame(with_wire: tuple[Pipeline, list[Report]]) -> None:
    _, reports = with_wire
    (one,) = reports[-1].wires
    points, _, own = one.sampled(0.5)
    assert np.abs(points[own, 2] - LINE.height_at(points[own])).max() < 0.3
    assert reports[-1].stage_ms["wires"] > 0


def test_ground_under_a_wire_is_not_safe_though_no_return_hit_there(
    with_wire: tuple[Pipeline, list[Report]], without_wire: tuple[Pipeline, list[Report]]
) -> None:
    """The line at 6 m north where nothing was hit, half a footprint to both sides; safe without the wire."""
    band = slice(round((24 + 6 - 0.8) / 0.2), round((24 + 6 + 0.8) / 0.2))
    columns = slice(round((24 - 2.5) / 0.2), round((24 + 2.5) / 0.2))
    there, free = state(with_wire[0])[band, columns], state(without_wire[0])[band, columns]
    assert (free == SAFE).mean() > 0.9
    assert not (there == SAFE).any()
    assert (there == UNSAFE).mean() > 0.9


def test_a_wire_makes_nothing_safer(
    with_wire: tuple[Pipeline, list[Report]], without_wire: tuple[Pipeline, list[Report]]
) -> None:
    before, after = state(without_wire[0]), state(with_wire[0])
    assert not ((after == SAFE) & (before == UNSAFE)).any()
    aside = np.abs((np.arange(240) + 0.5) * 0.2 - 24 - 6) > 2.5
    assert (after[aside] == before[aside]).mean() > 0.97


def test_ways_under_a_wire_are_blocked(
    with_wire: tuple[Pipeline, list[Report]], without_wire: tuple[Pipeline, list[Report]]
) -> None:
    """The wire passes 6 m north of the point: of the ways to the north those below 50 degrees meet it."""
    for pipe, blocked in ((with_wire[0], True), (without_wire[0], False)):
        pipe.select(np.array([0.0, 0.0, 0.0]))
        point = pipe.selected
        assert point is not None
        assert point.corridors is not None
        assert (point.corridors.states[0, 0] == UNSAFE) == blocked
        assert (point.corridors.least_deg[0] > 45.0) == blocked
        assert point.corridors.states[36, 0] != UNSAFE


def test_ways_meet_a_wire_over_ground_that_was_never_seen() -> None:
    settings = ["zone_m=60", "min_boundary_points=10", "register_m=0", "adaptive=off"]
    parameters = params.load("quadcopter", settings)
    pipe = Pipeline(parameters, (0.0, 0.0))
    points = seen([ground(12.0)], WAY[-1], np.random.default_rng(1))
    points = np.ascontiguousarray(points[points[:, 1] < 2.0])
    pipe.process(Window(points, np.zeros(len(points), np.int64), WAY[-1], FRAME, 0, 0))
    assert pipe.method.maps is not None
    near, far = (one.terrain for one in pipe.method.maps)
    here, marks = np.zeros(3), WireMarks()
    marks.update([line(9.0, 6.0)])
    free = corridors(here, near, far, None, parameters)
    blocked = corridors(here, near, far, None, parameters, marks.points_m)
    assert free.states[0, 0] == UNKNOWN
    assert blocked.states[0, 0] == UNSAFE
    assert blocked.states[36, 0] == free.states[36, 0]


def line(height_m: float = 9.0, north_m: float = 6.0, number: int = 1) -> Wire:
    curve = SaggingCurve(
        np.array([0.0, north_m]),
        np.array([1.0, 0.0]),
        np.array([height_m, 0.0, 0.001]),
        np.eye(3) * 1e-4,
        0.05,
        1.0,
    )
    return Wire(number, curve, -10.0, 10.0, -15.0, 15.0, (False, False), 30, 0, 0)


def test_wires_over_unknown_ground_leave_it_unknown() -> None:
    """Three wires side by side would be a deck if they were ground."""
    settings = ["zone_m=60", "min_boundary_points=10", "register_m=0", "adaptive=off"]
    pipe = Pipeline(params.load("quadcopter", settings), (0.0, 0.0))
    rng = np.random.default_rng(1)
    points = seen([ground(40.0, half_m=20.0)], WAY[-1], rng)
    points = np.ascontiguousarray(points[points[:, 1] < 0])
    stamps = np.zeros(len(points), np.int64)
    pipe.process(Window(points, stamps, WAY[-1], FRAME, 0, 0))
    before = state(pipe).copy()
    terrain = pipe.method.maps[0].terrain  # type: ignore[index]
    marks = WireMarks()
    altered = marks.update([line(9.0, 4.0 + 0.5 * k, k) for k in range(8)])
    terrain.wires_m = marks.points_m  # type: ignore[attr-defined]
    terrain.add(np.empty((0, 3)), WAY[-1], 1.0, None, np.inf, altered)  # type: ignore[attr-defined]
    after = state(pipe)
    assert (before[130:] == UNKNOWN).all()
    np.testing.assert_array_equal(after[130:], before[130:])


def test_marks_are_renewed_only_where_a_wire_moves() -> None:
    marks = WireMarks()
    assert marks.update([line()])
    first = marks.points_m
    assert not marks.update([line(9.05, 6.02)])
    assert marks.points_m is first
    assert marks.update([line(9.5)])
    middle, end = (
        marks.points_m[np.abs(np.abs(marks.points_m[:, 0]) - away) < 0.06, 2] for away in (0.0, 15.0)
    )
    assert middle.max() == pytest.approx(9.5, abs=0.2)
    assert 9.5 + 0.001 * 15**2 < end.max() < 9.5 + 0.001 * 15**2 + 3.01  # extrapolated: as high as it may be
    edges = marks.update([])
    assert len(marks.points_m) == 0
    assert min(edge[0] for edge in edges) <= -15.0
    assert max(edge[2] for edge in edges) >= 15.0
