"""Wires found in closed-form worlds, and what is no wire."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.wires.detected_wire import Wire
from slz.wires.wire_detector import MOST_WIRES, WireDetector
from tests.unit.slz.wires.worlds import (
    Body,
    Catenary,
    Rectangle,
    all_of,
    approach,
    box,
    ground,
    seen,
    watch,
    wire,
)

Floats = NDArray[np.float64]
LINE = Catenary(np.array([-25.0, 10.0, 9.0]), np.array([25.0, 14.0, 10.0]), 0.8)
TOWARDS = approach([0.0, -20.0, 30.0], [0.0, 5.0, 14.0], 15)
LOW = approach([0.0, -25.0, 25.0], [0.0, 25.0, 18.0], 30)
DOWN = approach([0.0, -5.0, 30.0], [0.0, 5.0, 6.0], 30)


def longest(wires: tuple[Wire, ...]) -> Wire:
    return max(wires, key=lambda one: one.stop_m - one.start_m)


def errors(one: Wire, line: Catenary) -> tuple[float, float]:
    """Greatest error of the height and of the place across the line, where the wire was seen."""
    points, _, own = one.sampled(0.5)
    return (
        float(np.abs(points[own, 2] - line.height_at(points[own])).max()),
        float(line.aside_m(points[own]).max()),
    )


@pytest.mark.parametrize(("per_m", "by_window"), [(0.05, 14), (0.1, 10), (0.2, 8), (1.0, 6)])
def test_a_wire_is_found_from_few_returns_of_many_windows(per_m: float, by_window: int) -> None:
    """At 25 m there are 2.5 returns of 50 m in a window of the first case."""
    for seed in range(4):
        _, known = watch([ground(4.0), wire(LINE, per_m)], TOWARDS, seed)
        assert known[by_window], seed
        assert len(known[-1]) == 1
        height_m, aside_m = errors(known[-1][0], LINE)
        assert height_m < 0.3
        assert aside_m < 0.3


def test_heights_beyond_the_ends_are_within_their_standard_deviation() -> None:
    """Of a wire of 100 m only the middle half returns pulses."""
    line = Catenary(np.array([-50.0, 10.0, 12.0]), np.array([50.0, 14.0, 12.0]), 2.0)
    offs = []
    for seed in range(3):
        whole = wire(line, 0.3)

        def middle(rng: np.random.Generator, sensor: Floats, whole: Body = whole) -> Floats:
            points = whole(rng, sensor)
            return points[np.abs(points[:, 0]) < 25]

        _, known = watch([ground(4.0), middle], TOWARDS, seed)
        one = longest(known[-1])
        points, sd, own = one.sampled(1.0)
        assert one.to_m - one.from_m > 1.4 * (one.stop_m - one.start_m)
        assert sd[~own].max() > 2 * sd[own].min()
        offs.append(np.abs(points[:, 2] - line.height_at(points)) / np.hypot(sd, 0.1))
    assert np.concatenate(offs).max() < 4.0


def test_a_wire_ends_at_the_pole_that_it_meets() -> None:
    def pole(rng: np.random.Generator, sensor: Floats) -> Floats:
        return np.column_stack([rng.uniform(28.0, 28.3, 30), np.full(30, 14.25), rng.uniform(0.5, 11.0, 30)])

    _, known = watch([ground(4.0), wire(LINE, 0.5), pole], TOWARDS)
    one = longest(known[-1])
    points, _, _ = one.sampled(0.5)
    assert points[:, 0].max() == pytest.approx(28.0, abs=1.5)
    assert sorted(one.at_support) == [False, True]


@pytest.mark.parametrize("turn_deg", [0.0, 37.0, 90.0, 143.0])
@pytest.mark.parametrize("shift_m", [0.0, 5000.3])
def test_shift_and_turn_of_the_world_shift_and_turn_the_wire(turn_deg: float, shift_m: float) -> None:
    turn = math.radians(turn_deg)
    rotation = np.array(
        [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
    )
    moved: Callable[[Floats], Floats] = lambda points: points @ rotation.T + shift_m  # noqa: E731
    _, (*_, plain) = watch([ground(4.0), wire(LINE, 0.3)], TOWARDS)
    _, (*_, other) = watch([ground(4.0), wire(LINE, 0.3)], TOWARDS, moved=moved)
    assert len(plain) == len(other) == 1
    ends = moved(plain[0].ends_enu_m)
    for end in ends:
        away_m, up_m = other[0].distance_m(end)
        assert away_m < 0.3
        assert up_m == pytest.approx(end[2], abs=0.2)


def test_order_of_returns_and_length_of_windows_do_not_matter() -> None:
    def run(cut: int, mixed: bool) -> tuple[Wire, ...]:
        rng, order = np.random.default_rng(1), np.random.default_rng(2)
        detector = WireDetector(params.load("quadcopter", []))
        for k, sensor in enumerate(TOWARDS):
            points = seen([ground(4.0), wire(LINE, 0.3)], sensor, rng)
            points = points[order.permutation(len(points))] if mixed else points
            for j, part in enumerate(np.array_split(points, cut)):
                at_s = k + j / cut
                detector.update(part, sensor, at_s, round(at_s * 1e9))
        return detector.wires(0.0)

    for cut, mixed in ((1, True), (2, True), (4, False)):
        (one,) = run(cut, mixed)
        height_m, aside_m = errors(one, LINE)
        assert height_m < 0.2
        assert aside_m < 0.2
        assert one.stop_m - one.start_m > 40


def test_conductors_side_by_side_are_wires_of_their_own() -> None:
    lines = [Catenary(np.array([-30.0, y, 11.0]), np.array([30.0, y, 11.0]), 0.9) for y in (8.0, 10.0, 12.0)]
    _, known = watch([ground(4.0), *(wire(line, 1.0) for line in lines)], TOWARDS)
    norths = sorted(float(one.ends_enu_m[:, 1].mean()) for one in known[-1])
    assert norths == pytest.approx([8.0, 10.0, 12.0], abs=0.3)


def walls(per_window: int) -> Body:
    """Return a facade with balconies."""

    def returns(rng: np.random.Generator, sensor: Floats) -> Floats:
        n = rng.poisson(per_window)
        balcony = rng.random(n) < 0.25
        up = rng.uniform(0, 12, n)
        up = np.where(balcony, np.round(up / 3) * 3 + rng.uniform(0, 1, n), up)
        return np.column_stack([rng.uniform(-20, 20, n), np.where(balcony, 3.8, 5.0), up])

    return returns


def roof(per_window: int) -> Body:
    """Return a pitched roof with its ridge."""

    def returns(rng: np.random.Generator, sensor: Floats) -> Floats:
        n = rng.poisson(per_window)
        aside = rng.uniform(-6, 6, n)
        return np.column_stack([rng.uniform(-15, 15, n), aside + 12, 10 - 0.6 * np.abs(aside)])

    return returns


def forest(per_window: int) -> Body:
    """Return crowns of 60 trees."""
    own = np.random.default_rng(5)
    trees, tops = own.uniform(-30, 30, (60, 2)), own.uniform(8, 18, 60)

    def returns(rng: np.random.Generator, sensor: Floats) -> Floats:
        n = rng.poisson(per_window)
        tree, off = rng.integers(0, len(trees), n), rng.normal(size=(n, 3))
        off *= 2.5 * rng.random((n, 1)) ** (1 / 3) / np.linalg.norm(off, axis=1, keepdims=True)
        return np.column_stack([trees[tree] + off[:, :2], tops[tree] - 2.5 + off[:, 2]])

    return returns


def fence(per_window: int) -> Body:
    """Return wires between 0.3 m and 2 m over the ground."""

    def returns(rng: np.random.Generator, sensor: Floats) -> Floats:
        n = rng.poisson(per_window)
        heights = np.linspace(0.3, 2.0, 6)[rng.integers(0, 6, n)]
        return np.column_stack([rng.uniform(-25, 25, n), np.full(n, 6.0), heights])

    return returns


def scanned_house(rng: np.random.Generator, sensor: Floats) -> Floats:
    """Return the lines that 16 lasers draw on a facade and a flat roof: they move with the sensor."""
    out = []
    for elevation in np.radians(np.arange(-15, 16, 2)):
        azimuth = rng.uniform(0, 2 * np.pi, 600)
        level = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
        way = np.column_stack([level, np.full(600, math.tan(elevation))])
        with np.errstate(divide="ignore", invalid="ignore"):
            front = sensor + way * ((8.0 - sensor[1]) / way[:, 1])[:, np.newaxis]
            top = sensor + way * ((12.0 - sensor[2]) / way[:, 2])[:, np.newaxis]
        ahead = (front - sensor)[:, 1] * way[:, 1] > 0
        out.append(front[ahead & (np.abs(front[:, 0]) < 20) & (front[:, 2] > 0) & (front[:, 2] < 12)])
        below = (sensor[2] > 12) & ((top - sensor)[:, 2] * way[:, 2] > 0)
        out.append(top[below & (np.abs(top[:, 0]) < 20) & (top[:, 1] > 8) & (top[:, 1] < 30)])
    return np.concatenate(out)


STAYS = [
    Catenary(np.array([0.0, 8.0, 18.0]), np.array([11 * math.cos(a), 8 + 11 * math.sin(a), 0.5]), 0.15)
    for a in (0.0, 2.1, 4.2)
]
ROOF = Rectangle(2, 12.0, (-20, 8, 12), (20, 30, 12))
WALL = Rectangle(1, 4.1, (-20, 4, 0), (20, 4.2, 4))
HOUSE = Rectangle(1, 5.0, (-20, 5, 0), (20, 5, 12))
EAVES = Rectangle(2, 6.4, (-15, 6, 6), (15, 18, 6.4))
FLAT = Rectangle(2, 9.0, (-15, 4, 9), (15, 16, 9))
NONE: dict[str, tuple[Body, Rectangle | None]] = {
    "thin dust": (box([-30, -30, 0.5], [30, 30, 20], 20), None),
    "dust": (box([-30, -30, 0.5], [30, 30, 20], 150), None),
    "dense dust": (box([-30, -30, 0.5], [30, 30, 20], 1000), None),
    "forest": (forest(2000), None),
    "forest hit seldom": (forest(200), None),
    "facade": (walls(2000), HOUSE),
    "facade hit seldom": (walls(80), HOUSE),
    "scanned house": (scanned_house, ROOF),
    "roof": (roof(2000), EAVES),
    "roof hit seldom": (roof(60), EAVES),
    "flat roof": (box([-15, 4, 9], [15, 16, 9], 60), FLAT),
    "wall": (box([-20, 4, 0], [20, 4.2, 4], 40), WALL),
    "hedge": (box([-20, 4, 0], [20, 5.2, 4], 300), WALL),
    "fence": (fence(300), None),
    "stays": (all_of([wire(line, 0.5) for line in STAYS]), None),
    "nothing": (all_of([]), None),
}


@pytest.mark.parametrize("name", NONE)
@pytest.mark.parametrize("way", [LOW, DOWN], ids=["over", "down"])
def test_what_is_no_wire_is_none(name: str, way: list[Floats]) -> None:
    for seed in range(2):
        _, known = watch([ground(2.0, NONE[name][1]), NONE[name][0]], way, seed)
        assert not any(known), f"window {next(k for k, wires in enumerate(known) if wires)}"


def low_hedge(rng: np.random.Generator, sensor: Floats) -> Floats:
    """Return a hedge of 1.1 m, 27 m away, hit seldom."""
    n = rng.poisson(15)
    return np.column_stack([np.full(n, -27.0), rng.uniform(-30, 30, n), rng.uniform(0.0, 1.1, n)])


def ground_around(rng: np.random.Generator, sensor: Floats) -> Floats:
    """Return level ground as far away as its rays are not grazing: 6 times the sensor's height."""
    half_m = min(30.0, max(3.0, 6 * sensor[2]))
    return ground(4.0, half_m=half_m)(rng, sensor)


