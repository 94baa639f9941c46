"""Rest pose of the gear against linear programming and against brute force on exact surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import linprog

import params
from slz import Pipeline, Window
from slz.frame import LocalFrame
from slz.grid import Box
from slz.kernels.footprint.rest_pose import A_LEVERAGE, gradient_at, scratch_for, steepest_rest
from slz.terrain.gear import gear_of

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], Floats]  # height at east, north

GEARS = {
    "pads 0.8 m across": ["gear_length_m=0.57", "gear_width_m=0.57"],
    "pads 2 m across": ["gear_length_m=1.37", "gear_width_m=1.37"],
    "narrow pads": ["gear_length_m=0.9", "gear_width_m=0.4"],
    "skids": ["gear=skids", "gear_length_m=1.2", "gear_width_m=0.8"],
    "tripod": ["gear=tripod", "gear_length_m=0.6", "gear_width_m=0.6"],
}


def load(name: str, *own: str) -> params.Parameters:
    return params.load("quadcopter", [*GEARS[name], *own])


def lowest_plane(contacts: Floats, heights: Floats, centre: Floats) -> Floats:
    """East and north rise, and height, of the plane on or above all contacts that is lowest at a centre."""
    above = -np.column_stack([contacts, np.ones(len(contacts))])
    found = linprog([*centre, 1.0], A_ub=above, b_ub=-heights, bounds=[(None, None)] * 3, method="highs")
    return np.asarray(found.x)


def lowest_plane_of_few(contacts: Floats, heights: Floats, centre: Floats) -> Floats:
    """Return the same for up to four contacts: of all planes through three, those above the others."""
    best, lowest_m = np.full(3, np.nan), np.inf
    for three in map(list, combinations(range(len(contacts)), 3)):
        plane = np.linalg.solve(np.column_stack([contacts[three], np.ones(3)]), heights[three])
        under = contacts @ plane[:2] + plane[2]
        if (under >= heights - 1e-9).all() and [*centre, 1.0] @ plane < lowest_m:
            best, lowest_m = plane, [*centre, 1.0] @ plane
    return best


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(sorted(GEARS)), st.integers(0, 10_000), st.sampled_from([0.02, 0.2, 1.0]))
def test_the_gear_rests_on_the_lowest_plane_above_its_contacts(name: str, seed: int, bumpy_m: float) -> None:
    """A vehicle that sinks stops on the plane that is lowest at its centre of gravity."""
    gear, rng = gear_of(load(name), 0.05), np.random.default_rng(seed)
    heading = int(rng.integers(len(gear.contacts_m)))
    count = gear.contacts_m.shape[1]
    heights = rng.normal(0, bumpy_m, count).astype(np.float32)
    gradient, east, north, up = steepest_rest(gear.contacts_m, heading, heights, np.arange(count), count)
    # With the centre a hair off, a gear that can rock rests on one of its two planes for certain.
    contacts, exact = gear.contacts_m[heading].astype(float), heights.astype(float)
    hair = 1e-3 * np.array([[1.0, 0.2], [-1.0, -0.2], [-0.2, 1.0], [0.2, -1.0]])
    planes = [lowest_plane(contacts, exact, centre) for centre in hair]
    if count <= 4:
        few = [lowest_plane_of_few(contacts, exact, centre) for centre in hair]
        np.testing.assert_allclose(few, planes, rtol=1e-6, atol=1e-6)
    steepest = max(planes, key=lambda plane: math.hypot(plane[0], plane[1]))
    assert gradient == pytest.approx(math.hypot(steepest[0], steepest[1]), rel=1e-3, abs=1e-4)
    assert (east * contacts[:, 0] + north * contacts[:, 1] + up >= exact - 1e-3).all()
    assert gradient <= float(np.ptp(exact)) * gear.limits[A_LEVERAGE] * 1.001 + 1e-6


# ---- whole maps on exact surfaces ---------------------------------------------------------------

HALF_M, PER_M2, NOISE_M, ABOVE_M = 8.0, 400, 0.02, 25.0
FRAME = LocalFrame(47.0, 8.0, 400.0)


def kerb(high_m: float, turned_deg: float) -> Surface:
    turn = math.radians(turned_deg)
    return lambda x, y: high_m * ((x * math.cos(turn) + y * math.sin(turn)) > 0.03)


def flagstones(x: Floats, y: Floats) -> Floats:
    """Stones of 0.5 m, every other one of them 0.22 m up."""
    return 0.22 * (((np.floor(x / 0.5) + np.floor(y / 0.5)) % 2) == 0)


def ridges(x: Floats, y: Floats) -> Floats:
    """Furrows of 0.24 m, 0.8 m apart."""
    return 0.12 * np.sin(2 * np.pi * (x + 0.3 * y) / 0.8)


def safe_map(surface: Surface, parameters: params.Parameters) -> tuple[Floats, NDArray[np.bool_]]:
    """Centres of the cells along an axis, and which cells are called safe."""
    rng, pipe = np.random.default_rng(5), Pipeline(parameters, (0.0, 0.0), follow=False)
    for i in range(4):
        x, y = rng.uniform(-HALF_M, HALF_M, (2, round(PER_M2 * 4 * HALF_M**2 / 4)))
        points = np.column_stack([x, y, surface(x, y) + rng.normal(0, NOISE_M, len(x))])
        stamps = np.int64(i * 10**9) + np.linspace(0, 9e8, len(x)).astype(np.int64)
        window = Window(points, stamps, np.array([0.0, 0.0, ABOVE_M]), FRAME, int(stamps[0]), int(stamps[-1]))
        report = pipe.process(window)
    grid, cells = report.near.grid, round(2 * (HALF_M - 2) / parameters.cell_m)
    row, col = grid.index(-HALF_M + 2 + 1e-6, -HALF_M + 2 + 1e-6)
    maps = pipe.maps(Box(row, row + cells, col, col + cells), "near", 0)
    assert maps is not None
    return np.array([grid.centre(row + i, col + i)[0] for i in range(cells)]), maps.state == 1


def least_tilt_deg(surface: Surface, east: float, north: float, p: params.Parameters) -> float:
    """Least tilt of the gear on the exact surface, of headings 10 degrees apart."""
    ahead, aside = p.gear_size_m[0] / 2, p.gear_size_m[1] / 2
    if p.gear == "skids":
        along = np.linspace(-ahead, ahead, 41)
        places = [(x, y) for y in (-aside, aside) for x in along]
    elif p.gear == "tripod":
        places = [(ahead, 0.0), (-ahead, aside), (-ahead, -aside)]
    else:
        places = [(x, y) for x in (ahead, -ahead) for y in (aside, -aside)]
    disc = [(0.0, 0.0), *((p.pad_radius_m * c, p.pad_radius_m * s) for c, s in np.eye(2).tolist())]
    disc += [(-x, -y) for x, y in disc[1:]]
    plane_of = lowest_plane_of_few if len(places) <= 4 else lowest_plane
    best = 90.0
    for heading in np.radians(np.arange(0, 360, 10)):
        turn = np.array([[math.sin(heading), math.cos(heading)], [math.cos(heading), -math.sin(heading)]])
        contacts = np.array(places) @ turn.T
        under = contacts[:, None, :] + np.array(disc)[None] + (east, north)
        heights = surface(under[..., 0], under[..., 1]).max(axis=1)
        tilts = []
        for centre in 1e-3 * np.array([[1.0, 0.2], [-1.0, -0.2], [-0.2, 1.0], [0.2, -1.0]]):
            a, b, _ = plane_of(contacts, heights, centre)
            tilts.append(math.degrees(math.atan(math.hypot(a, b))))
        best = min(best, max(tilts))
        if best < 5:
            break
    return best


@pytest.mark.parametrize("name", ["pads 0.8 m across", "pads 2 m across", "skids"])
@pytest.mark.parametrize(
    "surface",
    [kerb(0.2, 25), kerb(0.25, 70), flagstones, ridges],
    ids=["kerb 0.2", "kerb 0.25", "flagstones", "ridges"],
)
def test_no_cell_is_safe_where_the_gear_tips_over_at_every_heading(name: str, surface: Surface) -> None:
    parameters = load(name)
    at, safe = safe_map(surface, parameters)
    rows, cols = np.nonzero(safe)
    some = np.random.default_rng(1).permutation(len(rows))[:30]
    beyond = parameters.greatest_tilt_deg + 2.0  # for the noise
    for i in some:
        assert least_tilt_deg(surface, at[cols[i]], at[rows[i]], parameters) < beyond


def test_a_kerb_is_refused_where_small_feet_straddle_it_and_accepted_beside_it() -> None:
    surface = kerb(0.2, 0.0)
    at, safe = safe_map(surface, load("pads 0.8 m across"))
    straddling, beside = np.abs(at) < 0.1, np.abs(at) > 0.8
    assert not safe[:, straddling].any()
    assert safe[:, beside].mean() > 0.97
    _, without = safe_map(surface, load("pads 0.8 m across", "gear=none"))
    assert without[:, straddling].mean() > 0.9  # the relief of 2 m alone does not see it


def swayed_window(number: int, p: params.Parameters) -> Window:
    """Level ground seen by 10 returns/m² from 20 m up, each of 20 scans with an attitude 0.15 degrees off."""
    rng, sensor = np.random.default_rng(number), np.array([0.0, 0.0, 20.0])
    n = rng.poisson(10 * (2 * HALF_M) ** 2)
    way = np.column_stack([rng.uniform(-HALF_M, HALF_M, (n, 2)), np.full(n, -sensor[2])])
    range_m = np.linalg.norm(way, axis=1, keepdims=True)
    turn = rng.normal(0, math.radians(p.angle_noise_deg), (n, 3))
    turn += rng.normal(0, math.radians(0.15), (20, 3))[rng.integers(0, 20, n)]
    points = sensor + (way + np.cross(turn, way)) * (1 + rng.normal(0, p.range_noise_m, (n, 1)) / range_m)
    stamps = np.int64(number * 10**9) + np.linspace(0, 9e8, n).astype(np.int64)
    return Window(points, stamps, sensor, FRAME, int(stamps[0]), int(stamps[-1]))


def test_noise_and_sway_take_no_heading_from_even_ground_that_had_one() -> None:
    """The extremes of tens of returns under a pad are no edge, nor is one stray return of a new epoch."""
    p, rng = params.load("quadcopter", []), np.random.default_rng(1)
    pipe, points = Pipeline(p, (0.0, 0.0), follow=False), rng.uniform(-5.5, 5.5, (24, 3)) * (1, 1, 0)
    stood, lost = np.zeros(len(points), bool), 0
    for number in range(16):
        pipe.process(swayed_window(number, p))
        if number < 6:
            continue
        near = pipe.method.maps[0].terrain  # type: ignore[attr-defined]
        stands = np.array(
            [
                near.state_at(one, p.touchdown_error_m) == 1
                and bool(near.footing_at(one, p.touchdown_error_m).headings_deg)
                for one in points
            ]
        )
        lost += int((stood & ~stands).sum())
        stood = stands
    assert stood.mean() > 0.95
    assert lost == 0


def test_wide_feet_stand_on_a_kerb_that_small_ones_do_not() -> None:
    at, wide = safe_map(kerb(0.2, 0.0), load("pads 2 m across"))
    assert wide[:, np.abs(at) < 0.1].mean() > 0.9


# ---- belly, coarse cells, skids at edges, sparse returns ------------------------------------------


def stone(east: float, north: float, side_m: float, high_m: float) -> Surface:
    return lambda x, y: high_m * ((np.abs(x - east) < side_m / 2) & (np.abs(y - north) < side_m / 2))


def test_a_stone_anywhere_under_the_belly_is_refused() -> None:
    """The belly is a disc to the pads: parts of cells whose centre is outside of it belong to it."""
    at, safe = safe_map(stone(0.15, 0.02, 0.15, 0.25), load("pads 0.8 m across", "clearance_m=0.1"))
    east, north = np.meshgrid(at, at)
    assert not safe[np.hypot(east - 0.15, north - 0.02) < 0.4].any()
    assert safe[np.hypot(east - 0.15, north - 0.02) > 2].mean() > 0.95


@pytest.mark.parametrize("cell_m", [0.25, 0.5, 1.0])
def test_small_feet_on_a_kerb_within_a_cell_are_refused(cell_m: float) -> None:
    parameters = load("pads 0.8 m across", f"cell_m={cell_m}", "min_square_m=3")
    surface = kerb(0.22, 25)
    at, safe = safe_map(surface, parameters)
    for row, col in list(zip(*np.nonzero(safe), strict=True))[::3]:
        assert least_tilt_deg(surface, at[col], at[row], parameters) < parameters.greatest_tilt_deg + 2
    assert safe.mean() > 0.3


def test_the_ground_of_a_pad_is_that_of_the_nearest_returns() -> None:
    ground = (
        np.full(25 * 25, np.inf, np.float32),
        np.zeros(25 * 25, np.float32),
        np.full(25 * 25, -np.inf, np.float32),
    )
    for array in ground:  # returns every third row and column
        array.reshape(25, 25)[::3, ::3] = 0
    gear = gear_of(load("pads 0.8 m across"), 0.2)
    place = (*ground, 25, 12, 12)
    for heading in range(len(gear.contacts_m)):
        standing = gear.contacts_m, gear.limits, scratch_for(gear.contacts_m)
        gradient = gradient_at(place, (0.0, 0.0, 0.0), 0.2, standing, heading, 0.02)
        assert gradient == pytest.approx(0, abs=1e-6)


def test_skids_are_refused_at_headings_at_which_an_edge_may_tilt_them() -> None:
    parameters = params.load("quadcopter", ["gear=skids", "gear_length_m=1.2", "gear_width_m=0.6"])
    gear, cells = gear_of(parameters, 0.2), 25
    x = (np.mgrid[:cells, :cells][1] - cells // 2) * 0.2
    high = np.where(x > 0.25, 0.24, 0.0)  # the kerb runs somewhere in the column at 0.2
    mixed = np.abs(x - 0.2) < 0.05
    lower, upper = np.where(mixed, 0.0, high), np.where(mixed, 0.24, high)
    middle = (lower + upper) / 2
    ground = tuple(a.astype(np.float32).ravel() for a in (lower, middle, upper))
    along = gradient_at(
        (*ground, cells, cells // 2, cells // 2), (0.0, 0.0, 0.0), 0.2,
        (gear.contacts_m, gear.limits, scratch_for(gear.contacts_m)), 0, 0.02,
    )  # fmt: skip
    assert along == np.inf or along > math.tan(math.radians(parameters.greatest_tilt_deg))
