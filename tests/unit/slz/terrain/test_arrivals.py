"""Arrivals stand in the map until rays prove that they have gone, and nothing else is proven gone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNSAFE, LocalFrame, Pipeline, Window
from slz.grid import Grid
from slz.terrain.arrivals import Arrivals
from slz.terrain.terrain import EvidenceTerrain

Points = NDArray[np.float64]
Flags = NDArray[np.bool_]
Box = tuple[tuple[float, float, float], tuple[float, float, float]]
Rays = Callable[[int, np.random.Generator], Points]
FRAME = LocalFrame(47.0, 8.0, 400.0)
SCANS = 20  # a second
MAN: Box = ((1.8, 0.85, 0.0), (2.2, 1.15, 1.75))
WIRE: Box = ((-3.0, 1.0, 1.5), (5.0, 1.02, 1.52))
POST: Box = ((2.0, 1.0, 0.0), (2.1, 1.1, 1.0))
HERE = np.array([0.0, 0.0, 12.0])
SETTINGS = params.load("quadcopter")


def everywhere(n: int, rng: np.random.Generator) -> Points:
    down, azimuth = rng.uniform(np.sin(np.radians(15)), 1, n), rng.uniform(0, 2 * np.pi, n)
    across = np.sqrt(1 - down**2)
    return np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), -down])


def along_a_line(n: int, rng: np.random.Generator) -> Points:
    """Directions of one sweep of a scanner that sweeps from west to east, turned a little at random."""
    across = np.radians(rng.uniform(-70, 70, n))
    tilt = np.full(n, np.radians(rng.normal(0, 0.1)))
    return np.column_stack([np.sin(across), np.tan(tilt) * np.cos(across), -np.cos(across)])


def cast(origin: Points, rays: Points, boxes: list[Box], rng: np.random.Generator) -> Points:
    """Return the returns of rays that meet boxes, or ground that rises by 4 % to the east."""
    away = -(origin[2] - 0.04 * origin[0]) / (rays[:, 2] - 0.04 * rays[:, 0])
    for low, high in boxes:
        with np.errstate(divide="ignore"):
            one, other = (low - origin) / rays, (high - origin) / rays
        into, out = np.minimum(one, other).max(axis=1), np.maximum(one, other).min(axis=1)
        away = np.where((into < out) & (into > 0) & (into < away), into, away)
    return origin + rays * (away + rng.normal(0, 0.02, len(rays)))[:, None]


def window(
    second: int,
    rng: np.random.Generator,
    boxes: Callable[[float], list[Box]],
    *,
    n: int = 30_000,
    pattern: Rays = everywhere,
    sensor: Callable[[float], Points] = lambda _: HERE,
) -> Window:
    times = second + np.arange(SCANS) / SCANS
    origins = np.array([sensor(at) for at in times])
    scans = [
        cast(origin, pattern(n // SCANS, rng), boxes(at), rng)
        for at, origin in zip(times, origins, strict=True)
    ]
    origin = np.repeat(np.arange(SCANS, dtype=np.uint16), n // SCANS)
    stamps = np.repeat((times * 1e9).astype(np.int64), n // SCANS)
    points, last = np.concatenate(scans), origins[-1].copy()
    for array in (points, stamps, last, origin, origins):
        array.setflags(write=False)  # as the fusion hands them over
    return Window(
        points,
        stamps,
        last,
        FRAME,
        second * 10**9,
        (second + 1) * 10**9,
        origin=origin,
        origins_enu_m=origins,
    )


def take(
    arrivals: Arrivals,
    points: Points,
    raised: Flags,
    origins: Points,
    sensor: Points,
    now_s: float,
    *,
    over: Flags | None = None,
    isolated: Flags | None = None,
    origin: NDArray[np.uint16] | None = None,
) -> tuple[Flags, Points]:
    """Take a window, of one scan by default; what is over ground is raised by default, and none isolated."""
    n, over = len(points), raised if over is None else over
    rows, evidence = arrivals.update(
        points,
        np.arange(n),
        raised,
        np.zeros(n, bool) if isolated is None else isolated,
        over.__getitem__,
        np.zeros(n, np.uint16) if origin is None else origin,
        origins,
        sensor,
        now_s,
    )
    apart = np.zeros(n, bool)
    apart[rows] = True
    return apart, evidence


def pipeline() -> Pipeline:
    return Pipeline(params.load("quadcopter", ["zone_m=40"]), (0.0, 0.0))


def safe_share(pipe: Pipeline, east: float, north: float, around_m: float) -> float:
    maps = pipe.maps()
    assert maps is not None
    rows, cols = np.mgrid[maps.box.row0 : maps.box.row1, maps.box.col0 : maps.box.col1]
    x, y = (
        maps.grid.west_m + (cols + 0.5) * maps.grid.cell_m,
        maps.grid.south_m + (rows + 0.5) * maps.grid.cell_m,
    )
    return float((maps.state == SAFE)[np.hypot(x - east, y - north) < around_m].mean())


def test_somebody_who_came_makes_it_unsafe_at_once_and_who_left_gives_it_back() -> None:
    """Evidence alone would hold for `hold_s`, 8 s, after he left."""
    rng, pipe = np.random.default_rng(1), pipeline()
    shares = []
    for second in range(8):
        pipe.process(window(second, rng, lambda at: [MAN] if 3 <= at < 5.2 else []))
        shares.append(safe_share(pipe, 2.0, 1.0, 0.7))
    assert shares[:3] == [1.0] * 3
    assert shares[3:5] == [0.0] * 2
    assert shares[7] == 1.0


def test_who_walks_by_gives_each_place_back_behind_him() -> None:
    """Rays that passed before he came tell nothing of him, and his lonely returns go with the others."""

    def walker(at: float) -> list[Box]:
        east = 1.5 * (at - 1) - 4
        return [((east - 0.2, 0.85, 0.0), (east + 0.2, 1.15, 1.75))] if 3 <= at < 7 else []

    rng, pipe = np.random.default_rng(1), pipeline()
    shares = []
    for second in range(8):
        pipe.process(window(second, rng, walker, n=100_000))
        shares.append(safe_share(pipe, 2.0, 1.0, 0.7))
    assert shares[4:6] == [0.0] * 2
    assert shares[7] == 1.0


def test_ground_that_is_first_seen_while_somebody_stands_beside_it_is_known() -> None:
    rng, pipe = np.random.default_rng(4), pipeline()
    first, second = window(0, rng, lambda _: []), window(1, rng, lambda _: [MAN])
    east = first.points_enu_m[:, 0] > 1.8  # the man's western edge
    assert first.origin is not None
    pipe.process(
        replace(
            first,
            points_enu_m=np.ascontiguousarray(first.points_enu_m[east]),
            stamp_ns=first.stamp_ns[east],
            origin=first.origin[east],
        )
    )
    pipe.process(second)
    maps = pipe.maps()
    assert maps is not None
    row, col = maps.grid.index(1.7, 1.0)
    assert np.isfinite(maps.height_m[row - maps.box.row0, col - maps.box.col0])


@pytest.mark.parametrize("pattern", [everywhere, along_a_line])
@pytest.mark.parametrize("there", [WIRE, POST])
def test_what_stands_is_never_given_up(there: Box, pattern: Rays) -> None:
    """A wire of 2 cm returns few of the rays around it, and a line of rays may pass it as a whole."""

    def sensor(at: float) -> Points:
        return np.array([-3.0 + at, 1.0 + 0.1 * np.sin(at), 12.0])

    rng, arrivals, before = np.random.default_rng(2), Arrivals(0.0, 0.0, SETTINGS), 0
    for second in range(8):
        looked = window(second, rng, lambda _: [there], n=20_000, pattern=pattern, sensor=sensor)
        points, origin, origins = looked.points_enu_m, looked.origin, looked.origins_enu_m
        assert origin is not None
        assert origins is not None
        raised = points[:, 2] - 0.04 * points[:, 0] > 0.3
        take(arrivals, points, raised, origins, looked.sensor_enu_m, float(second), origin=origin)
        assert len(arrivals) >= before
        before = len(arrivals)
    assert before


# ---- the rule, ray by ray --------------------------------------------------------------------------

TOP = np.array([4.0, 0.5, 1.5])  # of what came


class Looks:
    """Windows of one scan each, in which a column returns rays, and others pass through it to the ground."""

    def __init__(self) -> None:
        self.arrivals = Arrivals(0.0, 0.0, SETTINGS)
        self._time_s = 0.0
        self._rng = np.random.default_rng(3)

    def look(
        self, returned: int, passed: int, sensor: Points = HERE, beside_m: float = 0.0
    ) -> NDArray[np.bool_]:
        places = TOP + self._rng.uniform(-0.04, 0.04, (returned + passed, 3)) * (1, 1, 0)
        places[returned:, 1] += beside_m
        points = sensor + (places - sensor) * np.where(np.arange(len(places)) < returned, 1.0, 1.16)[:, None]
        raised = np.arange(len(places)) < returned
        self._time_s += 0.05
        return take(self.arrivals, points, raised, sensor[np.newaxis], sensor, self._time_s)[0]


def dense() -> Looks:
    looks = Looks()
    for _ in range(20):
        looks.look(8, 2)
    return looks


def test_rays_through_its_place_prove_it_gone() -> None:
    looks = dense()
    assert len(looks.arrivals.points_enu_m)
    for _ in range(20):
        looks.look(0, 10)
    assert not len(looks.arrivals.points_enu_m)


@pytest.mark.parametrize(
    ("elsewhere", "beside_m"),
    [
        pytest.param(HERE, 0.6, id="beside it"),
        pytest.param(np.array([10.0, 0.0, 12.0]), 0.0, id="from another side"),
        pytest.param(np.array([-4.0, -0.5, 24.0]), 0.0, id="from farther"),
    ],
)
def test_rays_elsewhere_prove_nothing(elsewhere: Points, beside_m: float) -> None:
    looks = dense()
    for _ in range(300):
        looks.look(0, 10, elsewhere, beside_m)
    assert len(looks.arrivals.points_enu_m)


def test_one_scan_proves_nothing_however_many_rays_it_has() -> None:
    looks = dense()
    looks.look(0, 10_000)
    assert len(looks.arrivals.points_enu_m)


def test_one_return_of_thirty_rays_is_kept_against_a_thousand_rays() -> None:
    looks = Looks()
    looks.look(1, 29)
    for _ in range(100):
        looks.look(0, 10)
    assert len(looks.arrivals.points_enu_m)


def test_what_stands_is_no_evidence_before_it_has_stood_for_long() -> None:
    looks = Looks()
    assert looks.look(8, 0).all()
    stays = SETTINGS.model_copy(update={"max_age_s": 1.0})
    arrivals = Arrivals(0.0, 0.0, stays)
    points, flags = TOP[np.newaxis].copy(), np.ones(1, bool)
    _, evidence = take(arrivals, points, flags, HERE[np.newaxis], HERE, 0.0)
    assert not len(evidence)
    _, evidence = take(arrivals, points, ~flags, HERE[np.newaxis], HERE, 2.0)
    assert (evidence == TOP).all()
    assert len(evidence)
    assert not len(arrivals.points_enu_m)


def test_rays_just_over_what_one_line_of_a_sensor_returned_prove_nothing() -> None:
    """Lines 2 degrees apart are half a metre apart at 15 m: one may pass over a board, and none meet it."""
    arrivals, origins = Arrivals(0.0, 0.0, SETTINGS), np.array([[0.0, 0.0, 10.0]])
    across = np.linspace(-0.14, 0.14, 20)
    board = np.column_stack([np.full(20, 11.1), across, np.full(20, 1.05)])
    over = origins + (board + np.array([0.0, 0.0, 0.13]) - origins) * 1.12
    nobody = np.zeros(20, bool)
    for k in range(100):
        points, raised = (board, ~nobody) if k < 40 else (over, nobody)
        take(arrivals, points, raised, origins, origins[0], 0.05 * k)
    assert len(arrivals) == 2


def test_what_stands_far_away_is_kept_until_the_sensor_is_back() -> None:
    """The map's grid may not hold it meanwhile."""
    settings = SETTINGS.model_copy(update={"max_age_s": 10.0})
    arrivals, here = Arrivals(0.0, 0.0, settings), HERE[np.newaxis]
    point, flags = TOP[np.newaxis], np.ones(1, bool)
    take(arrivals, point, flags, here, HERE, 0.0)
    away = np.array([300.0, 0.0, 0.0])
    _, evidence = take(arrivals, point + away, ~flags, here + away, HERE + away, 8.0)
    assert (len(evidence), len(arrivals)) == (0, 1)
    _, evidence = take(arrivals, point + np.array([5.0, 0.0, 0.0]), ~flags, here, HERE, 9.0)
    assert (len(evidence), len(arrivals)) == (2, 0)


