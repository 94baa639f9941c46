"""Obstacles around a landing point, in three scenes (SLZ thesis, Section 4.4.5) and by geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from slz import Obstacle, Pipeline, Surroundings
from tests.unit.slz.hand_made import FRAME, NOWHERE, flat, returns, window

Floats = NDArray[np.float64]
CELL_M = 0.2
N = 151  # the middle of the middle cell is the origin
HALF_M = N * CELL_M / 2
REACH_M = 14.0
SECTOR = math.radians(10)


def axis() -> Floats:
    return (np.arange(N) - N // 2) * CELL_M


def plane(slope_deg: float = 0.0, towards_deg: float = 0.0) -> Floats:
    """Ground that rises to a bearing."""
    up, bearing = math.tan(math.radians(slope_deg)), math.radians(towards_deg)
    east, north = np.meshgrid(axis(), axis())
    return np.asarray(up * (east * math.sin(bearing) + north * math.cos(bearing)))


def at(height: Floats, east_m: float, north_m: float) -> float:
    middle = N // 2
    return float(height[middle + round(north_m / CELL_M), middle + round(east_m / CELL_M)])


def with_block(height: Floats, west: float, south: float, east: float, north: float, up: float) -> Floats:
    """The same with a block on it; its edges are those of cells."""
    out = height.copy()
    inside_east, inside_north = (axis() > west) & (axis() < east), (axis() > south) & (axis() < north)
    out[np.ix_(inside_north, inside_east)] += up
    return out


def around(
    height: Floats, point: tuple[float, float] = (0.0, 0.0), *own: str, up_m: float = 0.0
) -> Surroundings:
    """What the pipeline says is around a point."""
    settings_ = ["zone_m=60.2", "angle_noise_deg=0", "coverage_m=1", f"surround_m={REACH_M}", *own]
    pipe = Pipeline(params.load("quadcopter", settings_), (0.0, 0.0))
    cloud = returns(height, CELL_M, -HALF_M, -HALF_M)
    pipe.process(window(cloud, 0.0, NOWHERE))
    pipe.select(np.array([*point, up_m]))
    report = pipe.process(window(cloud, 1.0, NOWHERE))
    assert report.selected is not None
    assert report.selected.surroundings is not None
    return report.selected.surroundings


EAST_ONE = (4.1, -2.9, 8.1, 3.1)  # west, south, east, north
WEST_ONE = (-10.1, -1.1, -6.9, 4.9)


# ---- the thesis's scenes ------------------------------------------------------------------------


@pytest.mark.parametrize(("slope_deg", "towards_deg"), [(0, 0), (4, 90), (8, 30), (8, 200)])
def test_on_an_open_plain_nothing_stands(slope_deg: float, towards_deg: float) -> None:
    """SLZ thesis Figure 4-16."""
    found = around(plane(slope_deg, towards_deg))
    assert found.obstacles == ()
    assert found.radius_m == REACH_M
    assert np.nanmax(found.horizon_deg) == pytest.approx(slope_deg, abs=0.1)


def test_what_a_level_plain_lacks_is_a_horizon() -> None:
    np.testing.assert_allclose(around(plane()).horizon_deg, 0.0, atol=1e-6)


@pytest.mark.parametrize(("slope_deg", "towards_deg"), [(0, 0), (3, 0), (5, 135), (8, 90), (8, 250)])
def test_two_buildings_have_their_edges_and_heights(slope_deg: float, towards_deg: float) -> None:
    """SLZ thesis Figure 4-17; their roofs run with the ground."""
    height = with_block(with_block(plane(slope_deg, towards_deg), *EAST_ONE, 3.0), *WEST_ONE, 6.5)
    found = around(height)
    east, west = found.obstacles  # the nearest first
    for one, edges, high in ((east, EAST_ONE, 3.0), (west, WEST_ONE, 6.5)):
        np.testing.assert_allclose(one.extent_m, edges, atol=CELL_M)
        assert one.height_m == pytest.approx(high, abs=0.05)
        area = (edges[2] - edges[0]) * (edges[3] - edges[1])
        assert one.width_m == pytest.approx(math.sqrt(area), abs=CELL_M)
        assert one.top_m == pytest.approx(at(height, one.east_m, one.north_m), abs=1e-4)
    assert east.distance_m(np.zeros(3)) == pytest.approx(4.1, abs=CELL_M)
    assert west.distance_m(np.zeros(3)) == pytest.approx(6.9, abs=CELL_M)


@pytest.mark.parametrize("slope_deg", [3.0, 8.0])
def test_a_level_roof_on_a_slope_is_over_the_ground_below_its_highest_cell(slope_deg: float) -> None:
    ground = plane(slope_deg, 90)
    height = with_block(ground, *EAST_ONE, 0.0)
    height[with_block(flat(N, N), *EAST_ONE, 1.0) > 0] = 4.0
    (one,) = around(height).obstacles
    np.testing.assert_allclose(one.extent_m, EAST_ONE, atol=CELL_M)
    assert one.top_m == pytest.approx(4.0)
    assert one.height_m == pytest.approx(4.0 - at(ground, one.east_m, one.north_m), abs=0.05)


def test_noise_does_not_hide_the_buildings_nor_add_others() -> None:
    height = with_block(with_block(plane(5, 45), *EAST_ONE, 3.0), *WEST_ONE, 6.5)
    found = around(height + np.random.default_rng(4).normal(0, 0.02, height.shape))
    east, west = found.obstacles
    np.testing.assert_allclose(east.extent_m, EAST_ONE, atol=CELL_M)
    np.testing.assert_allclose(west.extent_m, WEST_ONE, atol=CELL_M)
    assert east.height_m == pytest.approx(3.0, abs=0.12)  # the highest of 600 returns
    assert west.height_m == pytest.approx(6.5, abs=0.12)


@pytest.mark.parametrize("slope_deg", [0.0, 5.0])
def test_in_a_stadium_the_stands_are_all_around(slope_deg: float) -> None:
    """SLZ thesis Figure 4-18: the field is plain, the stands rise from 8 m on in every direction."""
    way = np.hypot(*np.meshgrid(axis(), axis()))
    stands = np.where(way > 8, 1.0 + 0.5 * np.floor(way - 8.1), 0.0)
    may_be_a_pool = "water_suspicion=1"  # what is dead level within walls all around may be one
    found = around(plane(slope_deg, 90) + stands, (0.0, 0.0), may_be_a_pool)
    (ring,) = found.obstacles
    west, south, east, north = ring.extent_m
    assert min(east, north, -west, -south) > REACH_M - 2 * CELL_M
    assert ring.height_m == pytest.approx(1.0 + 0.5 * 5, abs=0.05)
    bearing = np.arange(36) * SECTOR
    rise = slope_deg * np.sin(bearing)
    assert (found.horizon_deg > rise + math.degrees(math.atan(1.0 / 8.3)) - 1).all()
    assert ring.distance_m(np.zeros(3)) == pytest.approx(8.1, abs=2 * CELL_M)  # of a cell, not of its extent
    assert found.way_in() is not None


@pytest.mark.parametrize("gap_deg", [0, 40, 90, 200, 350])
def test_the_way_in_is_the_gap_between_the_stands(gap_deg: int) -> None:
    east, north = np.meshgrid(axis(), axis())
    off = (np.degrees(np.arctan2(east, north)) - gap_deg + 180) % 360 - 180
    stands = np.where((np.hypot(east, north) > 7) & (np.abs(off) > 20), 4.0, 0.0)
    way = around(stands).way_in()
    assert way is not None
    bearing, horizon_deg = way
    assert math.degrees(bearing) == pytest.approx(gap_deg)
    assert horizon_deg == pytest.approx(0, abs=0.1)


# ---- which obstacles ----------------------------------------------------------------------------


def test_obstacles_come_nearest_first_and_only_within_the_radius() -> None:
    ground = plane()
    places = [(9.0, 0.0), (-3.0, 0.0), (0.0, 6.0), (0.0, -12.0), (-14.6, 0.0), (11.0, 11.0)]
    for east, north in places:
        ground = with_block(ground, east - 0.3, north - 0.3, east + 0.3, north + 0.3, 1.0)
    found = around(ground).obstacles
    distances = [one.distance_m(np.zeros(3)) for one in found]
    assert distances == sorted(distances)
    assert [round(distance) for distance in distances] == [3, 6, 9, 12]


@pytest.mark.parametrize(("up", "count"), [(0.2, 0), (0.45, 1), (-1.0, 0)])
def test_only_what_rises_over_the_ground_is_an_obstacle(up: float, count: int) -> None:
    """A ditch is no place to land, but nothing to fly into."""
    assert len(around(with_block(plane(), *EAST_ONE, up)).obstacles) == count


def test_where_an_obstacle_is_on_the_globe() -> None:
    (one,) = around(with_block(plane(), *EAST_ONE, 3.0)).obstacles
    lat, lon, alt = one.lla(FRAME)
    np.testing.assert_allclose(FRAME.enu_m(lat, lon, alt), [one.east_m, one.north_m, one.top_m], atol=1e-6)
    assert lat == pytest.approx(47.0 + one.north_m / 111_170, abs=2e-6)
    assert lon == pytest.approx(8.0 + one.east_m / 76_060, abs=2e-6)
    assert alt == pytest.approx(403.0, abs=0.01)


@pytest.mark.parametrize(
    ("place", "distance_m"),
    [((0, 0), 5.0), ((6, 0), 0.0), ((6, 5), 2.0), ((-5, -7), 11.180339887), ((8, 10), math.hypot(1, 7))],
)
def test_the_distance_is_to_the_nearest_cell(place: tuple[float, float], distance_m: float) -> None:
    cells = [(east, north) for east in (5.5, 6.5) for north in (-1.5, -0.5, 0.5, 1.5, 2.5)]
    one = Obstacle(6.0, 0.0, 3.0, 3.0, np.array(cells), 1.0)
    assert one.extent_m == (5.0, -2.0, 7.0, 3.0)
    assert one.distance_m(np.array([*place, 0.0])) == pytest.approx(distance_m)


def test_beside_a_roof_the_ground_is_the_point_s_own() -> None:
    """A roof as large as the ground before it is safe too, but not what the point stands on."""
    ground = with_block(plane(), 3.1, -15.1, 15.1, 15.1, 6.0)
    (one,) = around(ground).obstacles
    assert one.height_m == pytest.approx(6.0, abs=0.05)
    assert one.extent_m[0] == pytest.approx(3.1, abs=CELL_M)


def test_on_a_roof_what_stands_is_over_the_roof() -> None:
    ground = with_block(plane(), -6.1, -6.1, 6.1, 6.1, 5.0)
    ground = with_block(ground, 2.9, 2.9, 4.1, 4.1, 1.5)
    (one,) = around(ground).obstacles
    assert one.height_m == pytest.approx(1.5, abs=0.05)
    np.testing.assert_allclose(one.extent_m, (2.9, 2.9, 4.1, 4.1), atol=CELL_M)


@pytest.mark.parametrize("up_m", [0.0, math.nan])
def test_where_no_plane_can_be_fitted_the_obstacles_are_over_the_point(up_m: float) -> None:
    """Rubble everywhere: nothing is safe ground. A point may be selected without its height."""
    rubble = np.where(np.indices((N, N)).sum(axis=0) % 8 == 0, 1.0, 0.0)
    found = around(rubble, (0.6, 0.0), up_m=up_m)
    assert len(found.obstacles) > 10
    assert {round(one.height_m, 3) for one in found.obstacles} == {1.0}
    assert np.isfinite(found.horizon_deg).all()


# ---- the horizon --------------------------------------------------------------------------------


@pytest.mark.parametrize(("east", "north"), [(0, 7), (7, 0), (0, -10), (-4, 0), (6, 8), (-12, 5), (3, -4)])
@pytest.mark.parametrize("up", [0.5, 3.0, 12.0])
def test_the_horizon_over_a_post_is_the_angle_to_its_top(east: float, north: float, up: float) -> None:
    ground = with_block(plane(), east - 0.1, north - 0.1, east + 0.1, north + 0.1, up)
    found = around(ground, (0.0, 0.0), "outlier_gap_m=20")
    sector = round(math.atan2(east, north) / SECTOR) % 36
    expected = math.degrees(math.atan(up / math.hypot(east, north)))
    assert found.horizon_deg[sector] == pytest.approx(expected, abs=0.01)
    rest = np.delete(found.horizon_deg, [(sector + i) % 36 for i in (-1, 0, 1)])
    np.testing.assert_allclose(rest, 0.0, atol=0.01)


def test_the_horizon_is_of_the_higher_of_two_things_in_a_row() -> None:
    ground = with_block(with_block(plane(), -1.1, 3.9, 1.1, 4.1, 1.0), -1.1, 11.9, 1.1, 12.1, 5.0)
    expected = max(math.degrees(math.atan(1.0 / 4.0)), math.degrees(math.atan(5.0 / 12.0)))
    assert around(ground).horizon_deg[0] == pytest.approx(expected, abs=0.05)


def test_the_horizon_does_not_count_what_lies_farther_than_the_radius() -> None:
    ground = with_block(plane(), -15.1, 14.3, 15.1, 15.1, 10.0)
    found = around(ground, (0.0, 0.0), "outlier_gap_m=20")
    np.testing.assert_allclose(found.horizon_deg, 0.0, atol=1e-4)
    assert found.obstacles == ()


def test_the_horizon_of_ground_not_seen_is_unknown() -> None:
    east, north = np.meshgrid(axis(), axis())
    unseen = (np.hypot(east, north) > 0.9) & (east > 0) & (np.abs(north) < east)
    found = around(np.where(unseen, np.nan, 0.0))
    assert np.isnan(found.horizon_deg[6:13]).all()
    np.testing.assert_allclose(np.delete(found.horizon_deg, range(4, 15)), 0.0, atol=1e-4)
    way = found.way_in(math.radians(90))
    assert way is not None
    assert math.degrees(way[0]) in (pytest.approx(40), pytest.approx(140))


# ---- the way in ---------------------------------------------------------------------------------


def view(**horizon_deg: float) -> Surroundings:
    angles = np.full(36, horizon_deg.pop("rest", 0.0))
    for sector, angle in horizon_deg.items():
        angles[int(sector[1:])] = angle
    return Surroundings(30.0, (), angles)


def test_the_way_in_is_the_least_turn_where_all_are_as_good() -> None:
    for bearing in np.radians([0.0, 14.0, 94.0, 181.0, 357.0]):
        way = view().way_in(bearing)
        assert way is not None
        assert abs((way[0] - bearing + np.pi) % (2 * np.pi) - np.pi) <= math.radians(5)


def test_the_way_in_keeps_a_sector_free_of_what_is_beside_it() -> None:
    way = view(rest=20, s9=0, s20=0, s21=0, s22=0).way_in(math.radians(90))
    assert way == (pytest.approx(math.radians(210)), 0.0)


def test_a_difference_below_two_degrees_is_worth_no_turn() -> None:
    way = view(rest=1.9, s17=0, s18=0, s19=0).way_in(0.0)
    assert way == (0.0, 1.9)
    way = view(rest=2.1, s17=0, s18=0, s19=0).way_in(0.0)
    assert way == (pytest.approx(math.pi), 0.0)


def test_no_way_in_leads_over_what_was_not_seen() -> None:
    nan = math.nan
    way = view(rest=nan, s3=30, s4=30, s5=30, s20=0).way_in(math.radians(200))
    assert way == (pytest.approx(math.radians(40)), 30.0)
    assert view(rest=nan, s3=0, s4=0).way_in() is None
    assert view(rest=nan).way_in() is None


def test_a_valley_below_the_point_is_as_good_as_level_ground() -> None:
    assert view(rest=0.0, s17=-30, s18=-30, s19=-30).way_in(0.0) == (0.0, 0.0)


# ---- over any scene -----------------------------------------------------------------------------

scenes = st.lists(
    st.tuples(
        st.integers(-9, 9),
        st.integers(-9, 9),
        st.integers(1, 4),
        st.integers(1, 4),
        st.sampled_from([0.8, 2.5]),
    ),
    min_size=1,
    max_size=4,
)
Blocks = list[tuple[int, int, int, int, float]]


def scene(blocks: Blocks) -> Floats:
    """Blocks on level ground, none of them on the point."""
    height = plane()
    for east, north, wide, deep, up in blocks:
        if east > 2 or north > 2 or east + wide < -2 or north + deep < -2:
            height = with_block(height, east + 0.1, north + 0.1, east + wide + 0.1, north + deep + 0.1, up)
    return height


def outline(found: Surroundings) -> list[tuple[float, ...]]:
    return sorted(
        tuple(np.round((*one.extent_m, one.height_m, one.width_m), 2) + 0.0) for one in found.obstacles
    )


@settings(max_examples=5, deadline=None)
@given(scenes)
def test_a_quarter_turn_of_the_scene_turns_the_answer(blocks: Blocks) -> None:
    height = scene(blocks)
    before, after = around(height), around(np.ascontiguousarray(height.T[:, ::-1]))
    np.testing.assert_allclose(after.horizon_deg, np.roll(before.horizon_deg, -9), atol=1e-4)
    turned = sorted(
        tuple(np.round((-n, w, -s, e, one.height_m, one.width_m), 2) + 0.0)
        for one in before.obstacles
        for w, s, e, n in [one.extent_m]
    )
    np.testing.assert_allclose(outline(after), turned, atol=0.011)


@settings(max_examples=5, deadline=None)
@given(scenes, st.integers(-8, 8), st.integers(-8, 8))
def test_a_shift_of_the_scene_shifts_the_answer(blocks: Blocks, cols: int, rows: int) -> None:
    """The field is surrounded by more of the same ground, so that nothing runs in over its edges."""
    own = "surround_m=11"
    height = scene(blocks)
    before = around(height, (0.0, 0.0), own)
    after = around(np.roll(height, (rows, cols), (0, 1)), (cols * CELL_M, rows * CELL_M), own)
    np.testing.assert_allclose(after.horizon_deg, before.horizon_deg, atol=1e-4)
    moved = np.array([cols, rows, cols, rows]) * CELL_M
    shifted = sorted(
        tuple(np.round((*(np.array(one.extent_m) + moved), one.height_m, one.width_m), 2) + 0.0)
        for one in before.obstacles
    )
    np.testing.assert_allclose(outline(after), shifted, atol=0.011)
