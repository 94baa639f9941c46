"""What comes onto the selected point between two windows, over made ground with a known point."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import Intrusion, Intrusions, LocalFrame, Pipeline, PointState, Scan, Window
from slz.landing_point.watched_ground import WatchedGround

FRAME = LocalFrame(47.0, 8.0, 400.0)
SENSOR = np.array([0.0, 0.0, 12.0])
POINT = np.array([1.0, 2.0, 0.0])
SCAN_NS = 50_000_000
Floats = NDArray[np.float64]


def slope(xy: Floats) -> Floats:
    return 0.05 * xy[:, 0]


def ground_returns(seed: int, count: int = 6000, half_m: float = 12.0) -> Floats:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-half_m, half_m, (count, 2))
    return np.column_stack([xy, slope(xy) + rng.normal(0, 0.02, count)])


def window(points: Floats, start_ns: int) -> Window:
    stamps = np.linspace(start_ns, start_ns + 900_000_000, len(points)).astype(np.int64)
    return Window(points, stamps, SENSOR, FRAME, int(stamps[0]), int(stamps[-1]))


@pytest.fixture(scope="module")
def ground() -> WatchedGround:
    """Ground of a point that two windows found safe."""
    pipeline = Pipeline(params.build({"zone_m": 60.0, "adaptive": "off"}))
    pipeline.process(window(ground_returns(1, 40_000), 0))
    pipeline.select(POINT)
    selected = pipeline.process(window(ground_returns(2, 40_000), 1_000_000_000)).selected
    assert selected is not None
    assert selected.state is PointState.SAFE
    assert selected.ground is not None
    return selected.ground


def scan(points: Floats, number: int = 0, frame: LocalFrame = FRAME) -> Scan:
    start_ns = 2_000_000_000 + number * SCAN_NS
    stamps = np.linspace(start_ns, start_ns + SCAN_NS - 1, len(points)).astype(np.int64)
    return Scan(points, stamps, SENSOR, frame)


def thing(count: int, height_m: float, east_m: float = 0.0, north_m: float = 0.0, seed: int = 5) -> Floats:
    """Return returns of an object of 0.4 m across so high over the slope, aside of the point."""
    xy = np.random.default_rng(seed).uniform(-0.2, 0.2, (count, 2)) + POINT[:2] + (east_m, north_m)
    return np.column_stack([xy, slope(xy) + height_m])


def seen(ground: WatchedGround | None, *scans: Scan) -> Intrusion | None:
    watch, found = Intrusions(), None
    for each in scans:
        found = watch.add(each, ground)
    return found


def with_ground(*things: Floats, seed: int = 3) -> Floats:
    return np.concatenate([ground_returns(seed), *things])


def test_an_object_is_told_in_the_scan_that_shows_it(ground: WatchedGround) -> None:
    assert seen(ground, scan(with_ground())) is None
    found = seen(ground, scan(with_ground(thing(6, 0.8))))
    assert found is not None
    assert found.height_m == pytest.approx(0.8, abs=0.1)
    assert np.hypot(*(found.enu_m[:2] - POINT[:2])) < 0.4
    assert found.last_ns - found.first_ns < SCAN_NS


def test_the_order_of_returns_does_not_matter(ground: WatchedGround) -> None:
    points = with_ground(thing(6, 0.8))
    mixed = points[np.random.default_rng(9).permutation(len(points))]
    one, other = seen(ground, scan(points)), seen(ground, scan(mixed))
    assert one is not None
    assert other is not None
    assert one.height_m == other.height_m


@pytest.mark.parametrize(("count", "told"), [(4, False), (5, True)])
def test_single_returns_are_no_object_and_a_group_is(ground: WatchedGround, count: int, told: bool) -> None:
    assert (seen(ground, scan(with_ground(thing(count, 1.0)))) is not None) is told


def test_returns_of_several_scans_count_together_for_a_third_of_a_second(ground: WatchedGround) -> None:
    parts = [thing(2, 1.0, seed=n) for n in range(3)]
    assert seen(ground, *(scan(with_ground(p), n) for n, p in enumerate(parts))) is not None
    assert seen(ground, *(scan(with_ground(p), 4 * n) for n, p in enumerate(parts))) is None


def test_specks_all_over_are_no_object(ground: WatchedGround) -> None:
    rng = np.random.default_rng(4)
    for number in range(40):
        specks = np.column_stack([rng.uniform(-8, 8, (60, 2)), rng.uniform(0.5, 8.0, 60)])
        assert seen(ground, scan(with_ground(specks, seed=number))) is None


@pytest.mark.parametrize(("away_m", "told"), [(1.6, True), (2.2, False)])
def test_what_stays_aside_of_the_footprint_does_not_count(
    ground: WatchedGround, away_m: float, told: bool
) -> None:
    assert ground.radius_m == pytest.approx(math.sqrt(2) + 0.5)
    assert (seen(ground, scan(with_ground(thing(20, 1.0, east_m=away_m)))) is not None) is told


@pytest.mark.parametrize(("height_m", "told"), [(0.25, False), (0.5, True)])
def test_what_is_lower_than_an_obstacle_does_not_count(
    ground: WatchedGround, height_m: float, told: bool
) -> None:
    assert (seen(ground, scan(with_ground(thing(20, height_m)))) is not None) is told


@pytest.mark.parametrize("shift_m", [-1.0, 0.6, 3.0])
def test_a_shift_of_the_estimate_is_no_object_and_hides_none(ground: WatchedGround, shift_m: float) -> None:
    """A barometer's height may jump: all returns move with it."""
    assert seen(ground, scan(with_ground() + np.array([0, 0, shift_m]))) is None
    found = seen(ground, scan(with_ground(thing(20, 1.0)) + np.array([0, 0, shift_m])))
    assert found is not None
    assert found.height_m == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("slope_east", [-0.06, 0.06])
