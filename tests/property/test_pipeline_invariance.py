"""Properties of default mode over any ground: invariance, monotony, and that unknown is never safe.

All coordinates are odd multiples of 1/2048 m and cells are 0.25 m, so that no point is on the edge of a
cell and shifts by whole cells are exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

import params
from slz import SAFE, LocalFrame, Pipeline, Report, Window

Floats = NDArray[np.float64]
States = NDArray[np.uint8]
FRAME = LocalFrame(47.0, 8.0, 400.0)
CELL_M, ZONE_M, HALF_M = 0.25, 24.0, 8.0
SETTINGS = [f"cell_m={CELL_M}", f"zone_m={ZONE_M}", "min_boundary_points=10", "register_m=0"]
# Registration moves a whole window by what most returns say, by parts of a millimetre too.
PARAMETERS = params.load("quadcopter", SETTINGS)
SENSOR = np.array([0.0, 0.0, 20.0])
FOOTPRINT_CELLS = int(PARAMETERS.footprint_m / 2 / CELL_M)

seeds = st.integers(0, 10_000)
few = settings(max_examples=30, deadline=None)


def exact(points: Floats) -> Floats:
    return np.asarray((np.floor(points * 1024) + 0.5) / 1024)


def box_of_returns(
    rng: np.random.Generator, east: float, north: float, side: float, height: float, n: int
) -> Floats:
    xy = rng.uniform(-side / 2, side / 2, (n, 2)) + np.array([east, north])
    return np.column_stack([xy, np.full(n, height) - rng.uniform(0, 0.05, n)])


def scene(seed: int, density: float = 25.0) -> Floats:
    """Ground with a gentle or steep slope on one half, boxes, a ditch, and a place without returns."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-HALF_M, HALF_M, (round(density * 4 * HALF_M**2), 2))
    bank = np.tan(np.radians(rng.choice([0.0, 5.0, 20.0])))
    z = bank * np.maximum(0, xy[:, 0] - rng.uniform(-4, 4)) + rng.normal(0, 0.02, len(xy))
    z[np.abs(xy[:, 1] - rng.uniform(-6, 6)) < 0.4] -= rng.choice([0.0, 0.6])
    pond = np.hypot(*(xy - rng.uniform(-6, 6, 2)).T) < rng.choice([0.0, 1.5])
    ground = np.column_stack([xy, z])[~pond]
    boxes = []
    for side in rng.uniform(0.3, 2.0, rng.integers(0, 4)):
        n = 30 + round(40 * side**2)
        boxes.append(box_of_returns(rng, *rng.uniform(-7, 7, 2), side, rng.uniform(0.2, 2.5), n))
    return exact(np.vstack([ground, *boxes]))


@dataclass
class Answer:
    """The report and the state of every cell of the zone."""

    report: Report
    state: States


def answer(
    clouds: Floats | list[Floats], sensor: Floats = SENSOR, centre: tuple[float, float] = (0.0, 0.0)
) -> Answer:
    pipe = Pipeline(PARAMETERS, centre)
    for second, points in enumerate(clouds if isinstance(clouds, list) else [clouds]):
        start = second * 10**9
        stamps = np.full(len(points), start, np.int64)
        report = pipe.process(Window(points, stamps, sensor, FRAME, start, start))
    maps = pipe.maps(report.grid.everything)
    assert maps is not None
    return Answer(report, maps.state)


def zones(one: Answer) -> list[NDArray[np.bool_]]:
    """The cells of every zone, in the whole grid, in raster order."""
    found = []
    for zone in one.report.zones:
        cells = np.zeros(one.state.shape, bool)
        cells[zone.box.slices] = zone.cells == 1
        found.append(cells)
    return sorted(found, key=lambda cells: int(np.argmax(cells)))


def holds_a_point(points: Floats, centre: Floats) -> bool:
    """Tell whether a cell was hit."""
    return bool((np.abs(points[:, :2] - centre) < CELL_M / 2).all(axis=1).any())


def no_cell_safer(before: Answer, after: Answer) -> None:
    assert not ((before.state != SAFE) & (after.state == SAFE)).any()


@few
@given(seeds)
def test_the_order_of_points_does_not_matter(seed: int) -> None:
    points = scene(seed)
    one, two = answer(points), answer(np.random.default_rng(seed).permutation(points))
    np.testing.assert_array_equal(one.state, two.state)
    for mine, theirs in zip(zones(one), zones(two), strict=True):
        np.testing.assert_array_equal(mine, theirs)