def test_the_top_of_what_stands_is_its_highest_return() -> None:
    arrivals, here = Arrivals(0.0, 0.0, SETTINGS), HERE[np.newaxis]
    mast = TOP + np.column_stack([np.zeros((40, 2)), np.linspace(-1.0, 4.0, 40)])
    take(arrivals, mast, np.ones(40, bool), here, HERE, 0.0)
    assert arrivals.points_enu_m[:, 2].max() == mast[:, 2].max()


def test_an_isolated_return_is_an_arrival_only_beside_others() -> None:
    looks = Looks()
    points = TOP + np.array([(0.0, 0.0, 0.0), (0.2, 0.0, 0.3), (5.0, 0.0, 0.0)])
    origins = HERE[np.newaxis].copy()
    raised, isolated = np.ones(3, bool), np.array([False, True, True])
    apart, _ = take(looks.arrivals, points, raised, origins, HERE, 0.0, isolated=isolated)
    assert apart.tolist() == [True, True, False]
    assert looks.arrivals.points_enu_m[:, 2].max() == TOP[2] + 0.3


def test_what_is_low_around_an_arrival_is_its_own_and_ground_beside_it_is_not() -> None:
    """Shins are lower than an obstacle; as evidence they would stay where somebody walked."""
    looks = Looks()
    shin, ground = (0.4, 0.0, -1.5), (0.4, 0.0, -1.75)
    points = TOP + np.array([(0.0, 0.0, 0.0), shin, ground])
    raised, over = np.array([True, False, False]), np.array([True, True, False])
    apart, _ = take(looks.arrivals, points, raised, HERE[np.newaxis].copy(), HERE, 0.0, over=over)
    assert apart.tolist() == [True, True, False]


