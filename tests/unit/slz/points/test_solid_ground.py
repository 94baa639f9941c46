"""Windows are registered to solid ground alone: into plants, each look reaches to another depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import LocalFrame, Pipeline, Scan, join
from slz.kernels.points.repeatability import bounds, over_blocks, rows_by_span, spread_of_blocks

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
FRAME = LocalFrame(47.0, 8.0, 400.0)
UP_M, STEP_M = 15.0, 4.0  # height of the sensor, and its way in a window
WINDOWS, SCANS, RETURNS = 16, 10, 1500  # returns of a scan


@dataclass(frozen=True)
class Crop:
    """Leaves over level ground, which a beam meets by the law of Beer and Lambert; `where` they stand."""

    height_m: float
    extinction_per_m: float
    where: Callable[[Floats, Floats], Flags] = lambda x, _: np.ones(len(x), bool)


MAIZE, WHEAT, MEADOW = Crop(2.0, 0.8), Crop(0.7, 2.3), Crop(0.15, 6.7)
BARE = Crop(0.0, 1.0)


def still(_: float) -> Floats:
    return np.zeros(3)


def returns(rng: np.random.Generator, east_m: float, crop: Crop) -> Floats:
    """Return returns of a sensor that looks ahead to the east, where leaves are met higher, and down."""
    elevation, azimuth = rng.uniform(np.radians(45), np.radians(90), RETURNS), rng.uniform(-1.6, 1.6, RETURNS)
    down, out = np.sin(elevation), np.cos(elevation)
    top = (UP_M - crop.height_m) / down + rng.exponential(1 / crop.extinction_per_m, RETURNS)
    whole = UP_M / down
    far = out * whole
    grown = crop.where(east_m + far * np.cos(azimuth), far * np.sin(azimuth))
    length = np.where(grown, np.minimum(top, whole), whole) + rng.normal(0, 0.015, RETURNS)
    way = np.column_stack([out * np.cos(azimuth), out * np.sin(azimuth), -down])
    return np.array([east_m, 0.0, UP_M]) + way * length[:, np.newaxis]


def flown(
    crop: Crop, error: Callable[[float], Floats] = still, *settings: str, step_m: float = STEP_M
) -> Pipeline:
    """Fly east over a crop; `error` gives height and slopes of the estimate by the share of the flight."""
    own = ["zone_m=200", "min_boundary_points=10", "gear=none", "adaptive=off", *settings]
    pipeline, rng = Pipeline(params.load("quadcopter", own), (40.0, 0.0)), np.random.default_rng(1)
    for window in range(WINDOWS):
        scans = []
        for scan in range(SCANS):
            at = window + scan / SCANS
            east_m = at * step_m
            points = returns(rng, east_m, crop)
            off = error(at / WINDOWS)
            points[:, 2] += off[0] + (points[:, :2] - (east_m, 0.0)) @ off[1:]
            start = (window * SCANS + scan) * 200_000_000
            stamps = start + np.linspace(0, 1.9e8, len(points)).astype(np.int64)
            scans.append(Scan(points, stamps, np.array([east_m, 0.0, UP_M + off[0]]), FRAME))
        pipeline.process(join(scans))
    return pipeline


def heights(pipeline: Pipeline) -> tuple[Floats, Floats, Floats]:
    """Return east, north and height of the cells of the near map, those of unknown height left out."""
    maps = pipeline.maps(which="near")
    assert maps is not None
    row, col = np.nonzero(np.isfinite(maps.height_m))
    east = maps.grid.west_m + (col + maps.box.col0 + 0.5) * maps.grid.cell_m
    north = maps.grid.south_m + (row + maps.box.row0 + 0.5) * maps.grid.cell_m
    return east, north, maps.height_m[row, col].astype(np.float64)


def plane(east: Floats, north: Floats, up: Floats) -> Floats:
    """Return mean height, and slopes to the east and to the north."""
    design = np.column_stack([np.ones(len(up)), east - east.mean(), north - north.mean()])
    return np.asarray(np.linalg.lstsq(design, up, rcond=None)[0])


@pytest.mark.parametrize("crop", [MAIZE, WHEAT, MEADOW])
def test_a_map_of_plants_stays_where_exact_navigation_puts_it(crop: Crop) -> None:
    (east, north, up), (_, _, by_navigation) = (
        heights(flown(crop)),
        heights(flown(crop, still, "register_m=0")),
    )
    error = plane(east, north, up - by_navigation)
    assert abs(error[0]) < 0.02
    assert np.hypot(*error[1:]) < np.radians(0.1)


def drift(share: float) -> Floats:
    return np.array([0.4 * share, 0.0, 0.0])


def test_a_road_through_a_crop_tells_the_drift() -> None:
    """A road of 3 m is as high in the map as the newest estimate says."""
    crop = Crop(2.0, 0.8, lambda _, north: np.abs(north) > 1.5)

    def error_m(*own: str) -> float:
        _, north, up = heights(flown(crop, drift, *own, step_m=0.2))
        return float(np.abs(up[np.abs(north) < 1.2] - 0.4).mean())

    assert error_m() < 0.03 < 0.1 < error_m("register_m=0")


def test_a_road_through_a_crop_tells_the_tilt_along_it() -> None:
    crop = Crop(2.0, 0.8, lambda _, north: np.abs(north) > 1.5)
    tilt = np.radians(0.6)

    def pitch(share: float) -> Floats:
        return np.array([0.0, tilt * np.sin(20 * share), 0.0])

    def unevenness_m(*own: str) -> float:
        east, north, up = heights(flown(crop, pitch, *own, step_m=0.2))
        road = np.abs(north) < 1.2
        mean, *slopes = plane(east[road], north[road], up[road])
        level = slopes[0] * (east[road] - east[road].mean()) + slopes[1] * (north[road] - north[road].mean())
        return float((up[road] - mean - level).std())

    assert unevenness_m() < 0.016 < 0.025 < unevenness_m("register_m=0")


def test_drift_over_a_meadow_is_followed_but_for_the_depth_of_its_grass() -> None:
    """The mean look reaches to 0.05 m over the ground; a fifth of the depth of grass tells nothing."""

    def error_m(*own: str) -> float:
        _, _, up = heights(flown(MEADOW, drift, *own, step_m=0.2))
        return abs(float(up.mean()) - 0.4 - 0.05)

    assert error_m() < 0.03 < 0.1 < error_m("register_m=0")


def test_scans_over_plants_do_not_sway() -> None:
    """Every scan of a crop has its own mean, yet the map is the one without registration."""
    (_, _, up), (_, _, by_navigation) = heights(flown(WHEAT)), heights(flown(WHEAT, still, "register_m=0"))
    np.testing.assert_allclose(up, by_navigation, atol=1e-4)


def differences(rng: np.random.Generator, spread_m: Floats) -> Floats:
    """Return differences over two blocks of 1 m: one in each, with a spread for each."""
    n = 4000
    place = rng.uniform(0, (2, 1), (n, 2))
    return np.column_stack([place, rng.normal(0, 1, n) * spread_m[place[:, 0].astype(int)], np.arange(n)])


def test_the_spread_of_a_block_is_that_of_its_returns() -> None:
    found = differences(np.random.default_rng(1), np.array([0.02, 0.5]))
    spread = spread_of_blocks(found, 0.0, 0.0, 1.0, 1, 3, 4)
    np.testing.assert_allclose(spread, [[0.02, 0.5, np.nan]], rtol=0.05)


def test_a_slow_sway_of_the_vehicle_is_no_spread() -> None:
    found = differences(np.random.default_rng(2), np.array([0.02, 0.02]))
    found[:, 2] += 0.1 * np.sin(np.linspace(0, 20, len(found)))
    np.testing.assert_allclose(spread_of_blocks(found, 0.0, 0.0, 1.0, 1, 2, 4), 0.02, rtol=0.05)


@pytest.mark.parametrize(("n", "known"), [(5, True), (4, False)])
def test_a_block_needs_four_pairs_of_returns(n: int, known: bool) -> None:
    found = np.column_stack([np.full((n, 2), 0.5), np.zeros(n), np.arange(n)])
    assert np.isfinite(spread_of_blocks(found, 0.0, 0.0, 1.0, 1, 1, 4)[0, 0]) == known


def corners() -> Iterator[tuple[float, float, bool]]:
    yield 10.0, 20.0, True
    yield 11.99, 21.99, True
    yield 12.0, 20.0, False  # not solid
    yield 9.99, 20.0, False
    yield 10.0, 19.99, False
    yield 10.0, 22.0, False
    yield 14.0, 20.0, False
    yield 1e12, 1e12, False


def test_a_point_is_over_the_block_around_it() -> None:
    points = np.array([(east, north, 0.0) for east, north, _ in corners()])
    order = np.arange(len(points))[::-1].copy()
    on = over_blocks(points, order, 10.0, 20.0, 2.0, np.array([[True, False]]))
    assert on[::-1].tolist() == [inside for *_, inside in corners()]


@pytest.mark.parametrize("seed", range(6))
def test_rows_of_spans_over_solid_ground(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, used = rng.uniform(-1, 11, (900, 3)), np.sort(rng.permutation(900)[:700])
    scan, blocks = rng.integers(0, 7, 900).astype(np.uint16), rng.random((5, 5)) < 0.6 * (seed > 0)
    of_scan = np.array([0, 0, 1, 1, 2, 4, 4])
    rows, spans, count = rows_by_span(points, used, scan, of_scan, 5, 30, 0.0, 0.0, 2.0, blocks)
    at = np.floor(points[:, [1, 0]] / 2.0).astype(int)
    solid = np.asarray(((at >= 0) & (at < 5)).all(axis=1))
    solid[solid] = blocks[tuple(at[solid].T)]
    expected = [(used[of_scan[scan[used]] == span]) for span in range(5)]
    over = [own[solid[own]] for own in expected]
    assert count.tolist() == [[len(own) for own in expected], [len(own) for own in over]]
    chosen = [own[:: max(1, len(own) // 30)] for own in over]
    np.testing.assert_array_equal(rows, np.concatenate(chosen))
    np.testing.assert_array_equal(spans, np.repeat(np.arange(5), [len(own) for own in chosen]))
    found = rng.uniform(-9, 9, (50, 4))
    west, south, wide, high = bounds(found)
    np.testing.assert_array_equal([west, south], found[:, :2].min(axis=0))
    np.testing.assert_array_equal([wide, high], np.ptp(found[:, :2], axis=0))