@few
@given(seeds, st.integers(-4000, 4000), st.integers(-4000, 4000))
def test_a_shift_by_whole_cells_shifts_the_zones(seed: int, right: int, up: int) -> None:
    points, shift = scene(seed), np.array([right * CELL_M, up * CELL_M, 0.0])
    one = answer(points)
    two = answer(points + shift, SENSOR + shift, (shift[0], shift[1]))
    np.testing.assert_array_equal(one.state, two.state)
    assert two.report.grid.west_m == one.report.grid.west_m + shift[0]
    assert two.report.grid.south_m == one.report.grid.south_m + shift[1]
    for mine, theirs in zip(one.report.zones, two.report.zones, strict=True):
        assert theirs.box == mine.box
        np.testing.assert_array_equal(theirs.cells, mine.cells)
        np.testing.assert_allclose(theirs.best.enu_m, mine.best.enu_m + shift, atol=1e-6)
        np.testing.assert_allclose(theirs.corners_enu_m, mine.corners_enu_m + shift, atol=1e-6)
        assert theirs.best.certainty == mine.best.certainty


@few
@given(seeds)
def test_the_mirror_image_has_the_mirrored_zones(seed: int) -> None:
    """Where no return is alone: the voxels of company begin at the westernmost return, not at its mirror."""
    points = scene(seed)
    one, two = answer(points), answer(points * [-1, 1, 1])
    assume(one.report.n_used == two.report.n_used == len(points))
    np.testing.assert_array_equal(two.state[:, ::-1], one.state)
    assert len(one.report.zones) == len(two.report.zones)
    for field in ("n_safe", "n_unsafe", "n_uncertain", "area_m2"):
        counts = [sorted(getattr(zone, field) for zone in a.report.zones) for a in (one, two)]
        assert counts[0] == counts[1]


@few
@given(seeds, st.sampled_from([-300.0, -2.5, 64.0, 1500.0]))
def test_the_height_of_the_ground_does_not_matter(seed: int, offset_m: float) -> None:
    points, offset = scene(seed), np.array([0.0, 0.0, offset_m])
    one, two = answer(points), answer(points + offset, SENSOR + offset)
    np.testing.assert_array_equal(one.state, two.state)


@few
@given(seeds, st.integers(-30, 29), st.integers(-30, 29), st.floats(0.4, 3.0), st.integers(3, 30))
def test_an_obstacle_makes_no_cell_safer(seed: int, row: int, col: int, height_m: float, n: int) -> None:
    """Returns of something at least 0.4 m above the ground, all in one cell of ground that was seen."""
    rng = np.random.default_rng(seed)
    points = scene(seed)
    place = (np.array([col, row]) + 0.5) * CELL_M
    near = np.hypot(*(points[:, :2] - place).T) < 0.5
    assume(holds_a_point(points, place))
    top = float(points[near, 2].max()) + height_m
    xy = place + rng.uniform(-0.45, 0.45, (n, 2)) * CELL_M
    obstacle = exact(np.column_stack([xy, np.full(n, top) + rng.uniform(0, 0.1, n)]))
    before, after = answer(points), answer(np.vstack([points, obstacle]))
    no_cell_safer(before, after)
    grid = after.report.grid
    at_row, at_col = grid.index(*place)
    reach = FOOTPRINT_CELLS
    assert not (
        after.state[at_row - reach : at_row + reach + 1, at_col - reach : at_col + reach + 1] == SAFE
    ).any()