def test_rays_of_a_radar_prove_nothing() -> None:
    """Its beam is as wide as a house, and goes on past what is thin."""
    looks = dense()
    points, nobody = HERE + (TOP + np.zeros((10, 3)) - HERE) * 1.16, np.zeros(10, bool)
    for k in range(100):
        take(looks.arrivals, points, nobody, np.full((1, 3), np.nan), HERE, 2.0 + 0.05 * k)
    assert len(looks.arrivals)


def test_what_stands_on_ground_that_has_grown_too_old_is_no_ground() -> None:
    """The roof of a lorry, level and as large as a footprint."""
    arrivals = Arrivals(0.0, 0.0, SETTINGS)
    east, north = np.mgrid[0.1:8:0.2, 0.1:8:0.2]
    roof = np.column_stack([east.ravel(), north.ravel(), np.full(east.size, 3.0)])
    sensor = np.array([4.0, 4.0, 15.0])
    take(arrivals, roof, np.ones(len(roof), bool), sensor[np.newaxis], sensor, 0.0)
    terrain = EvidenceTerrain(Grid(0.0, 0.0, SETTINGS.cell_m, 40, 40), SETTINGS)
    terrain.arrivals = arrivals
    terrain.add(np.array([[0.1, 0.1, 0.0]]), sensor, 0.0)
    state = terrain.state(terrain.grid.everything)
    assert (state[10:30, 10:30] == UNSAFE).all()


def test_the_points_altered_are_those_shown_before_or_now_but_not_both() -> None:
    """Somebody comes, stays, raises an arm, and lowers it, which leaves the highest return where it was."""
    arrivals, shown = Arrivals(0.0, 0.0, SETTINGS), set[tuple[float, ...]]()
    man = TOP + np.array([(0.0, 0.0, 0.0), (0.2, 0.0, -0.3)])
    for k, points in enumerate((man, man, man + np.array([0.0, 0.0, 0.4]), man[:1])):
        take(arrivals, points, np.ones(len(points), bool), HERE[np.newaxis], HERE, float(k))
        now = {tuple(point) for point in arrivals.points_enu_m.tolist()}
        assert {tuple(point) for point in arrivals.altered_enu_m.tolist()} == shown ^ now
        assert (shown != now) == (k in (0, 2))
        shown = now
