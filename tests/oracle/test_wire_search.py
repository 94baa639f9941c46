"""Kernels of the search for wires against plain Python and NumPy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.lines import candidates, curve_evidence, line_votes, voxel_occupancy
from slz.kernels.lines.voxel_occupancy import DIRECTIONS, DOWN, LEVELS, NOWHERE, RING_M, SIDE

Floats = NDArray[np.float64]
Cell = tuple[int, int]
CEILING, FENCE, EPOCH = 9.0, 2.5, 3
SENSOR = np.array([1.0, -2.0, 16.0])


class Air:
    """Floor and occupied voxels as dictionaries."""

    def __init__(self) -> None:
        self.floors: dict[Cell, tuple[np.float32, np.float32]] = {}
        self.voxels: set[tuple[int, int, int]] = set()
        self.arrays: tuple[Any, ...] = (
            np.zeros((SIDE, SIDE, LEVELS), np.uint8),
            np.full((SIDE, SIDE, 2), NOWHERE, np.int32),
            np.full((SIDE, SIDE, 2), np.inf, np.float32),
            np.full((SIDE, SIDE, 2), NOWHERE, np.int32),
        )
        self.scratch = 1, np.empty((SIDE, SIDE), np.float32), np.zeros((SIDE, SIDE), np.int32)

    def add(self, points: Floats, rows: list[int]) -> list[int]:
        for e, n, u in points[rows]:
            key, z, nothing = (math.floor(n / 2), math.floor(e / 2)), np.float32(u), np.float32(np.inf)
            before, floor = self.floors.get(key, (nothing, nothing))
            if z < CEILING and z < floor:
                self.floors[key] = z, max(z, before) if abs(z - before) <= 0.7 else floor
            elif z < CEILING:
                self.floors[key] = before, floor
        overs = [self.over(*points[i]) for i in rows]  # infinite where there is no floor
        known = [(i, o) for i, o in zip(rows, overs, strict=True) if o < np.inf or points[i, 2] >= CEILING]
        self.voxels |= {self.voxel(*points[i]) for i, o in known if o >= 1.0}
        return [i for i, o in known if o >= FENCE]

    def floor(self, e: float, n: float) -> float:
        r, c = math.floor(n / 2), math.floor(e / 2)
        around = ((rr, cc) for rr in range(r - 1, r + 2) for cc in range(c - 1, c + 2))
        found = sorted(float(self.floors[key][1]) for key in around if key in self.floors)
        known = [z for z in found if z < np.inf]
        return (known[1] if len(known) > 1 else known[0]) if known else math.inf

    def over(self, e: float, n: float, u: float) -> float:
        floor = self.floor(e, n)
        return u - floor if floor < np.inf else math.inf

    @staticmethod
    def voxel(e: float, n: float, u: float) -> tuple[int, int, int]:
        return math.floor(n / 0.5), math.floor(e / 0.5), math.floor(u / 0.5)

    def is_thin(self, place: Floats) -> bool:
        ways = [np.array(way) / 2 for way in itertools.product((-1, 0, 1), repeat=3) if any(way)]
        held = [all(self.voxel(*(place + k * way)) in self.voxels for k in (1, 2)) for way in ways]
        return sum(held) <= 5


@pytest.fixture(params=range(4))
def world(request: pytest.FixtureRequest) -> tuple[Air, Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Ground that is partly unknown, a wall, a wire and dust; added to both."""
    rng = np.random.default_rng(request.param)
    ground = np.column_stack([rng.uniform(-30, 12, (2500, 2)), rng.normal(0, 0.2, 2500)])
    wall = np.column_stack([rng.uniform(-9, 9, 2000), np.full(2000, 7.0), rng.uniform(0, 8, 2000)])
    wire = np.column_stack([np.linspace(-25, 25, 300), np.full(300, -9.0), rng.normal(6, 0.05, 300)])
    points = np.vstack([ground, wall, wire, rng.uniform((-30, -30, 1), (30, 30, 20), (200, 3))])
    rows, air = rng.permutation(len(points))[:4500], Air()
    raised = air.add(points, rows.tolist())
    arrays: Any = *air.arrays, *air.scratch
    found = voxel_occupancy.add_returns(points, rows, CEILING, FENCE, EPOCH, *arrays)
    assert found.tolist() == raised
    return air, points, rows, found


