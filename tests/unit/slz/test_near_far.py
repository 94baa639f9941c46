"""Near and far map of different cells: their windows and reported zones (SLZ thesis, Section 4.3.1)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNKNOWN, LocalFrame, Pipeline, Report, TerrainMaps
from slz.map_ground import far_parameters
from slz.points.outliers import reach_m
from tests.unit.slz.hand_made import NOWHERE, flat, returns, window

Floats = NDArray[np.float64]
Which = Literal["near", "far"]
FAR_HEIGHT_M, FAR_SPEED_MS = 100.0, 20.0
FIELD = returns(flat(120, 120), 1.0, -60.0, -60.0)


def source(*own: str) -> Pipeline:
    fixed = ["mode=source", "zone_m=400", "histogram_threshold=1", "min_square_m=5", "min_boundary_points=10"]
    limits = [f"far_height_m={FAR_HEIGHT_M}", f"far_speed_ms={FAR_SPEED_MS}"]
    return Pipeline(params.load("helicopter", [*fixed, *limits, *own]), (0.0, 0.0))


def default(*own: str) -> Pipeline:
    fixed = ["zone_m=120", "min_boundary_points=10", "register_m=0"]
    return Pipeline(params.load("quadcopter", [*fixed, *own]), (0.0, 0.0))


def over(
    pipe: Pipeline, height_m: float, second: float = 0.0, east_m: float = 0.0, ground: Floats = FIELD
) -> Report:
    """One window from a sensor so high over the ground."""
    return pipe.process(window(ground, second, (east_m, 0.0, height_m)))


def known(pipe: Pipeline, which: Which) -> TerrainMaps:
    maps = pipe.maps(which=which)
    assert maps is not None
    return maps


def farthest_m(pipe: Pipeline, which: Which) -> float:
    """How far from the origin the ground of a map is known."""
    maps = known(pipe, which)
    rows, cols = np.nonzero(maps.state != UNKNOWN)
    centres = maps.grid.centres(np.column_stack([rows + maps.box.row0, cols + maps.box.col0]))
    return float(np.hypot(*centres.T).max())


def ids(report: Report, which: Which) -> list[int]:
    return [zone.id for zone in getattr(report, which).zones]


# ---- source mode --------------------------------------------------------------------------------


def test_source_a_high_window_goes_to_the_far_map_only() -> None:
    pipe = source()
    report = over(pipe, FAR_HEIGHT_M + 1)
    assert report.choice.far
    assert pipe.maps(which="near") is None
    assert report.near.zones == ()
    assert report.far.grid.cell_m == known(pipe, "far").grid.cell_m == 10.0
    assert report.zones is report.far.zones
    assert report.grid == report.far.grid
    (zone,) = report.zones
    assert zone.area_m2 == 100.0**2  # 12 x 12 cells but for the outermost, which have no slope


def test_source_a_low_window_goes_to_the_near_map_only() -> None:
    pipe = source()
    report = over(pipe, FAR_HEIGHT_M - 1)
    assert not report.choice.far
    assert pipe.maps(which="far") is None
    assert report.far.zones == ()
    assert report.near.grid.cell_m == known(pipe, "near").grid.cell_m == 1.0
    assert report.zones is report.near.zones
    assert report.grid == report.near.grid
    assert len(report.zones) == 1


@pytest.mark.parametrize(("speed_ms", "far"), [(FAR_SPEED_MS - 1, False), (FAR_SPEED_MS + 1, True)])
def test_source_a_low_window_goes_to_the_far_map_when_it_was_flown_fast(speed_ms: float, far: bool) -> None:
    pipe = source()
    assert not over(pipe, 30.0).choice.far
    report = over(pipe, 30.0, 2.0, 2 * speed_ms)
    assert report.choice.speed_ms == pytest.approx(speed_ms)
    assert report.choice.far is far
    assert bool(report.far.zones) is far


def test_source_cells_of_the_far_map_are_those_asked_for() -> None:
    report = over(source("far_cell_m=5"), FAR_HEIGHT_M + 1)
    assert report.far.grid.cell_m == 5.0
    assert len(report.zones) == 1


def test_source_height_is_over_the_ground_not_over_the_datum() -> None:
    valley = FIELD - np.array([0.0, 0.0, 300.0])
    assert over(source(), -300 + FAR_HEIGHT_M - 1, ground=valley).choice.far is False
    assert over(source(), -300 + FAR_HEIGHT_M + 1, ground=valley).choice.far is True


def test_source_both_maps_live_on_and_both_zones_are_reported() -> None:
    """SLZ thesis Figure 4-14: one scene with zones of near and of far mode."""
    pipe = source()
    high = over(pipe, 150.0)
    far = known(pipe, "far").state
    low = over(pipe, 50.0, 1.0)
    assert low.far.zones == high.far.zones
    np.testing.assert_array_equal(known(pipe, "far").state, far)
    assert len(low.near.zones) == 1
    near = known(pipe, "near").state
    again = over(pipe, 150.0, 2.0)
    assert [zone.box for zone in again.near.zones] == [zone.box for zone in low.near.zones]
    np.testing.assert_array_equal(known(pipe, "near").state, near)
    assert high.zones is high.far.zones
    assert low.zones is low.near.zones
    assert again.zones is again.far.zones
    assert ids(again, "near") == ids(low, "near")
    assert ids(again, "far") == ids(high, "far")
    assert not set(ids(again, "near")) & set(ids(again, "far"))


def test_source_a_window_moves_only_the_map_it_goes_to() -> None:
    pipe = source()
    over(pipe, 50.0)
    there = over(pipe, 150.0, 60.0, 600.0, FIELD + np.array([600.0, 0.0, 0.0]))
    assert there.near.grid.west_m == -200
    assert there.far.grid.west_m > 300
    assert len(there.near.zones) == 1


@pytest.mark.parametrize(
    ("heights", "far"),
    [
        ((99, 100, 101, 99, 91, 90, 91, 99, 101), (0, 0, 1, 1, 1, 0, 0, 0, 1)),
        ((91, 99, 89, 99), (0, 0, 0, 0)),
        ((101, 89, 91), (1, 0, 0)),
    ],
)
def test_source_far_mode_lasts_down_to_nine_tenths_of_the_height(
    heights: tuple[float, ...], far: tuple[int, ...]
) -> None:
    pipe = source()
    seen = [over(pipe, height, second).choice.far for second, height in enumerate(heights)]
    assert seen == [bool(f) for f in far]


def test_source_far_mode_lasts_down_to_nine_tenths_of_the_speed() -> None:
    pipe = source("zone_m=2000")
    seen, east_m = [], 0.0
    for second, speed_ms in enumerate((0, 19, 21, 19, 18.5, 17.5, 19, 21)):
        east_m += speed_ms
        seen.append(over(pipe, 50.0, second, east_m).choice.far)
    assert seen == [False, False, True, True, True, False, False, True]


def test_source_a_slow_window_is_far_while_it_is_high_and_a_low_one_while_it_is_fast() -> None:
    pipe = source("zone_m=2000")
    high_and_fast = [over(pipe, 150.0, 0.0, 0.0), over(pipe, 150.0, 1.0, 30.0)]
    high_and_slow = over(pipe, 150.0, 2.0, 31.0)
    low_and_fast = over(pipe, 20.0, 3.0, 61.0)
    low_and_slow = over(pipe, 20.0, 4.0, 62.0)
    far = [r.choice.far for r in (*high_and_fast, high_and_slow, low_and_fast, low_and_slow)]
    assert far == [True, True, True, True, False]


def test_source_a_stored_cloud_is_near() -> None:
    """Nothing is known of its height and speed."""
    report = source().process(window(FIELD, 0.0, NOWHERE))
    assert not report.choice.far
    assert report.zones is report.near.zones
    assert report.zones


@pytest.mark.parametrize("nothing", [np.zeros((0, 3)), np.full((3, 3), np.nan)])
def test_source_a_window_without_returns_changes_no_map_and_no_mode(nothing: Floats) -> None:
    pipe = source()
    before = over(pipe, 150.0)
    after = over(pipe, 150.0, 1.0, ground=nothing)
    assert after.choice.far
    assert after.zones == before.zones
    low = over(pipe, 50.0, 2.0)
    assert not low.choice.far
    assert not over(pipe, 50.0, 3.0, ground=nothing).choice.far


# ---- default mode -------------------------------------------------------------------------------


@pytest.mark.parametrize("height_m", [10.0, 39.0, 41.0, 60.0])
def test_each_window_goes_to_both_maps_and_the_near_zones_are_reported(height_m: float) -> None:
    pipe = default()
    report = over(pipe, height_m, ground=returns(flat(150, 150), 0.2, -15.0, -15.0))
    assert report.choice.far is (height_m > 40)
    assert known(pipe, "near").grid.cell_m == 0.2
    assert known(pipe, "far").grid.cell_m >= 0.5
    assert len(report.near.zones) == len(report.far.zones) == 1
    assert report.zones is report.near.zones
    assert report.grid == report.near.grid
    assert not set(ids(report, "near")) & set(ids(report, "far"))


def test_the_far_map_reaches_farther_than_the_near_one() -> None:
    """An error of a ray's direction says little of a cell that is wide."""
    pipe = default("max_range_m=40")
    reach = reach_m(params.load("quadcopter", ["max_range_m=40"]))
    report = over(pipe, 20.0, ground=returns(flat(200, 200), 0.5, -50.0, -50.0))
    assert 10 < reach < 20
    assert farthest_m(pipe, "near") < reach
    assert 30 < farthest_m(pipe, "far") < 40
    assert report.n_used < report.n_points
    near, far = report.near.zones[0], report.far.zones[0]
    assert far.area_m2 > 3 * near.area_m2