def test_a_tilt_of_all_ground_hides_no_object(ground: WatchedGround, slope_east: float) -> None:
    def tilted(points: Floats) -> Floats:
        return points + np.outer(slope_east * points[:, 0], (0.0, 0.0, 1.0))

    assert seen(ground, scan(tilted(with_ground()))) is None
    found = seen(ground, scan(tilted(with_ground(thing(20, 0.5)))))
    assert found is not None
    assert found.height_m == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("east_m", [3.0, -1.0])
def test_a_lorry_beside_the_point_is_no_tilt_that_hides_an_object(
    ground: WatchedGround, east_m: float
) -> None:
    points = with_ground(thing(20, 0.6))
    points[(points[:, 0] > east_m + 0.5) & (points[:, 0] < east_m + 3.0) & (np.abs(points[:, 1]) < 6), 2] += (
        3.0
    )
    assert seen(ground, scan(points)) is not None


def test_a_car_that_covers_the_whole_circle_is_told(ground: WatchedGround) -> None:
    points = with_ground()
    under = (np.abs(points[:, 0] - POINT[0]) < 2.3) & (np.abs(points[:, 1] - POINT[1]) < 0.9)
    points[under, 2] += 1.4
    assert seen(ground, scan(points)) is not None


def test_more_returns_never_hide_an_object(ground: WatchedGround) -> None:
    watch = Intrusions()
    assert watch.add(scan(with_ground(thing(6, 0.8))), ground) is not None
    for more in (thing(200, 0.0), thing(50, 2.0, seed=8), thing(50, 1.0, east_m=1.0)):
        assert seen(ground, scan(with_ground(thing(6, 0.8), more))) is not None


def test_without_ground_or_in_another_frame_nothing_is_told(ground: WatchedGround) -> None:
    assert seen(None, scan(with_ground(thing(20, 1.0)))) is None
    elsewhere = LocalFrame(47.1, 8.0, 400.0)
    halves = scan(with_ground(thing(3, 1.0))), scan(with_ground(thing(3, 1.0, seed=6)), 1, elsewhere)
    assert seen(ground, *halves) is None


def test_source_mode_keeps_to_its_windows() -> None:
    pipeline = Pipeline(params.build({"zone_m": 60.0, "mode": "source"}))
    pipeline.process(window(ground_returns(1, 40_000), 0))
    pipeline.select(POINT)
    selected = pipeline.process(window(ground_returns(2, 40_000), 1_000_000_000)).selected
    assert selected is not None
    assert selected.ground is None


def judged_ground(points: Callable[[int], Floats], **settings: object) -> WatchedGround:
    """Return the ground of the point after windows of made returns; the point is safe."""
    pipeline = Pipeline(params.build({"zone_m": 60.0, "adaptive": "off", **settings}))
    for number in range(3):
        report = pipeline.process(window(points(number), number * 1_000_000_000))
        pipeline.select(POINT)
    selected = pipeline.selected
    assert report.near.zones or selected is not None
    assert selected is not None
    assert selected.state is PointState.SAFE
    assert selected.ground is not None
    return selected.ground


