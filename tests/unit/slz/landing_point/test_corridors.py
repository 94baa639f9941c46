"""Corridors of a point over made ground: what blocks them, what was not seen, and what changes neither."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import Grid, LocalFrame, Pipeline, Window
from slz.landing_point.corridors import BEARINGS, Corridors, corridors
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE

FRAME = LocalFrame(47.0, 8.0, 400.0)
NORTH, EAST, SOUTH, WEST = 0, 18, 36, 54
PLACES = 4 * ((0, 0), (12, 0), (-12, 0), (0, 12), (0, -12))
SURVEY = ["survey_height_m=15", "zone_m=100", "adaptive=off"]
ON_REQUEST = pytest.mark.bench  # for their time
Floats = NDArray[np.float64]


def wall(points: Floats, sensor: Floats, north_m: float, height_m: float, east_m: float = 20.0) -> Floats:
    """Return the returns with those behind a wall across the north moved onto it."""
    out, way = points.copy(), points - sensor
    share = (north_m - sensor[1]) / way[:, 1]
    at = sensor + share[:, None] * way
    hit = (share > 0) & (share < 1) & (at[:, 2] < height_m) & (at[:, 2] > 0) & (np.abs(at[:, 0]) < east_m)
    out[hit] = at[hit]
    return out


@cache
def judged(
    walls: tuple[tuple[float, float, float], ...] = (),
    turn: int = 0,
    shift: tuple[float, float, float] = (0, 0, 0),
    reach_m: float = 34.0,
    seed: int = 1,
) -> Corridors:
    """Return the corridors of the middle of level ground, seen from 15 m at five places, with walls.

    Parameters
    ----------
    walls
        Place north, height and half width of each (m).
    turn
        Quarter turns clockwise, and shift of everything.
    """
    rng = np.random.default_rng(seed)
    pipeline = Pipeline(params.load("quadcopter", SURVEY), (shift[0], shift[1]))
    moved = np.array(shift)

    def turned(enu: Floats) -> Floats:
        out = enu.copy()
        for _ in range(turn):
            out[:, 0], out[:, 1] = out[:, 1].copy(), -out[:, 0]
        return np.ascontiguousarray(out + moved)

    for k, place in enumerate(PLACES):
        sensor = np.array([*place, 15.0])
        points = np.column_stack([rng.uniform(-reach_m, reach_m, (60_000, 2)), rng.normal(0, 0.01, 60_000)])
        for one in walls:
            points = wall(points, sensor, *one)
        stamps = k * 10**9 + np.linspace(0, 9e8, len(points)).astype(np.int64)
        place_enu = turned(sensor[np.newaxis])
        window = Window(
            points_enu_m=turned(points),
            stamp_ns=stamps,
            sensor_enu_m=place_enu[0],
            frame=FRAME,
            start_ns=int(stamps[0]),
            end_ns=int(stamps[-1]),
            origin=np.zeros(len(points), np.uint16),
            origins_enu_m=place_enu,
        )
        pipeline.process(window)
    pipeline.select(np.array([0.1, 0.1, 0.0]) + moved)
    assert pipeline.selected is not None
    found = pipeline.selected.corridors
    assert found is not None
    return found


def test_all_ways_over_open_ground_that_was_seen_are_clear() -> None:
    found = judged()
    assert found.overhead == SAFE
    assert (found.states == SAFE).all()
    assert (found.clear_slope_deg == found.slopes_deg[0]).all()


def test_a_wall_blocks_the_slopes_that_do_not_pass_over_it() -> None:
    found = judged(walls=((8.0, 5.0, 20.0),))
    assert found.clear_slope_deg[NORTH] in (45.0, 60.0)
    assert 40 < found.least_deg[NORTH] < 60
    assert found.obstacles_enu_m[NORTH, 1] == pytest.approx(8.0, abs=1.1)  # half a cell of the far map
    assert found.obstacles_enu_m[NORTH, 2] == pytest.approx(5.0, abs=0.3)
    assert found.clear_slope_deg[SOUTH] == found.slopes_deg[0]
    assert found.overhead == SAFE


@pytest.mark.parametrize(("height_m", "found"), [(0.8, UNKNOWN), (5.0, UNSAFE)])
def test_what_the_far_map_alone_holds_over_a_gap_in_safe_ground_is_an_obstacle_if_it_is_high(
    height_m: float, found: int
) -> None:
    """An error of the attitude lifts returns from far away. A gap that counts as seen to land on, is seen."""
    parameters, rng = params.load("quadcopter"), np.random.default_rng(1)
    ground = np.column_stack([rng.uniform(-12, 12, (60_000, 2)), rng.normal(0, 0.01, 60_000)])
    lifted = np.array([[2.1, 0.1, height_m]] * 30)
    with_gap = ground[(np.abs(ground[:, :2] - (2.1, 0.1)) > 0.1).any(axis=1)]
    terrains = []
    for cell_m, points in ((0.2, with_gap), (1.0, np.concatenate([ground, lifted]))):
        side = round(40 / cell_m)
        terrains.append(EvidenceTerrain(Grid(-20.0, -20.0, cell_m, side, side), parameters))
        terrains[-1].add(points, np.array([0.0, 0.0, 15.0]), 1.0)
    near, far = terrains
    point = np.array([0.1, 0.1, 0.0])
    assert corridors(point, near, far, None, parameters).overhead == found
    assert corridors(point, far, far, None, parameters).overhead == UNSAFE


def test_air_that_was_not_seen_is_not_clear() -> None:
    found = judged(reach_m=6.0)
    assert found.overhead == SAFE
    assert (found.states[:, 0] == UNKNOWN).all()


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=ON_REQUEST) for seed in (1, 2))])
def test_a_further_obstacle_clears_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = (float(rng.uniform(4, 15)), float(rng.uniform(1, 8)), float(rng.uniform(1, 10)))
    second = (float(rng.uniform(-9, -4)), float(rng.uniform(5, 8)), float(rng.uniform(1, 10)))
    before, after = judged(walls=(first,)), judged(walls=(first, second))
    assert not ((after.states == SAFE) & (before.states == UNSAFE)).any()
    assert (after.states == UNSAFE).sum() > (before.states == UNSAFE).sum()


@pytest.mark.parametrize("turn", [1, 2, 3])
def test_bearings_turn_with_the_world(turn: int) -> None:
    walls = ((8.0, 5.0, 6.0),)
    before, after = judged(walls), judged(walls, turn=turn)
    turned = np.roll(before.states, turn * BEARINGS // 4, axis=0)
    assert (after.states != turned).mean() < 0.08  # cells and voxels do not turn with it


def test_a_shift_of_the_world_changes_nothing() -> None:
    walls = ((8.0, 5.0, 6.0),)
    before, after = judged(walls), judged(walls, shift=(40.0, -64.0, 32.0))
    assert (after.states != before.states).mean() < 0.01
    np.testing.assert_allclose(after.least_deg, before.least_deg, atol=0.5)


def test_the_order_of_points_changes_nothing_but_the_rays_followed() -> None:
    walls = ((8.0, 5.0, 6.0),)
    before, after = judged(walls), judged(walls, seed=2)
    assert (after.states != before.states).mean() < 0.03