def test_a_hedge_seen_from_the_ground_before_the_take_off_is_no_wire() -> None:
    """Over ground that was not seen yet it is no higher over the ground below the vehicle than a fence."""
    heights = [0.3] * 8 + [1.8, 3.3, 4.8, 6.3, 7.8, 9.3]
    for seed in range(2):
        _, known = watch([ground_around, low_hedge], [np.array([0.0, 0.0, z]) for z in heights], seed)
        assert not any(known), f"window {next(k for k, wires in enumerate(known) if wires)}"


def test_specks_below_a_sensor_that_sees_no_ground_are_no_ground() -> None:
    """A wire ahead, 1 m lower than the sensor, is over no floor and counts."""

    def specks(rng: np.random.Generator, sensor: Floats) -> Floats:
        return sensor + rng.uniform((-2, -2, -1.5), (2, 2, -0.5), (3, 3))

    way = approach([0.0, -20.0, 10.0], [0.0, 4.0, 10.0], 15)
    _, known = watch([specks, wire(LINE, 1.0)], way)
    assert len(known[-1]) == 1


def test_a_line_over_ground_not_seen_is_a_wire_until_the_ground_is_seen_near_below() -> None:
    """A fence on a slope, whose ground comes into view late."""
    line = Catenary(np.array([-20.0, 25.0, 9.0]), np.array([20.0, 25.0, 9.0]), 0.01)

    def slope(rng: np.random.Generator, sensor: Floats) -> Floats:
        seen_there = 2000 if sensor[2] > 12 else 0
        return np.column_stack([rng.uniform((-30, 20), (30, 40), (seen_there, 2)), np.full(seen_there, 7.8)])

    def near(rng: np.random.Generator, sensor: Floats) -> Floats:
        points = ground(4.0)(rng, sensor)
        return points[points[:, 1] < 20]

    way = approach([0.0, -10.0, 10.0], [0.0, 5.0, 11.0], 12) + approach([0.0, 5.0, 12.5], [0.0, 5.0, 14.0], 8)
    _, known = watch([near, slope, wire(line, 0.5)], way)
    assert len(known[11]) == 1
    assert not known[-1]


