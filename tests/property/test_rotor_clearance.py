"""Properties of the headings at which rotor and tail are clear, on cells written by hand."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import params
from slz.kernels.cells.cell_record import BOTTOM, HEIGHT, SPREAD, TOP, WEIGHT
from slz.terrain.derive import reach_of
from slz.terrain.footing import ALL_HEADINGS, Footing, footing, footing_edge
from tests.property.written_cells import Cells, plane_with_obstacles

CELL_M = 0.2
HELICOPTER = (
    "rotor_diameter_m=2", "rotor_height_m=0.8", "tail_length_m=2", "tail_height_m=0.5", "tail_width_m=0.2",
    "rotor_clearance_m=0.2", "coverage_m=0.2",
)  # fmt: skip
P = params.load("quadcopter", HELICOPTER)
RADIUS = reach_of(P, CELL_M).radius
EDGE = footing_edge(RADIUS, CELL_M, P)
BOX = 3
SIDE = BOX + 2 * EDGE
MIDDLE = SIDE // 2
Raised = list[tuple[int, int, float]]

near_cells = st.integers(MIDDLE - 14, MIDDLE + 14)
obstacles = st.lists(st.tuples(near_cells, near_cells, st.floats(0.05, 2.0)), max_size=4)
slopes = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))


def ground(slope: tuple[float, float] = (0.0, 0.0), raised: Iterable[tuple[int, int, float]] = ()) -> Cells:
    """A plane, with obstacles on single cells."""
    return plane_with_obstacles(SIDE, CELL_M, slope, raised)


def unseen(cells: Cells, row: int, col: int, reach: int = 1) -> Cells:
    """The same with a square of cells without returns."""
    out = cells.copy()
    hole = np.s_[row - reach : row + reach + 1, col - reach : col + reach + 1]
    out[:, *hole] = np.nan
    out[WEIGHT, *hole] = 0
    return out


def judged(cells: Cells, p: params.Parameters = P) -> Footing:
    return footing(np.ascontiguousarray(cells), BOX, BOX, RADIUS, CELL_M, p)


def headings(cells: Cells) -> set[int]:
    return set(judged(cells).headings_deg)


@settings(deadline=None, max_examples=60)
@given(slopes, obstacles)
def test_headings_turn_with_the_ground(slope: tuple[float, float], raised: Raised) -> None:
    """Turned by a right angle anticlockwise, which is row to the west: headings are 90 degrees less."""
    cells = ground(slope, raised)
    turned = np.rot90(cells, -1, axes=(1, 2))  # rows go north, so that this is anticlockwise on the map
    assert headings(turned) == {(heading - 90) % 360 for heading in headings(cells)}


@settings(deadline=None, max_examples=60)
@given(slopes, obstacles, st.sampled_from([-64.0, 32.0, 256.0]))
def test_headings_do_not_depend_on_the_level(
    slope: tuple[float, float], raised: Raised, level_m: float
) -> None:
    cells = np.round(ground(slope, raised) * 1024) / 1024  # exact in float32 at any of these levels
    cells[SPREAD] = 1e-6
    lifted = cells.copy()
    lifted[[HEIGHT, BOTTOM, TOP]] += np.float32(level_m)
    assert headings(lifted) == headings(cells)


@settings(deadline=None, max_examples=100)
@given(slopes, obstacles, st.tuples(near_cells, near_cells, st.floats(0.05, 2.0)))
def test_an_obstacle_more_never_adds_a_heading(
    slope: tuple[float, float], raised: Raised, one_more: tuple[int, int, float]
) -> None:
    assert headings(ground(slope, [*raised, one_more])) <= headings(ground(slope, raised))


@settings(deadline=None, max_examples=60)
@given(slopes, near_cells, near_cells)
def test_unseen_ground_under_the_disc_is_never_clear(slope: tuple[float, float], row: int, col: int) -> None:
    cells = unseen(ground(slope), row, col)
    within = np.hypot(row - MIDDLE, col - MIDDLE) * CELL_M < P.rotor_diameter_m / 2
    assert headings(cells) <= headings(ground(slope))
    if within:
        assert headings(cells) == set()


def test_open_ground_leaves_every_heading() -> None:
    found = judged(ground((0.05, -0.05)))
    assert found.headings_deg == ALL_HEADINGS
    assert found.blocked_by == ""


@pytest.mark.parametrize(
    ("bearing_deg", "north", "east"), [(0, 1, 0), (90, 0, 1), (180, -1, 0), (270, 0, -1)]
)
def test_a_post_behind_excludes_headings_away_from_it(bearing_deg: int, north: int, east: int) -> None:
    """It is 1.8 m off, beyond the disc and its margin, and higher than the tail."""
    place = MIDDLE + 9 * north, MIDDLE + 9 * east
    found = judged(ground(raised=[(*place, 1.2)]))
    away = (bearing_deg + 180) % 360
    assert away not in found.headings_deg
    assert bearing_deg in found.headings_deg
    assert (away + 90) % 360 in found.headings_deg
    assert found.blocked_by == "tail: 1.2 m high at 1.8 m"
    assert judged(ground(raised=[(*place, 0.25)])).headings_deg == ALL_HEADINGS


@pytest.mark.parametrize(("aside", "clear"), [(4, False), (11, True)])
def test_the_tail_is_clear_at_any_yaw_at_which_the_vehicle_may_land(aside: int, clear: bool) -> None:
    """A post 5 m behind: a tail of 6 m, 10 degrees off its heading, meets it 0.8 m aside, not 2.2 m."""
    long = params.load("quadcopter", [*HELICOPTER, "tail_length_m=6"])
    edge = footing_edge(RADIUS, CELL_M, long)
    cells = np.pad(ground(), ((0, 0), (edge - EDGE,) * 2, (edge - EDGE,) * 2), "edge")
    middle = edge + BOX // 2
    for to in (aside, -aside):
        post = cells.copy()
        post[TOP, middle - 25, middle + to] += 1.0
        assert (0 in judged(post, long).headings_deg) is clear


def test_a_hole_in_what_was_seen_behind_excludes_headings_too() -> None:
    found = judged(unseen(ground(), MIDDLE - 11, MIDDLE))
    assert 0 not in found.headings_deg
    assert {90, 180, 270} <= set(found.headings_deg)
    assert found.blocked_by.startswith("tail: unseen ground at 2.")


def test_a_wall_under_the_blades_excludes_every_heading() -> None:
    wall = [(row, MIDDLE + 5, 1.5) for row in range(SIDE)]
    found = judged(ground(raised=wall))
    assert found.headings_deg == ()
    assert found.blocked_by == "rotor: 1.5 m high at 1.0 m"


def test_a_slope_that_tilts_the_disc_lets_it_stay_clear_of_its_own_ground() -> None:
    """At 1 m the ground rises by 0.17 m; a disc that stayed level would have 0.43 m left, this one 0.6 m."""
    low = params.load("quadcopter", [*HELICOPTER, "rotor_height_m=0.35"])
    assert judged(ground((0.17, 0.0)), low).headings_deg == ALL_HEADINGS


def test_narrow_gaps_count_as_seen_as_wide_as_the_profile_says() -> None:
    wide = params.load("quadcopter", [*HELICOPTER, "coverage_m=1.0"])
    edge = footing_edge(RADIUS, CELL_M, wide)
    more = np.pad(ground(), ((0, 0), (edge - EDGE,) * 2, (edge - EDGE,) * 2), "edge")
    hole = unseen(more, edge + BOX // 2 - 4, edge + BOX // 2)
    assert judged(hole, wide).headings_deg == ALL_HEADINGS
    assert judged(unseen(ground(), MIDDLE - 4, MIDDLE)).headings_deg == ()


def test_without_gear_the_vehicle_stands_on_the_plane_of_its_footprint() -> None:
    p = params.load("quadcopter", [*HELICOPTER, "gear=none"])
    assert judged(ground((0.1, 0.0)), p).headings_deg == ALL_HEADINGS
    post = ground((0.1, 0.0), [(MIDDLE + 9, MIDDLE, 1.2)])
    assert 180 not in judged(post, p).headings_deg
    assert 0 in judged(post, p).headings_deg
