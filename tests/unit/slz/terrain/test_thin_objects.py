"""Thin objects among clutter, over flat ground that is hit 20 or 100 times per square metre."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import Pipeline, Window
from slz.frame import LocalFrame
from slz.grid import Box
from slz.terrain.terrain_maps import SAFE, UNSAFE
from slz.terrain.thin_objects import ThinObjects
from slz.terrain.tiles import Noise, Tiles

FRAME = LocalFrame(47.0, 8.0, 400.0)
HALF_M = 9.0
SENSOR = np.array([0.0, 0.0, 25.0])
Floats = NDArray[np.float64]


def ground(per_m2: float, seed: int = 1) -> Floats:
    rng = np.random.default_rng(seed)
    n = round(per_m2 * (2 * HALF_M) ** 2)
    return np.column_stack([rng.uniform(-HALF_M, HALF_M, (n, 2)), rng.normal(0, 0.02, n)])


def dust(n: int, seed: int = 2) -> Floats:
    """Specks up to 2 m above and below the ground, each alone."""
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.6, 2.0, n) * rng.choice([-1, 1], n)
    return np.column_stack([rng.uniform(-HALF_M, HALF_M, (n, 2)), height])


def fly(windows: list[Floats], *own: str, pipe: Pipeline | None = None, span_s: float = 5.0) -> Pipeline:
    """Process windows that end `span_s` after the first begins."""
    settings = ["zone_m=40", "min_boundary_points=10", "register_m=0", "adaptive=off", *own]
    pipe = pipe or Pipeline(params.load("quadcopter", settings), (0.0, 0.0))
    for k, points in enumerate(windows):
        stamps = np.full(len(points), round(k * span_s / len(windows) * 1e9), np.int64)
        pipe.process(
            Window(np.ascontiguousarray(points), stamps, SENSOR, FRAME, int(stamps[0]), int(stamps[0]))
        )
    return pipe


def state_at(pipe: Pipeline, east: float, north: float) -> int:
    maps = pipe.maps()
    assert maps is not None
    row, col = maps.grid.index(east, north)
    return int(maps.state[row - maps.box.row0, col - maps.box.col0])


def cut(points: Floats, windows: int, seed: int = 3) -> list[Floats]:
    order = np.random.default_rng(seed).permutation(len(points))
    return np.array_split(points[order], windows)


POLE = np.array([[2.0, 1.0, 1.4], [2.05, 1.03, 0.7]])
WIRE = np.array([[-5.0 + 1.2 * k, 4.0, 5.0] for k in range(8)])
HOLE = np.array([[-3.0, -3.0, -1.5], [-2.9, -3.1, -0.7]])


@pytest.mark.parametrize("windows", [1, 5, 20])
@pytest.mark.parametrize("hits", [POLE, HOLE], ids=["pole", "hole"])
def test_two_hits_at_one_place_are_an_object_however_the_returns_are_cut(hits: Floats, windows: int) -> None:
    pipe = fly(cut(np.vstack([ground(20.0), dust(20), hits]), windows))
    assert state_at(pipe, *hits[0, :2].tolist()) == UNSAFE


@pytest.mark.parametrize("windows", [1, 5, 20])
def test_a_wire_of_eight_returns_is_unsafe_along_its_hits(windows: int) -> None:
    pipe = fly(cut(np.vstack([ground(20.0), dust(20), WIRE]), windows))
    assert {state_at(pipe, east, 4.0) for east, _, _ in WIRE[1:-1].tolist()} == {UNSAFE}


@pytest.mark.parametrize("per_m2", [20.0, 100.0])
def test_of_a_hundred_specks_about_one_meets_another_by_chance(per_m2: float) -> None:
    """Specks are 0.25 % of the returns, in six worlds; each that counts takes 121 cells at the most."""
    unsafe, specks = 0, round(0.0025 * per_m2 * (2 * HALF_M) ** 2)
    for seed in range(6):
        maps = fly(cut(np.vstack([ground(per_m2), dust(specks, seed=seed)]), 5)).maps()
        assert maps is not None
        unsafe += int((maps.state == UNSAFE).sum())
    assert unsafe <= 0.02 * 6 * specks * 121


@pytest.mark.parametrize("per_m2", [20.0, 100.0])
def test_the_safe_map_is_the_same_however_the_returns_are_cut(per_m2: float) -> None:
    points = np.vstack([ground(per_m2), dust(round(per_m2)), POLE, HOLE, WIRE])
    states = []
    for windows in (1, 5, 20):
        maps = fly(cut(points, windows)).maps()
        assert maps is not None
        states.append(maps.state)
    for other in states[1:]:
        np.testing.assert_array_equal(states[0], other)


def test_a_low_return_counts_alone_until_rays_contradict_it() -> None:
    """An object of 0.3 m would have returned five pulses at 56 per square metre."""
    low = np.array([[2.0, 1.0, 0.4]])
    pipe = fly([np.vstack([ground(20.0), low])])
    assert state_at(pipe, 2.0, 1.0) == UNSAFE
    fly([ground(60.0, seed=4)], pipe=pipe)
    assert state_at(pipe, 2.0, 1.0) == SAFE


def test_two_hits_are_withdrawn_when_many_rays_pass() -> None:
    """A thing that was hit twice and then no more has left."""
    pipe = fly([np.vstack([ground(20.0), POLE])])
    assert state_at(pipe, 2.0, 1.0) == UNSAFE
    fly([ground(400.0, seed=k) for k in range(4, 24)], pipe=pipe)
    assert state_at(pipe, 2.0, 1.0) == SAFE


def test_two_hits_stay_while_nobody_looks_there() -> None:
    pipe = fly([np.vstack([ground(20.0), POLE])])
    elsewhere = ground(60.0, seed=4)
    fly([elsewhere[elsewhere[:, 0] < -2]] * 40, pipe=pipe, span_s=40.0)
    assert state_at(pipe, 2.0, 1.0) == UNSAFE


def test_an_object_of_many_hits_outlives_the_limit_on_isolated_returns() -> None:
    rng = np.random.default_rng(5)
    bush = np.column_stack([rng.uniform(1.9, 2.2, (40, 2)) - (0.0, 1.0), rng.uniform(0.5, 1.0, 40)])
    pipe = fly(cut(np.vstack([ground(20.0), bush]), 20))
    fly([np.vstack([ground(10.0, seed=k), dust(2000, seed=k)]) for k in range(6, 12)], pipe=pipe)
    assert state_at(pipe, 2.05, 1.05) == UNSAFE


def test_an_object_outlives_the_ground_below_it() -> None:
    """The tile below is given up for one elsewhere, and made again later."""
    tiles, thin = Tiles(0.0, 0.0, 0.2, 0.0), ThinObjects()
    everywhere, noise = Box(-(10**6), 10**6, -(10**6), 10**6), Noise(0.02, 0.0)

    def update(points: Floats, isolated: Floats, now_s: float) -> int:
        tiles.now_s(now_s)
        tiles.add(points, SENSOR, noise, everywhere, now_s, 8.0)
        thin.update(isolated, SENSOR, len(points), tiles, 300.0, 20.0)
        return len(thin.found_enu_m)

    none, elsewhere = np.empty((0, 3)), np.array([100.0, 0.0, 0.0])
    assert update(ground(20.0), POLE, 1.0) == 2
    for k in range(tiles.capacity):
        assert update(ground(20.0) + (k + 1) * elsewhere, none, 2.0 + k) == 2
    assert np.isnan(tiles.ground_and_rays(POLE)[:, 0]).all()
    assert update(ground(20.0), none, 100.0) == 2


# ---- returns beyond the mapping reach -------------------------------------------------------------

REACH = ("angle_noise_deg=0.4",)  # the map ends 5.8 m from below the sensor


def mapped_then_seen_from_afar(second: Floats) -> Pipeline:
    """One hit of a pole within the mapping reach, then another of it from 6.4 m aside."""
    pole = np.array([[2.0, 1.0, 1.4]])
    pipe = fly([np.vstack([ground(100), pole])], *REACH)
    aside = ground(100, seed=5) - np.array([10.0, 0.0, 0.0])
    points = np.vstack([aside, second])
    stamps = np.full(len(points), 6_000_000_000, np.int64)
    sensor = np.array([-4.4, 1.0, 25.0])
    pipe.process(Window(points, stamps, sensor, FRAME, int(stamps[0]), int(stamps[0])))
    return pipe


def test_a_second_hit_from_beyond_the_reach_makes_a_pole() -> None:
    assert state_at(mapped_then_seen_from_afar(np.array([[2.05, 1.03, 0.7]])), 2.0, 1.0) == UNSAFE


def test_a_distant_return_at_the_ground_is_neither_ground_nor_an_object() -> None:
    assert state_at(mapped_then_seen_from_afar(np.array([[2.05, 1.03, 0.2]])), 2.0, 1.0) == SAFE