@pytest.mark.parametrize("name", ["thin dust", "dust", "forest hit seldom"])
def test_a_wire_beside_clutter_is_found(name: str) -> None:
    _, known = watch([ground(4.0), NONE[name][0], wire(LINE, 1.0)], TOWARDS)
    assert known[-1]
    height_m, aside_m = errors(longest(known[-1]), LINE)
    assert height_m < 0.4
    assert aside_m < 0.4


def test_a_line_seen_from_one_place_alone_is_no_wire_yet() -> None:
    """Lines of a scan on a surface move with the sensor, those of a wire do not."""
    _, known = watch([ground(4.0), wire(LINE, 1.0)], [TOWARDS[5]] * 20)
    assert not any(known)


def with_rays(detector: WireDetector, bodies: list[Body], sensor: Floats, k: int) -> None:
    rng = np.random.default_rng(100 + k)
    points = seen(bodies, sensor, rng)
    rays = np.zeros(len(points), np.uint16), sensor[np.newaxis].copy()
    detector.update(points, sensor, float(k), k * 1_000_000_000, rays)


def test_rays_that_pass_where_a_wire_was_take_it_away() -> None:
    detector = WireDetector(params.load("quadcopter", []))
    for k, sensor in enumerate(TOWARDS):
        with_rays(detector, [ground(4.0), wire(LINE, 0.5)], sensor, k)
    assert detector.wires(0.0)
    for k in range(15, 60):
        with_rays(detector, [ground(4.0)], TOWARDS[-1], k)
    assert not detector.wires(0.0)