def test_neither_map_reaches_farther_than_max_range() -> None:
    pipe = default("angle_noise_deg=0", "max_range_m=20")
    over(pipe, 10.0, ground=returns(flat(120, 120), 0.5, -30.0, -30.0))
    assert 15 < farthest_m(pipe, "near") < 20
    assert 15 < farthest_m(pipe, "far") < 20


def test_a_wide_cell_hides_no_hazard_of_the_near_map() -> None:
    """The near map alone decides on a zone to land in; its cells stay as fine as they are."""
    ground = flat(150, 150)
    ground[74:77, 74:77] = 1.0
    pipe = default()
    for second in range(4):
        over(pipe, 60.0, second, ground=returns(ground, 0.2, -15.0, -15.0))
    near = known(pipe, "near")
    row, col = near.grid.index(0.1, 0.1)
    assert near.grid.cell_m == 0.2
    around = near.state[row - near.box.row0 - 4 :, col - near.box.col0 - 4 :][:9, :9]
    assert not (around == SAFE).any()


@pytest.mark.parametrize(
    ("far_cell_m", "cell_m", "evidence_m"), [(1.0, 0.2, 0.25), (2.0, 0.1, 0.5), (1.0, 0.5, 0.5)]
)
def test_the_evidence_of_the_far_map_is_four_times_as_fine_as_its_cells_and_never_finer_than_the_near_one(
    far_cell_m: float, cell_m: float, evidence_m: float
) -> None:
    near = params.load(
        "quadcopter", [f"far_cell_m={far_cell_m}", f"cell_m={cell_m}", "min_boundary_points=100"]
    )
    far = far_parameters(near)
    assert far.cell_m == evidence_m
    assert far.min_boundary_points == int(100 * cell_m / evidence_m)
    assert far.coverage_m == max(near.coverage_m, far_cell_m)
    assert far.min_square_m == max(near.min_square_m, far_cell_m)
    assert far.height_noise_m == 2 * near.height_noise_m
    assert far.memory_mb == near.memory_mb / 8


