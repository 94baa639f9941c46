"""The gear in all poses that a vehicle may take, not only in those of a lattice, on cells written by hand."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import params
from slz.kernels.cells.cell_record import WEIGHT
from slz.terrain.derive import reach_of
from slz.terrain.footing import ALL_HEADINGS, GEAR, YAW_ERROR, Footing, footing, footing_edge
from tests.property.written_cells import Cells, plane_with_obstacles

CELL_M = 0.1
GEARS = {
    "pads": ("gear_length_m=0.6", "gear_width_m=0.6"),
    "skids": ("gear=skids", "gear_length_m=0.9", "gear_width_m=0.6"),
    "tripod": ("gear=tripod", "gear_length_m=0.6", "gear_width_m=0.6"),
}
PROFILES = {
    name: params.load("quadcopter", [*own, f"cell_m={CELL_M}", "clearance_m=0.5"])
    for name, own in GEARS.items()
}
EDGE = max(footing_edge(reach_of(p, CELL_M).radius, CELL_M, p) for p in PROFILES.values())
SIDE = 1 + 2 * EDGE
Raised = list[tuple[int, int, float]]

names = st.sampled_from(sorted(GEARS))
near_cells = st.integers(EDGE - 6, EDGE + 6)
obstacles = st.lists(st.tuples(near_cells, near_cells, st.floats(0.02, 0.4)), max_size=4)
slopes = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))


def ground(slope: tuple[float, float] = (0.0, 0.0), raised: Iterable[tuple[int, int, float]] = ()) -> Cells:
    """A plane, with obstacles somewhere in single cells."""
    return plane_with_obstacles(SIDE, CELL_M, slope, raised)


def judged(cells: Cells, name: str = "pads") -> Footing:
    """The footing for a touchdown anywhere on the middle cell."""
    p = PROFILES[name]
    radius = reach_of(p, CELL_M).radius
    beyond = EDGE - footing_edge(radius, CELL_M, p)
    part = cells[:, beyond : SIDE - beyond, beyond : SIDE - beyond]
    return footing(np.ascontiguousarray(part), 1, 1, radius, CELL_M, p)


def headings(cells: Cells, name: str = "pads") -> set[int]:
    return set(judged(cells, name).headings_deg)


def pads_reach(row: int, col: int, heading_deg: int, rng: np.random.Generator) -> bool:
    """Whether a pad's middle comes within a cell for some of many touchdowns and yaws."""
    for _ in range(400):
        yaw = math.radians(heading_deg) + rng.uniform(-YAW_ERROR, YAW_ERROR)
        east, north = rng.uniform(-0.5, 0.5, 2)
        for forward, right in ((0.3, 0.3), (0.3, -0.3), (-0.3, 0.3), (-0.3, -0.3)):
            c = east + (forward * math.sin(yaw) + right * math.cos(yaw)) / CELL_M
            r = north + (forward * math.cos(yaw) - right * math.sin(yaw)) / CELL_M
            if abs(r - (row - EDGE)) < 0.5 and abs(c - (col - EDGE)) < 0.5:
                return True
    return False


def test_an_object_that_a_pad_may_meet_between_the_samples_excludes_the_heading() -> None:
    """Of 0.25 m, 0.85 m diagonally across: the gear would stand at 16 degrees or more on it."""
    rng, met = np.random.default_rng(1), 0
    for row in range(EDGE, EDGE + 6):
        for col in range(EDGE, EDGE + 6):
            found = headings(ground(raised=[(row, col, 0.25)]))
            for heading_deg in range(0, 90, 15):
                if pads_reach(row, col, heading_deg, rng):
                    met += 1
                    assert heading_deg not in found, (row, col)
    assert met > 40


def test_an_object_that_no_pad_reaches_excludes_nothing() -> None:
    """It stands under the belly, or between two pads."""
    assert judged(ground(raised=[(EDGE, EDGE + 1, 0.25)])).headings_deg == ALL_HEADINGS
    between = judged(ground(raised=[(EDGE + 3, EDGE, 0.25)]))
    assert {0, 90, 180, 270} <= set(between.headings_deg)
    assert not {45, 135, 225, 315} & set(between.headings_deg)
    assert between.blocked_by == GEAR


def test_an_object_anywhere_along_a_skid_excludes_the_heading() -> None:
    for row in range(EDGE - 4, EDGE + 5):
        found = headings(ground(raised=[(row, EDGE + 3, 0.3)]), "skids")
        assert not {0, 180} & found, row
    assert {0, 180} <= headings(ground(raised=[(EDGE + 2, EDGE, 0.3)]), "skids")


def test_an_object_under_the_end_of_a_skid_tilts_it_more_than_one_under_half_of_it() -> None:
    """At 105 degrees, up a slope of 8, 0.15 m under one front end tilts it to 17 degrees."""
    assert {105, 285} <= headings(ground((0.14, 0.0)), "skids")
    found = headings(ground((0.14, 0.0), [(EDGE - 4, EDGE + 3, 0.15)]), "skids")
    assert not {105, 285} & found


@settings(deadline=None, max_examples=60)
@given(names, slopes, obstacles, st.tuples(near_cells, near_cells, st.floats(0.02, 0.4)))
def test_an_obstacle_more_never_adds_a_heading(
    name: str, slope: tuple[float, float], raised: Raised, one_more: tuple[int, int, float]
) -> None:
    assert headings(ground(slope, [*raised, one_more]), name) <= headings(ground(slope, raised), name)


@settings(deadline=None, max_examples=60)
@given(names, slopes, obstacles)
def test_headings_turn_with_the_ground(name: str, slope: tuple[float, float], raised: Raised) -> None:
    cells = ground(slope, raised)
    turned = np.rot90(cells, -1, axes=(1, 2))  # rows go north, so that this is anticlockwise on the map
    assert headings(turned, name) == {(heading - 90) % 360 for heading in headings(cells, name)}


@settings(deadline=None, max_examples=60)
@given(names, slopes, obstacles, st.floats(0.0, 0.4))
def test_a_vehicle_that_may_miss_the_point_by_more_has_no_more_headings(
    name: str, slope: tuple[float, float], raised: Raised, error_m: float
) -> None:
    cells, p = ground(slope, raised), PROFILES[name]
    radius, more = reach_of(p, CELL_M).radius, round(error_m / CELL_M)
    wide = np.pad(cells, ((0, 0), (more,) * 2, (more,) * 2), "edge")
    beyond = EDGE - footing_edge(radius, CELL_M, p)
    part = wide[:, beyond : wide.shape[1] - beyond, beyond : wide.shape[2] - beyond]
    around = footing(np.ascontiguousarray(part), 1 + 2 * more, 1 + 2 * more, radius, CELL_M, p)
    assert set(around.headings_deg) <= headings(cells, name)


@pytest.mark.parametrize("name", sorted(GEARS))
def test_a_gear_without_known_ground_stands_at_no_heading(name: str) -> None:
    cells = ground()
    assert headings(cells, name) == set(ALL_HEADINGS)
    unknown = np.abs(np.mgrid[:SIDE, :SIDE] - EDGE).max(axis=0) < 10
    cells[:, unknown] = np.nan
    cells[WEIGHT, unknown] = 0
    assert headings(cells, name) == set()