def test_candidates_are_one_a_cell(world: Any) -> None:
    _, points, _, raised = world
    found = candidates.candidates_of(points, raised, SENSOR, 0.003, 0.02, 7.5)
    own = points[raised]
    away = np.linalg.norm(own - SENSOR, axis=1)
    own, away = own[(away >= 4.0) & (away <= 60.0)], away[(away >= 4.0) & (away <= 60.0)]
    _, first = np.unique(np.floor(own / 0.25), axis=0, return_index=True)
    some = np.sort(first)[:: -(-len(first) // 384)]
    sigma = np.hypot(np.hypot(0.05 + 0.003 * away[some], 0.003 * away[some]), 0.02)
    assert 192 < len(some) <= 384
    np.testing.assert_array_equal(found[:, :3], own[some])
    np.testing.assert_array_equal(found[:, 3], sigma)
    np.testing.assert_array_equal(found[:, 4:], np.tile([7.5, *SENSOR], (len(some), 1)))
    assert not len(candidates.candidates_of(points, raised[:0], SENSOR, 0.003, 0.02, 7.5))


@pytest.mark.parametrize(("n", "window"), [(0, 4), (200, 5), (1500, 6)])
def test_stored_candidates_age_and_thin_new_ones_join(world: Any, n: int, window: int) -> None:
    air, points, rows, raised = world
    rng = np.random.default_rng(n)
    old = np.column_stack([points[rows[:n]], rng.uniform(0, 200, (n, 5))])
    new = candidates.candidates_of(points, raised, SENSOR, 0.003, 0.02, 150.0)
    stored = np.empty((candidates.MOST + candidates.MOST_OF_WINDOW, 8))
    stored[:n] = old
    place = EPOCH, EPOCH, *air.arrays
    m, n_new = candidates.renew(stored, n, new, 150.0, window, FENCE, *place)
    fresh = old[150.0 - old[:, 4] <= 120.0]
    judged = np.arange(len(fresh)) % 4 == window % 4
    good = np.array([air.is_thin(one) and air.over(*one) >= FENCE for one in fresh[:, :3]], bool)
    thin = np.array([air.is_thin(one) for one in new[:, :3]])
    expected = np.vstack([fresh[~judged | good], new[thin]])[-candidates.MOST :]
    assert n_new == thin.sum()
    assert 0 < n_new < len(new)
    np.testing.assert_array_equal(stored[:m], expected)
    np.testing.assert_array_equal(voxel_occupancy.are_thin(new, EPOCH, EPOCH, *air.arrays[:2]), thin)


def test_air_around_a_curve(world: Any) -> None:
    air, *_ = world
    s = np.arange(-20.0, 20.0, 0.5)
    line = np.array([0.5, 6.0]), np.array([0.8, 0.6]), np.array([3.0, 0.1, 0.004])
    held, above = np.zeros((2, DIRECTIONS, len(RING_M)), np.int64)
    free = np.empty((held.size * len(s), 3))
    n = voxel_occupancy.around_curve(s, *line, held, above, free, EPOCH, EPOCH, *air.arrays)
    expected, known, seen = np.zeros_like(held), np.zeros_like(held), 0
    for at in s:
        e, north = line[0] + at * line[1]
        u, floor = line[2][0] + at * (line[2][1] + at * line[2][2]), air.floor(e, north)
        for d in range(DIRECTIONS):
            aside, up = math.cos(2 * math.pi / DIRECTIONS * d), math.sin(2 * math.pi / DIRECTIONS * d)
            for k, ring in enumerate(RING_M):
                x, y = e + ring * aside * line[1][1], north - ring * aside * line[1][0]
                high = floor == math.inf or u + ring * up >= floor + 1.25
                full = air.voxel(x, y, u + ring * up) in air.voxels
                known[d, k] += high
                expected[d, k] += high and full
                seen += high and not full and d in range(*DOWN)
    assert expected.any()
    np.testing.assert_array_equal(held, expected)
    np.testing.assert_array_equal(above, known)
    assert n == seen


@pytest.mark.parametrize("seed", range(3))
def test_votes_for_lines(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-14, 14, (90, 3)) * (1, 1, 0.3), rng.uniform(0.03, 0.3, 90)])
    points[:20, :2] = np.linspace(-12, 12, 20)[:, np.newaxis] * (0.02 - 0.02 * seed, 1.0)  # near due north
    lines = line_votes.line_votes(np.arange(0, 90, 9), points)
    for k, i in enumerate(range(0, 90, 9)):
        votes = np.zeros((180, 16), int)
        for x, y, z, sigma in points - (*points[i, :3], 0.0):
            away = math.hypot(x, y)
            if not 3.0 <= away <= 25.0 or abs(z / away) > 0.48:
                continue
            bearing, slope = math.atan2(x, y), z / away
            bearing, slope = (bearing + math.pi, -slope) if bearing < 0 else (bearing, slope)
            wide = 2.0 * math.hypot(sigma, points[i, 3]) / away
            low, high = (math.floor((slope + side * (wide + 0.03) + 0.48) / 0.06) for side in (-1, 1))
            for b in range(*(math.floor((bearing + m) / math.pi * 180) + (m > 0) for m in (-wide, wide))):
                for level in range(max(0, low), min(15, high) + 1):
                    votes[b % 180, level if 0 <= b < 180 else 15 - level] += 1
        b, level = divmod(int(votes.argmax()), 16)
        best = votes.max(), (b + 0.5) * math.pi / 180, (level + 0.5) * 0.06 - 0.48
        np.testing.assert_allclose(lines[k], best)