@pytest.mark.parametrize("mode", ["source", "default"])
def test_a_window_of_another_frame_begins_new_maps(mode: str) -> None:
    pipe = source() if mode == "source" else default()
    over(pipe, 30.0)
    first = pipe.maps()
    assert first is not None
    again = window(FIELD[FIELD[:, 0] > 0], 1.0, (0.0, 0.0, 30.0))
    pipe.process(replace(again, frame=LocalFrame(46.0, 7.0, 300.0)))
    second = known(pipe, "near")
    assert second.frame == LocalFrame(46.0, 7.0, 300.0)
    rows, cols = np.nonzero(second.state != UNKNOWN)
    east = second.grid.centres(np.column_stack([rows + second.box.row0, cols + second.box.col0]))[:, 0]
    assert east.min() > -2.0


@pytest.mark.parametrize(("east", "north"), [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_the_zone_follows_once_the_vehicle_is_nearer_to_an_edge_than_a_quarter_of_it(
    east: int, north: int
) -> None:
    pipe, places = default("zone_m=80"), [0.0, 19.0, 21.0]
    here, near, moved = (
        pipe.process(window(FIELD[::4], float(k), (away * east, away * north, 30.0))).near.grid
        for k, away in enumerate(places)
    )
    assert near == here
    assert moved.west_m - here.west_m == pytest.approx(21.0 * east, abs=0.2)
    assert moved.south_m - here.south_m == pytest.approx(21.0 * north, abs=0.2)
