"""Objects that move over known ground, made of returns at known places and times."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from slz import LocalFrame, MovingObject, MovingObjects, Nearby, Scan
from slz.moving.groups import groups

FRAME = LocalFrame(47.0, 8.0, 400.0)
SENSOR = np.array([0.0, 0.0, 10.0])
SCAN_NS, S = 50_000_000, 1_000_000_000
ANGLE_NOISE = math.radians(0.3)
Floats = NDArray[np.float64]
Way = Callable[[float], tuple[float, float]]


def ground(height_m: float = 0.0, unknown_east_m: float = math.inf) -> Nearby:
    """Return level ground, unknown from an easting on."""
    level = np.full((120, 120), height_m, np.float32)
    level[:, np.arange(120) * 0.5 - 30.0 >= unknown_east_m] = np.nan
    return Nearby(-30.0, -30.0, 0.5, level, level.copy(), np.zeros(level.shape, bool))


def returns_of(place: tuple[float, float], rng: np.random.Generator, count: int, size_m: float) -> Floats:
    """Return returns all over a box with its middle at a place, as high as it is wide."""
    box = rng.uniform(-size_m / 2, size_m / 2, (count, 3)) + np.array([*place, size_m / 2])
    return np.asarray(box)


def scans(
    *ways: Way,
    seconds: float = 3.0,
    count: int = 6,
    size_m: float = 0.8,
    shift: Callable[[float], float] = lambda t: 0.0,
    slope: Way = lambda t: (0.0, 0.0),
    specks: int = 0,
    seed: int = 1,
) -> Iterator[Scan]:
    """Yield scans of ground and of objects on their ways."""
    rng = np.random.default_rng(seed)
    for number in range(round(seconds / 0.05)):
        start_ns = S + number * SCAN_NS
        xy = rng.uniform(-25, 25, (3000, 2))
        parts = [np.column_stack([xy, rng.normal(0, 0.02, 3000)])]
        stamps = [np.sort(rng.integers(start_ns, start_ns + SCAN_NS, 3000))]
        for way in ways:
            at_ns = np.sort(rng.integers(start_ns, start_ns + SCAN_NS, count))
            parts.append(
                np.concatenate([returns_of(way((t - S) * 1e-9), rng, 1, size_m) for t in at_ns.tolist()])
            )
            stamps.append(at_ns)
        if specks:
            parts.append(np.column_stack([rng.uniform(-15, 15, (specks, 2)), rng.uniform(0.5, 4.5, specks)]))
            stamps.append(np.sort(rng.integers(start_ns, start_ns + SCAN_NS, specks)))
        points, when = np.concatenate(parts), np.concatenate(stamps)
        order = np.argsort(when, kind="stable")
        points[:, 2] += shift(number * 0.05) + points[:, :2] @ slope(number * 0.05)
        yield Scan(points[order], when[order], SENSOR, FRAME)


def straight(from_m: tuple[float, float], velocity_ms: tuple[float, float]) -> Way:
    return lambda t: (from_m[0] + velocity_ms[0] * t, from_m[1] + velocity_ms[1] * t)


def followed(all_scans: Iterator[Scan], known: Nearby | None = None) -> list[tuple[MovingObject, ...]]:
    watch = MovingObjects(ANGLE_NOISE)
    watch.use_ground(known or ground())
    return [watch.add(scan) for scan in all_scans]


@pytest.mark.parametrize("velocity_ms", [(1.4, 0.0), (-2.0, 3.0), (0.0, -8.0), (0.9, 0.0)])
def test_what_crosses_is_found_with_its_place_and_velocity(velocity_ms: tuple[float, float]) -> None:
    way = straight((3.0, 6.0), velocity_ms)
    found = followed(scans(way, count=12))
    first = next(n for n, objects in enumerate(found) if objects)
    speed = math.hypot(*velocity_ms)
    assert first * 0.05 <= 0.6 + 1.0 / speed  # it must have gone a way that tells
    (last,) = found[-1]
    np.testing.assert_allclose(last.velocity_ms, velocity_ms, atol=0.25 + 0.1 * speed)
    np.testing.assert_allclose(last.enu_m, way((last.stamp_ns - S) * 1e-9), atol=0.4)
    assert last.height_m == pytest.approx(0.8, abs=0.1)
    assert 0.2 <= last.radius_m <= 0.8
    assert {o.number for objects in found[first:] for o in objects} == {last.number}


def test_what_stands_sways_or_is_not_there_does_not_move() -> None:
    def still(t: float) -> tuple[float, float]:
        return 4.0, 2.0

    def swaying(t: float) -> tuple[float, float]:
        return 4.0 + 0.3 * math.sin(2 * t), 2.0

    for ways in ((), (still,), (swaying,)):
        assert not any(followed(scans(*ways, seconds=6.0)))


@pytest.mark.parametrize(("specks", "seed"), [(2, 1), (10, 1), (10, 2), (25, 1), (25, 2), (30, 1)])
def test_specks_of_dust_are_no_object(specks: int, seed: int) -> None:
    assert not any(followed(scans(specks=specks, seconds=6.0, seed=seed)))


@pytest.mark.parametrize("every", [2, 10])
def test_the_report_that_shows_who_walks_does_not_hide_him(every: int) -> None:
    """Each shows him for the last second, as high as he is, over the ground of the first."""
    way = straight((-3.0, 6.0), (0.9, 0.0))
    watch, found = MovingObjects(ANGLE_NOISE), []
    for number, scan in enumerate(scans(way, count=12, size_m=1.7, seconds=5.0)):
        if number % every == 0:
            known = ground()
            for t in np.arange(number * 0.05 - 1.0, number * 0.05, 0.1) if number else ():
                row, col = (int((m + 30.0) / 0.5) for m in way(t)[::-1])
                known.top_m[row, col] = 1.7
            watch.use_ground(known)
        found.append(watch.add(scan))
    assert all(found[30:])
    np.testing.assert_allclose(found[-1][0].velocity_ms, (0.9, 0.0), atol=0.35)


def test_a_dog_far_off_is_found() -> None:
    watch = MovingObjects(math.radians(0.15))
    watch.use_ground(ground())
    found = [watch.add(scan) for scan in scans(straight((-3.0, 20.0), (2.0, 0.0)), count=4, size_m=0.55)]
    assert all(found[20:])


@pytest.mark.parametrize("seed", range(4))
def test_who_runs_is_found_within_half_a_second(seed: int) -> None:
    found = followed(scans(straight((-3.0, 6.0), (3.0, 0.0)), count=4, size_m=0.6, seconds=0.5, seed=seed))
    assert found[-1]
    np.testing.assert_allclose(found[-1][0].velocity_ms, (3.0, 0.0), atol=1.5)


def test_three_returns_are_an_object_in_clear_air_and_none_among_specks() -> None:
    rng, few = np.random.default_rng(1), np.array([[1.0, 1.0, 0.5], [1.2, 1.0, 0.6], [1.0, 1.3, 0.7]])
    air = np.column_stack([rng.uniform(-15, 15, (100, 2)), rng.uniform(0.5, 4.5, 100)])
    alone = groups(few, few[:, 2], np.arange(3) * SCAN_NS)
    assert len(alone) == 1
    among = np.concatenate([few, air[np.hypot(*(air[:, :2] - 1.0).T) > 2.0]])
    assert not groups(among, among[:, 2], np.arange(len(among)) * 1000)


def test_a_group_is_where_its_newest_returns_are() -> None:
    stamps = np.arange(40) * 10_000_000
    points = np.column_stack([stamps * 2e-9, np.zeros(40), np.full(40, 0.5)])
    (one,) = groups(points, points[:, 2], stamps)
    assert one.stamp_ns > stamps[-1] - 60_000_000
    np.testing.assert_allclose(one.enu_m, (one.stamp_ns * 2e-9, 0.0), atol=0.01)
    assert one.radius_m == pytest.approx(0.39, abs=0.1)


def test_a_jump_of_all_heights_is_no_object() -> None:
    assert not any(followed(scans(shift=lambda t: 0.0 if t < 1 else 1.5)))
    rising = followed(scans(straight((3.0, 6.0), (1.4, 0.0)), shift=lambda t: 0.3 * t))
    assert len(rising[-1]) == 1


def turning_slope(t: float) -> tuple[float, float]:
    """Return the slope that all ground has where the mount is off by 3 degrees and the vehicle turns."""
    return 0.052 * math.cos(0.3 * t), 0.052 * math.sin(0.3 * t)


@pytest.mark.parametrize("seed", range(3))
def test_a_tilt_of_all_ground_is_no_object_and_hides_none(seed: int) -> None:
    assert not any(followed(scans(slope=turning_slope, seconds=6.0, seed=seed)))
    walker = straight((3.0, 6.0), (1.4, 0.0))
    (found,) = followed(scans(walker, slope=turning_slope, count=12, seed=seed))[-1]
    np.testing.assert_allclose(found.velocity_ms, (1.4, 0.0), atol=0.4)
    assert found.height_m == pytest.approx(0.8, abs=0.15)


def test_over_unknown_ground_nothing_is_told() -> None:
    assert not any(followed(scans(straight((3.0, 6.0), (1.4, 0.0))), ground(unknown_east_m=2.0)))
    watch = MovingObjects(ANGLE_NOISE)
    assert not any(watch.add(scan) for scan in scans(straight((3.0, 6.0), (1.4, 0.0))))


def test_what_is_on_the_map_does_not_move() -> None:
    """A hedge beside which the map's edge is not certain."""
    known = ground()
    known.top_m[70:76, :] = 1.0  # north of 5 m
    assert not any(followed(scans(straight((0.0, 5.2), (1.4, 0.0))), known))


