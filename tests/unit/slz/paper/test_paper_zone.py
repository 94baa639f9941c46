"""Zone statistics of source mode on known cells: counts, certainty, obstacles, room, boundary.

Cells of 1 m with one return in the middle of each. A slope needs the four neighbours, so the outermost ring
of the ground has none, a raised block has slopes on both sides of its rim, and a missing cell leaves five
unknown.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNKNOWN, UNSAFE, Pipeline, Report, Zone
from tests.unit.slz.hand_made import FRAME, flat, fly, maps, returns, state_at, window

ROWS, COLS = 42, 52
N_TOTAL = (ROWS - 2) * (COLS - 2)  # without the outermost ring
BLOCK = (10, 15)  # row and column of the middle of 3 x 3 raised cells
N_BLOCK = 9 + 12  # the block, uneven in the middle too, and the cells beside it
HOLES = [(20, 30), (30, 12)]
N_HOLES = 5 * len(HOLES)
MAST = (30, 40)
N_MAST = 4  # slopes beside it exceed the maximum, and nothing is written; its own is 0


def pipeline(*settings: str) -> Pipeline:
    own = ["mode=source", "zone_m=200", "histogram_threshold=1", "min_boundary_points=1", *settings]
    return Pipeline(params.load("helicopter", own), (0.0, 0.0))


def ground() -> NDArray[np.float64]:
    height = flat(ROWS, COLS)
    row, col = BLOCK
    height[row - 1 : row + 2, col - 1 : col + 2] = 0.5
    height[row, col - 1 : col + 2] = 0.4, 0.7, 0.6
    for hole in HOLES:
        height[hole] = np.nan
    height[MAST] = 8.0
    return height


def zone_of_ground(*settings: str) -> Zone:
    """Two holes, a block and a mast leave no room of 24 m."""
    return only_zone(fly(pipeline("min_square_m=3", *settings), returns(ground(), 1.0)))


def only_zone(report: Report) -> Zone:
    (zone,) = report.zones
    return zone


def lla_by_radii(east_m: float, north_m: float) -> tuple[float, float]:
    """Latitude and longitude near the frame's origin by the radii of curvature of WGS-84."""
    e2 = 1 - (1 - 1 / 298.257223563) ** 2
    w2 = 1 - e2 * math.sin(math.radians(FRAME.lat_deg)) ** 2
    across = 6_378_137.0 / math.sqrt(w2)
    meridian, parallel = across * (1 - e2) / w2 + FRAME.alt_m, (across + FRAME.alt_m)
    return (
        FRAME.lat_deg + math.degrees(north_m / meridian),
        FRAME.lon_deg + math.degrees(east_m / (parallel * math.cos(math.radians(FRAME.lat_deg)))),
    )


# ---- counts and certainty (SLZ paper Eq. 16-17) -------------------------------------------------


def test_safe_unsafe_and_uncertain_cells_inside_the_contour_are_counted() -> None:
    zone = zone_of_ground()
    assert zone.n_unsafe == N_BLOCK
    assert zone.n_uncertain == N_HOLES + N_MAST
    assert zone.n_safe == N_TOTAL - N_BLOCK - N_HOLES - N_MAST
    assert zone.area_m2 == N_TOTAL


def test_the_counts_are_those_of_the_map_within_the_zone() -> None:
    pipe = pipeline("min_square_m=3")
    zone = only_zone(fly(pipe, returns(ground(), 1.0)))
    m = pipe.maps(zone.box)
    assert m is not None
    inside = m.state[zone.cells == 1]
    assert [(inside == state).sum() for state in (SAFE, UNSAFE, UNKNOWN)] == [
        zone.n_safe,
        zone.n_unsafe,
        zone.n_uncertain,
    ]


def test_certainty_by_the_first_rule_is_the_share_of_safe_cells() -> None:
    zone = zone_of_ground("certainty_rule=safe")
    assert zone.certainty == pytest.approx((N_TOTAL - N_BLOCK - N_HOLES - N_MAST) / N_TOTAL, abs=1e-12)


def test_certainty_by_the_second_rule_is_the_share_of_cells_with_an_elevation() -> None:
    zone = zone_of_ground("certainty_rule=certain")
    assert zone.certainty == pytest.approx((N_TOTAL - N_HOLES - N_MAST) / N_TOTAL, abs=1e-12)