@few
@given(seeds, st.integers(-28, 28), st.integers(-28, 28))
def test_an_obstacle_that_arrives_makes_no_cell_safer(seed: int, row: int, col: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = scene(seed), scene(seed, density=12.0)
    place = (np.array([col, row]) + 0.5) * CELL_M
    assume(holds_a_point(first, place))
    obstacle = exact(box_of_returns(rng, *place, 0.2, 4.0, 12))
    no_cell_safer(answer([first, second]), answer([first, np.vstack([second, obstacle])]))


@few
@given(seeds, st.floats(-6, 6), st.floats(-6, 6))
def test_a_disc_without_returns_makes_no_cell_safe(seed: int, east: float, north: float) -> None:
    """On ground without a slope near the limit, where fewer cells would tilt the plane over it."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-HALF_M, HALF_M, (6400, 2))
    points = [np.column_stack([xy, rng.normal(0, 0.02, len(xy))])]
    for _ in range(3):  # boxes clear of the rim: what stands in a gap narrower than coverage_m is not seen
        box_e, box_n = rng.uniform(-7, 7, 2)
        if abs(np.hypot(box_e - east, box_n - north) - 2.5) > 1.0:
            points.append(box_of_returns(rng, box_e, box_n, 0.5, rng.uniform(0.5, 2), 25))
    cloud = exact(np.vstack(points))
    from_centre = np.hypot(cloud[:, 0] - east, cloud[:, 1] - north)
    before, after = answer(cloud), answer(cloud[from_centre > 2.5])
    no_cell_safer(before, after)
    rows, cols = np.mgrid[: after.state.shape[0], : after.state.shape[1]]
    grid = after.report.grid
    centre_e, centre_n = grid.west_m + (cols + 0.5) * CELL_M, grid.south_m + (rows + 0.5) * CELL_M
    bare = np.hypot(centre_e - east, centre_n - north) < 2.5 - CELL_M
    assert not (after.state[bare] == SAFE).any()


@few
@given(seeds, st.sampled_from([2.0, 4.0, 8.0, 25.0]), st.lists(st.floats(0.3, 1.6), max_size=6))
def test_a_cell_with_a_wide_enough_unseen_hole_in_its_footprint_is_not_safe(
    seed: int, density: float, holes: list[float]
) -> None:
    rng = np.random.default_rng(seed)
    points = scene(seed, density)
    for side in holes:
        offset = np.abs(points[:, :2] - rng.uniform(-6, 6, 2)).max(axis=1)
        points = points[offset > side / 2]
    found = answer(points)
    grid = found.report.grid
    unseen = np.ones(found.state.shape, bool)
    row = np.floor((points[:, 1] - grid.south_m) / CELL_M).astype(int)
    col = np.floor((points[:, 0] - grid.west_m) / CELL_M).astype(int)
    unseen[row, col] = False
    wide = int(PARAMETERS.coverage_m / CELL_M) + 1
    hole = ndimage.binary_opening(np.pad(unseen, wide, constant_values=True), np.ones((wide, wide)))
    footprint = 2 * FOOTPRINT_CELLS + 1
    near = ndimage.binary_dilation(hole, np.ones((footprint, footprint)))[wide:-wide, wide:-wide]
    assert not (found.state[near] == SAFE).any()


@pytest.mark.parametrize("seed", range(3))
def test_the_scenes_are_partly_safe(seed: int) -> None:
    """Else the tests above would say nothing."""
    state = answer(scene(seed)).state
    assert 300 < (state == SAFE).sum() < 0.9 * (2 * HALF_M / CELL_M) ** 2


# ---- far from where it began --------------------------------------------------------------------

DIRECTIONS = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
FAR_STEP_M = 6.0


@cache
def flown(east: int, north: int, seconds: int, *, obstacle: bool = False) -> tuple[Pipeline, Report]:
    """Fly over level ground in a straight line, many zones far; at the end something may stand below."""
    pipe = Pipeline(PARAMETERS)
    for second in range(seconds):
        rng = np.random.default_rng(second)
        at = FAR_STEP_M * second * np.array([east, north, 0.0])
        points = rng.uniform(-HALF_M, HALF_M, (6000, 3)) * [1, 1, 0] + rng.normal(0, 0.02, (6000, 3)) * [
            0,
            0,
            1,
        ]
        if obstacle and second == seconds - 1:
            points = np.vstack([points, box_of_returns(rng, 0.0, 0.0, 2.0, 1.5, 400)])
        start = second * 10**9
        window = Window(
            exact(points + at), np.full(len(points), start, np.int64), SENSOR + at, FRAME, start, start
        )
        report = pipe.process(window)
    return pipe, report


@pytest.mark.parametrize(("east", "north"), DIRECTIONS)
@pytest.mark.parametrize("which", ["near", "far"])
def test_ground_is_mapped_however_far_and_in_whatever_direction_it_lies_from_the_first(
    east: int, north: int, which: Literal["near", "far"]
) -> None:
    pipe, report = flown(east, north, 16)
    here = 15 * FAR_STEP_M * np.array([east, north])
    assert _state_at(pipe, which, here) == SAFE
    assert report.zones
    assert min(np.hypot(*(zone.best.enu_m[:2] - here)) for zone in report.zones) < 2 * HALF_M


@pytest.mark.parametrize(("east", "north"), DIRECTIONS)
def test_what_arrives_there_is_unsafe_at_once(east: int, north: int) -> None:
    pipe, _ = flown(east, north, 16, obstacle=True)
    assert _state_at(pipe, "near", 15 * FAR_STEP_M * np.array([east, north])) != SAFE


def _state_at(pipe: Pipeline, which: Literal["near", "far"], place: Floats) -> int:
    maps = pipe.maps(which=which)
    assert maps is not None
    row, col = maps.grid.index(float(place[0]), float(place[1]))
    return int(maps.state[row - maps.box.row0, col - maps.box.col0])