@pytest.mark.parametrize("seed", range(6))
def test_what_the_returns_of_a_curve_have_in_common(seed: int) -> None:
    rng = np.random.default_rng(seed)
    own = rng.uniform(-9, 9, (40 + seed, 8))
    members, along = rng.permutation(len(own))[: 20 + seed], rng.uniform(2, 14, 20 + seed)
    found = curve_evidence.measures(own, members, along, 2.0)
    some = own[members]
    way = some[:, :3] - some[:, 5:]
    fall = -way[:, 2] / np.maximum(np.hypot(way[:, 0], way[:, 1]), 0.1)
    assert found[:2] == (len(np.unique(np.floor((along - 2.0) / 0.5))), np.ptp(some[:, 4]))
    medians = [np.median(values) for values in (np.linalg.norm(way, axis=1), fall, some[:, 3])]
    moved = np.linalg.norm(np.ptp(some[:, 5:], axis=0))
    np.testing.assert_allclose(found[2:], [moved, *medians], rtol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_the_fullest_direction_but_for_its_fullest_ring(seed: int) -> None:
    rng = np.random.default_rng(seed)
    above = rng.integers(0, 40, (24, 4))
    occupied, least = rng.integers(0, above + 1), (1.0, 20.5, 38.5)[seed % 3]
    shares = [0.0]
    for full, all_of in zip(occupied.tolist(), above.tolist(), strict=True):
        rings = [(a / b, a, b) for a, b in zip(full, all_of, strict=True) if b >= least]
        if len(rings) > 1:
            rings.remove(max(rings, key=lambda ring: ring[0]))
        if rings:
            shares.append((sum(r[1] for r in rings) + 1) / (sum(r[2] for r in rings) + 1))
    assert curve_evidence.fullest_share(occupied, above, least) == max(shares)