@pytest.mark.parametrize("rule", ["safe", "certain"])
def test_flat_ground_seen_everywhere_is_certain_by_both_rules(rule: str) -> None:
    zone = only_zone(fly(pipeline(f"certainty_rule={rule}"), returns(flat(ROWS, COLS), 1.0)))
    assert (zone.n_safe, zone.n_unsafe, zone.n_uncertain) == (N_TOTAL, 0, 0)
    assert zone.certainty == 1.0
    assert zone.obstacles == ()


def test_the_landing_point_is_as_far_away_as_it_lies_over_ground() -> None:
    sensor = (13.0, -17.0, 40.0)
    best = only_zone(pipeline("min_square_m=3").process(window(returns(ground(), 1.0), 0.0, sensor))).best
    assert best.distance_m == pytest.approx(math.hypot(best.enu_m[0] - 13.0, best.enu_m[1] + 17.0))
    assert best.distance_m > 1


# ---- obstacles ----------------------------------------------------------------------------------


def test_an_obstacle_inside_a_zone_has_its_top_and_its_height_above_the_zone() -> None:
    height = ground() + 3.0
    zone = only_zone(fly(pipeline("min_square_m=3"), returns(height, 1.0)))
    (obstacle,) = zone.obstacles
    assert obstacle.top_m == pytest.approx(3.7, abs=1e-5)
    assert obstacle.height_m == pytest.approx(0.7, abs=1e-5)
    assert obstacle.width_m == pytest.approx(math.sqrt(N_BLOCK), abs=1e-6)


def test_an_obstacle_lies_where_its_highest_return_is_also_in_geodetic_coordinates() -> None:
    west, south = -30.0, -20.0
    report = fly(pipeline("min_square_m=3"), returns(ground() + 3.0, 1.0, west, south))
    (obstacle,) = only_zone(report).obstacles
    east, north = west + BLOCK[1] + 0.5, south + BLOCK[0] + 0.5
    assert (obstacle.east_m, obstacle.north_m) == (east, north)
    lat, lon, alt = report.frame.lla([obstacle.east_m, obstacle.north_m, obstacle.top_m])
    assert (lat, lon) == pytest.approx(lla_by_radii(east, north), abs=1e-8)  # 1 mm
    assert alt == pytest.approx(FRAME.alt_m + 3.7, abs=1e-3)


def test_what_lies_beside_the_contour_in_its_bounding_box_counts_for_nothing() -> None:
    """Ground like a C, and a block on a patch of ground of its own in the opening."""
    height = flat(40, 40)
    height[10:30, 15:] = np.nan
    height[13:27, 20:35] = 0.0
    height[18:21, 26:29] = 0.5
    report = fly(pipeline("min_square_m=5"), returns(height, 1.0))
    zone = max(report.zones, key=lambda zone: zone.area_m2)
    rows, cols = zone.cells.shape
    assert (rows, cols) == (38, 38)
    lost = 20 * 24 + 2 * 24 + 20  # without a return, or beside such a cell
    assert zone.n_safe == zone.area_m2 == 38 * 38 - lost
    assert (zone.n_unsafe, zone.n_uncertain, zone.certainty) == (0, 0, 1.0)
    assert zone.obstacles == ()


# ---- room to land and boundary count ------------------------------------------------------------


@pytest.mark.parametrize(("side", "found"), [(23, 0), (24, 1)])
@pytest.mark.parametrize("turned", [False, True])
def test_a_zone_needs_a_safe_square_of_24_cells_of_1_m(side: int, found: int, turned: bool) -> None:
    height = flat(side + 2, 60)
    report = fly(pipeline(), returns(height.T if turned else height, 1.0))
    assert len(report.zones) == found
    if found:
        assert only_zone(report).best.square_side_m == 24.0


@pytest.mark.parametrize(("beside", "found"), [(23, 0), (24, 1)])
def test_an_unknown_cell_in_every_square_of_24_m_takes_the_room_away(beside: int, found: int) -> None:
    """In a strip 24 cells wide a missing return takes three columns; so many are left on either side."""
    height = flat(24 + 2, beside + 3 + beside + 2)
    height[13, 1 + beside + 1] = np.nan
    assert len(fly(pipeline(), returns(height, 1.0)).zones) == found