def street(seed: int, count: int = 40_000) -> Floats:
    """Return returns of a street 10 m wide between roofs 8 m high, and of their walls."""
    points, rng = ground_returns(seed, count), np.random.default_rng(seed)
    roof = np.abs(points[:, 0] - 1.0) > 5.0
    points[roof, 2] += 8.0
    face = rng.random(count // 4) < 0.5
    wall = np.column_stack(
        [np.where(face, -4.0, 6.0), rng.uniform(-12, 12, len(face)), rng.uniform(0, 8, len(face))]
    )
    return np.concatenate([points, wall + rng.normal(0, 0.02, wall.shape)])


def test_between_walls_nothing_comes() -> None:
    """From low in the street most returns are of walls, far below the roofs in whose cells they are."""
    ground, rng = judged_ground(street), np.random.default_rng(7)
    side = np.where(rng.random(4000) < 0.5, -4.0, 6.0)
    walls = np.column_stack(
        [side + rng.normal(0, 0.1, 4000), rng.uniform(-4, 8, 4000), rng.uniform(0, 6, 4000)]
    )
    low = street(5, 4000)
    low = low[np.abs(low[:, 0] - 1.0) < 4.9]
    assert seen(ground, scan(np.concatenate([low, walls]))) is None
    assert seen(ground, scan(np.concatenate([low, walls, thing(20, 1.0)]))) is not None


def test_an_object_that_returns_more_than_the_ground_is_told(ground: WatchedGround) -> None:
    points = ground_returns(3, 800)
    car = np.random.default_rng(2).uniform((-1.2, 1.1, 1.4), (3.2, 2.9, 1.5), (5000, 3))
    hidden = (np.abs(points[:, 0] - 1.0) < 2.2) & (np.abs(points[:, 1] - 2.0) < 0.9)
    assert seen(ground, scan(np.concatenate([points[~hidden], car]))) is not None


def test_snow_near_the_sensor_is_no_object_and_hides_none(ground: WatchedGround) -> None:
    rng = np.random.default_rng(6)
    sensor = POINT + np.array([0, 0, 12.0])
    snow = sensor - np.array([0, 0, 1.0]) + rng.normal(0, 0.3, (5, 3))

    def falling(*things: Floats, number: int) -> Scan:
        points = with_ground(snow + rng.normal(0, 0.2, snow.shape), *things, seed=number)
        made = scan(np.concatenate([points, ground_returns(number + 50, 14_000)]), number)
        return Scan(made.points_enu_m, made.stamp_ns, sensor, FRAME)

    assert seen(ground, *(falling(number=n) for n in range(6))) is None
    assert seen(ground, *(falling(thing(6, 0.8), number=n) for n in range(2))) is not None


def test_over_gaps_that_count_as_seen_an_object_is_told() -> None:
    sparse = judged_ground(lambda number: ground_returns(number, 1800))
    assert np.isfinite(sparse.top_m).mean() > 0.95
    small = POINT + np.random.default_rng(8).uniform((-0.1, -0.1, 0.9), (0.1, 0.1, 1.1), (6, 3))
    for aside in ((0.0, 0.0), (0.7, 0.3), (-0.5, 0.6), (0.2, -0.9)):
        assert seen(sparse, scan(with_ground(small + np.array([*aside, 0.0])))) is not None


def test_what_would_be_under_the_rotor_is_told_if_it_reaches_up_to_it() -> None:
    sizes = {"footprint_m": 3.0, "rotor_diameter_m": 10.0, "rotor_height_m": 2.6, "touchdown_error_m": 0.5}
    ground = judged_ground(lambda number: ground_returns(number, 40_000), **sizes)
    assert ground.radius_m == pytest.approx(5.8)
    assert seen(ground, scan(with_ground(thing(20, 2.5, east_m=4.5)))) is not None
    assert seen(ground, scan(with_ground(thing(20, 1.5, east_m=4.5)))) is None
    assert seen(ground, scan(with_ground(thing(20, 1.5, east_m=1.5)))) is not None


def test_returns_that_are_nowhere_and_scans_of_half_a_second_are_taken(ground: WatchedGround) -> None:
    points = with_ground(thing(8, 0.8))
    points[:3] = (np.nan, 0, 0), (1.0, 2.0, np.inf), (1e300, 0, 0)
    stamps = np.linspace(2e9, 2.5e9, len(points)).astype(np.int64)
    assert seen(ground, Scan(points, stamps, SENSOR, FRAME)) is not None