def test_a_wire_is_remembered_where_no_ray_passes() -> None:
    detector = WireDetector(params.load("quadcopter", []))
    for k, sensor in enumerate(TOWARDS):
        with_rays(detector, [ground(4.0), wire(LINE, 0.5)], sensor, k)
    before = detector.wires(0.0)
    for k in range(15, 200):
        with_rays(detector, [ground(1.0)], np.array([0.0, 80.0, 30.0]), k)
    (after,) = detector.wires(0.0)
    assert after.number == before[0].number
    assert after.last_seen_ns == before[0].last_seen_ns == 14_000_000_000


def test_a_wire_that_is_there_is_not_contradicted() -> None:
    detector = WireDetector(params.load("quadcopter", []))
    for k in range(60):
        with_rays(detector, [ground(4.0), wire(LINE, 0.2)], TOWARDS[min(k, 14)], k)
    (one,) = detector.wires(0.0)
    assert one.last_seen_ns > 50_000_000_000


def test_heights_follow_the_datum() -> None:
    detector, _ = watch([ground(4.0), wire(LINE, 0.5)], TOWARDS)
    (low,), (high,) = detector.wires(0.0), detector.wires(100.0)
    np.testing.assert_allclose(high.ends_enu_m - low.ends_enu_m, [[0, 0, 100]] * 2, atol=1e-9)


def test_without_a_place_of_the_sensor_nothing_is_added() -> None:
    detector = WireDetector(params.load("quadcopter", []))
    detector.update(np.ones((50, 3)), np.full(3, np.nan), 0.0, 0)
    assert detector.wires(0.0) == ()


def test_number_of_wires_is_bounded() -> None:
    detector, _ = watch([ground(4.0), wire(LINE, 0.5)], TOWARDS)
    detector.tracked *= MOST_WIRES + 5
    lines = [Catenary(np.array([-25.0, y, 12.0]), np.array([25.0, y, 12.0]), 0.8) for y in (-8.0, -14.0)]
    rng = np.random.default_rng(1)
    for k, sensor in enumerate(TOWARDS):
        points = seen([ground(4.0), *(wire(line, 1.0) for line in lines)], sensor, rng)
        detector.update(points, sensor, 15.0 + k, (15 + k) * 1_000_000_000)
    assert len(detector.wires(0.0)) <= MOST_WIRES