@pytest.mark.parametrize(("cell_m", "side_m", "cells"), [(0.5, 2.0, 4), (0.5, 2.1, 5), (1.0, 2.9, 3)])
def test_a_side_that_is_no_whole_number_of_cells_takes_the_next_larger(
    cell_m: float, side_m: float, cells: int
) -> None:
    for side, found in ((cells - 1, 0), (cells, 1)):
        pipe = pipeline(f"cell_m={cell_m}", f"min_square_m={side_m}")
        assert len(fly(pipe, returns(flat(side + 2, 20), cell_m)).zones) == found


@pytest.mark.parametrize(("cols", "points", "found"), [(77, 198, 0), (78, 200, 1)])
def test_a_zone_needs_200_boundary_points(cols: int, points: int, found: int) -> None:
    """A rectangle of 24 x n cells has 2 (24 + n) - 4 of them."""
    cloud = returns(flat(24 + 2, cols + 2), 1.0)
    assert len(only_zone(fly(pipeline(), cloud)).boundary_cells) == points
    assert len(fly(pipeline("min_boundary_points=200"), cloud).zones) == found


@pytest.mark.parametrize("mode", ["default", "source"])
def test_in_both_modes_a_zone_lives_with_its_own_square_and_count_and_dies_with_one_more(mode: str) -> None:
    def found(*settings: str) -> tuple[Zone, ...]:
        pipe = pipeline(f"mode={mode}", *settings)
        return fly(pipe, returns(flat(40, 40), 1.0)).zones

    (zone,) = found("min_square_m=2")
    side, count = zone.best.square_side_m, len(zone.boundary_cells)
    assert side > 10
    assert len(found(f"min_square_m={side}", f"min_boundary_points={count}")) == 1
    assert not found(f"min_square_m={side + 1}")
    assert not found("min_square_m=2", f"min_boundary_points={count + 1}")


# ---- boundary -----------------------------------------------------------------------------------


def test_the_corners_of_the_boundary_are_those_of_the_ground_in_geodetic_coordinates() -> None:
    west, south = -30.0, -20.0
    report = fly(pipeline(), returns(flat(ROWS, COLS) + 3.0, 1.0, west, south))
    zone = only_zone(report)
    east = (west + 1.5, west + COLS - 1.5)  # the middles of the outermost cells with a slope
    north = (south + 1.5, south + ROWS - 1.5)
    expected = sorted(lla_by_radii(e, n) for e in east for n in north)
    found = report.frame.lla(zone.corners_enu_m)
    assert sorted((lat, lon) for lat, lon, _ in found.tolist()) == [
        pytest.approx(corner, abs=1e-8) for corner in expected
    ]
    np.testing.assert_allclose(found[:, 2], FRAME.alt_m + 3.0, atol=1e-3)


def test_the_boundary_is_every_cell_of_the_outermost_safe_ring_once() -> None:
    zone = zone_of_ground()
    cells = {tuple(cell) for cell in zone.boundary_cells.tolist()}
    row0, row1, col0, col1 = zone.box.row0, zone.box.row1 - 1, zone.box.col0, zone.box.col1 - 1
    ring = {(r, c) for r in range(row0, row1 + 1) for c in range(col0, col1 + 1)}
    ring = {(r, c) for r, c in ring if r in (row0, row1) or c in (col0, col1)}
    assert cells == ring
    assert len(zone.boundary_cells) == len(ring)


def test_the_states_of_the_hand_made_ground_are_what_the_counts_assume() -> None:
    pipe = pipeline()
    fly(pipe, returns(ground(), 1.0))

    def state(place: tuple[int, int], down: int = 0, right: int = 0) -> int:
        return state_at(pipe, place[1] + right + 0.5, place[0] + down + 0.5)

    assert [state(BLOCK, down) for down in range(-3, 4)] == [1, 0, 0, 0, 0, 0, 1]
    assert [state(BLOCK, i, i) for i in range(-3, 4)] == [1, 1, 0, 0, 0, 1, 1]
    assert [state(HOLES[0], 0, right) for right in range(-2, 3)] == [1, 255, 255, 255, 1]
    assert [state(MAST, 0, right) for right in range(-2, 3)] == [1, 255, 1, 255, 1]
    assert (maps(pipe).state[[0, -1]] == UNKNOWN).all()