def test_two_keep_their_numbers_where_their_ways_cross() -> None:
    found = followed(scans(straight((-6.0, 0.3), (3.0, 0.0)), straight((0.0, -6.0), (0.0, 2.0)), seconds=4.0))
    numbers = [sorted(o.number for o in objects) for objects in found if objects]
    assert len(numbers[-1]) == 2
    assert set(itertools.chain.from_iterable(numbers)) == set(numbers[-1])
    east = max(found[-1], key=lambda o: float(o.enu_m[0]))
    np.testing.assert_allclose(east.velocity_ms, (3.0, 0.0), atol=0.6)


def test_it_is_dropped_soon_after_its_last_return() -> None:
    watch = MovingObjects(ANGLE_NOISE)
    watch.use_ground(ground())
    moving = list(scans(straight((-3.0, 6.0), (2.0, 0.0))))
    for scan in moving:
        watch.add(scan)
    assert watch.found
    for scan in list(scans(seconds=5.0))[len(moving) :]:
        watch.add(scan)
    assert not watch.found


def test_the_order_of_returns_within_a_scan_does_not_matter() -> None:
    def mixed(scan: Scan) -> Scan:
        order = np.random.default_rng(3).permutation(len(scan))
        return Scan(scan.points_enu_m[order], scan.stamp_ns, scan.sensor_enu_m, scan.frame)

    def still(t: float) -> tuple[float, float]:
        return 2.0 + 1.4 * round(t / 0.05) * 0.05, 5.0  # at one place for the whole of a scan

    one = followed(scans(still))[-1]
    other = followed(map(mixed, scans(still)))[-1]
    np.testing.assert_allclose(one[0].velocity_ms, other[0].velocity_ms, atol=0.1)


def test_a_new_frame_and_a_clock_set_back_begin_anew() -> None:
    watch = MovingObjects(ANGLE_NOISE)
    watch.use_ground(ground())
    for scan in scans(straight((-3.0, 6.0), (2.0, 0.0))):
        watch.add(scan)
    assert watch.found
    first = next(scans())
    elsewhere = Scan(first.points_enu_m, first.stamp_ns + 60 * S, SENSOR, LocalFrame(47.1, 8.0, 400.0))
    assert not watch.add(elsewhere)
    assert not watch.add(first)


def test_the_least_distance_within_a_time_is_that_of_the_straight_way() -> None:
    one = MovingObject(1, S, np.array([-4.0, 1.0]), np.array([2.0, 0.0]), 0.3, 1.7)
    assert one.nearest(np.zeros(2), S, 4 * S) == (pytest.approx(1.0), 3 * S)
    assert one.nearest(np.zeros(2), S, 2 * S) == (pytest.approx(math.hypot(2, 1)), 2 * S)
    assert one.nearest(np.zeros(2), 5 * S, 9 * S) == (pytest.approx(math.hypot(4, 1)), 5 * S)
    assert one.at(2 * S).tolist() == [-2.0, 1.0]
