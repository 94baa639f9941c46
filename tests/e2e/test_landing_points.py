"""Obstacles around a selected landing point in three scenarios (SLZ thesis, Section 4.4.5).

Edges are accurate to a cell and `SCATTER_M`: a ray's direction is known to 0.15 degrees, and three standard
deviations of it are 0.2 m at the 26 m from which the far edges are seen. Heights are those of the exact
world; of a beam whose lower half alone meets an edge the return is placed in the beam's middle, above it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.desk.reproduce.places import PLACES, ObservedPoint, watch
from companion.desk.reproduce.source_scenes import pipeline_for
from companion.desk.reproduce.survey_recording import fly
from slz import Grid, Obstacle, Pipeline, PointState, SelectedPoint, Window

pytestmark = pytest.mark.long

SCATTER_M = 0.2
HEIGHT_M = 0.1
HALF_BEAM_M = 26.0 * np.radians(0.28) / 2
OPEN, BUILDINGS, STADIUM = PLACES

Seen = Callable[[str, str], ObservedPoint]
both_modes = pytest.mark.parametrize("mode", ["default", "source"])


@pytest.fixture(scope="session")
def seen(surveys: Path) -> Seen:
    by_name = {place.name: place for place in PLACES}
    return cache(lambda name, mode: watch(by_name[name], mode, surveys))


# ---- 1: an open plain -----------------------------------------------------------------------------


@both_modes
def test_nothing_stands_around_a_point_on_the_open_plain(seen: Seen, mode: str) -> None:
    plain = seen(OPEN.name, mode)
    assert plain.truth.standing(0.0) == []
    assert plain.selected.state is PointState.SAFE
    assert plain.surroundings.obstacles == ()
    assert np.isfinite(plain.surroundings.horizon_deg).all()
    assert plain.too_low == 0
    assert plain.too_high <= 3  # 1 m away, 0.13 m of noise on the ground


# ---- 2: between two buildings ---------------------------------------------------------------------


def beside(watched: ObservedPoint, region: str) -> tuple[Obstacle, NDArray[np.float64], float]:
    """Return the largest obstacle on a building, the building's edges and its height in the exact world."""
    corners = watched.truth.regions[region]
    edges = np.array([*corners.min(axis=0), *corners.max(axis=0)])
    on_it = [o for o in watched.surroundings.obstacles if within(o.east_m, o.north_m, edges)]
    return max(on_it, key=lambda o: o.width_m), edges, watched.truth.highest_m(region)


def within(east_m: float, north_m: float, edges: NDArray[np.float64], spare_m: float = 1.0) -> bool:
    west, south, east, north = edges.tolist()
    return west - spare_m < east_m < east + spare_m and south - spare_m < north_m < north + spare_m


@pytest.mark.parametrize("region", ["building_west", "building_east"])
@both_modes
def test_both_buildings_are_listed_with_their_edges(seen: Seen, mode: str, region: str) -> None:
    yard = seen(BUILDINGS.name, mode)
    obstacle, edges, _ = beside(yard, region)
    assert obstacle.extent_m == pytest.approx(edges, abs=yard.maps.grid.cell_m + SCATTER_M)


@pytest.mark.parametrize("region", ["building_west", "building_east"])
def test_the_buildings_heights_are_right(seen: Seen, region: str) -> None:
    obstacle, _, height_m = beside(seen(BUILDINGS.name, "default"), region)
    assert -HEIGHT_M < obstacle.height_m - height_m < HEIGHT_M + HALF_BEAM_M


@pytest.mark.parametrize("region", ["building_west", "building_east"])
def test_the_source_s_mean_of_a_cell_hides_the_parapet(seen: Seen, region: str) -> None:
    """It keeps no highest return: the roof's height is told, 0.4 m below the parapet's top, or up to it."""
    obstacle, _, height_m = beside(seen(BUILDINGS.name, "source"), region)
    assert height_m - 0.4 - HEIGHT_M < obstacle.height_m < height_m - HEIGHT_M


def test_two_buildings_are_all_there_is_and_the_ways_between_them_are_free(seen: Seen) -> None:
    yard = seen(BUILDINGS.name, "default")
    assert yard.selected.state is PointState.SAFE
    assert len(yard.surroundings.obstacles) == len(yard.truth.standing()) == 2
    assert yard.too_low == yard.too_high == 0
    way = yard.surroundings.way_in(np.pi / 2)  # from the east there is a building
    assert way is not None
    assert yard.true_horizon_deg(5.0)[round(way[0] / np.radians(10)) % 36] < 3.0


def test_the_source_loses_walls_so_its_horizon_is_too_low(seen: Seen) -> None:
    """Slopes of 40 degrees and more are never written: the roofs' outermost cells are missing."""
    yard = seen(BUILDINGS.name, "source")
    assert yard.selected.state is PointState.SAFE
    assert yard.too_low >= 15
    assert yard.too_high == 0


# ---- 3: inside the stadium ------------------------------------------------------------------------


def test_stands_rise_all_around_a_point_in_the_stadium(seen: Seen) -> None:
    """No sector is free: gangways are 1.5 m wide, and the open corner is a line of sight of no width."""
    stadium = seen(STADIUM.name, "default")
    horizon, truth = stadium.surroundings.horizon_deg, stadium.true_horizon_deg()
    assert stadium.selected.state is PointState.SAFE
    assert (truth > 6.0).all()
    assert (horizon > 6.0).all()
    assert stadium.too_low == 0
    assert stadium.too_high <= 1  # two dust returns in neighbouring cells look like a mast
    assert stadium.horizon_error_deg < 0.2


def test_the_stands_heights_and_edges_are_right(seen: Seen) -> None:
    """Blocks that touch at a corner of the stadium are one obstacle, as high as the higher."""
    stadium = seen(STADIUM.name, "default")
    stands = [pair for pair in stadium.pairs if pair.true.where.startswith("stand")]
    assert len(stands) >= 10
    assert {round(pair.true.height_m) for pair in stands} == {8, 10, 14}
    for pair in stands:
        assert pair.height_error_m == pytest.approx(0.0, abs=1.5 * HEIGHT_M)
        assert pair.edge_error_m <= 2 * stadium.maps.grid.cell_m + 1e-6  # truth is sampled by the cell, too
    assert stadium.phantoms <= 1


def test_the_source_finds_the_same_horizon_where_stands_are_stepped(seen: Seen) -> None:
    """What it leaves out, the front walls and single rows, is lower than the rows behind."""
    stadium = seen(STADIUM.name, "source")
    assert stadium.selected.state is PointState.SAFE
    assert stadium.too_low == stadium.too_high == 0


# ---- the point under watch ------------------------------------------------------------------------


class Flight:
    """A pipeline over the open plain, its point selected, to which further windows are handed on."""

    def __init__(self, surveys: Path, mode: str) -> None:
        near = [w for w in fly(OPEN.survey, surveys).windows() if np.hypot(*w.sensor_enu_m[:2]) < 25]
        self._again = min(near, key=lambda w: float(np.hypot(*w.sensor_enu_m[:2])))
        self._pipeline: Pipeline = pipeline_for(OPEN.case(mode))[0]
        for window in near:
            self._pipeline.process(window)
        self._pipeline.select(np.zeros(3))
        self._stamp_ns = near[-1].end_ns

    def look(self, way_m: float = 0.0, more: NDArray[np.float64] | None = None) -> SelectedPoint:
        """Look at the plain again ten seconds later, so far in the east, with more returns."""
        self._stamp_ns += 10**10
        shift, w = np.array([way_m, 0.0, 0.0]), self._again
        points = w.points_enu_m + shift if more is None else np.vstack([w.points_enu_m + shift, more])
        stamps = np.linspace(self._stamp_ns, self._stamp_ns + 10**9, len(points)).astype(np.int64)
        window = Window(points, stamps, w.sensor_enu_m + shift, w.frame, int(stamps[0]), int(stamps[-1]))
        report = self._pipeline.process(window)
        assert self._grid is None or (report.grid != self._grid) == (way_m != self._before_m)
        self._before_m, self._grid = way_m, report.grid
        assert report.selected is not None
        return report.selected

    _before_m = 0.0
    _grid: Grid | None = None


def crate(side_m: float, height_m: float) -> NDArray[np.float64]:
    rng = np.random.default_rng(1)
    flat = rng.uniform(-side_m / 2, side_m / 2, (60, 2))
    return np.column_stack([flat, np.full(60, height_m)])


def test_a_point_turns_unsafe_with_the_first_window_that_shows_something_on_it(surveys: Path) -> None:
    """And keeps what was last known of it while the map's window is elsewhere."""
    flight = Flight(surveys, "default")
    assert flight.look().state is PointState.SAFE
    away = flight.look(way_m=600.0)
    assert (away.state, away.surroundings.obstacles) == (PointState.SAFE, ())  # type: ignore[union-attr]
    assert flight.look().state is PointState.SAFE
    warned = flight.look(more=crate(0.5, 0.5))
    assert warned.state is PointState.UNSAFE
    (thing,) = warned.surroundings.obstacles  # type: ignore[union-attr]
    assert thing.height_m == pytest.approx(0.5, abs=HEIGHT_M)
    assert thing.extent_m == pytest.approx((-0.25, -0.25, 0.25, 0.25), abs=0.2)
    for way_m in (600.0, 1200.0):
        assert flight.look(way_m=way_m).state is PointState.UNSAFE


def test_the_source_warns_of_a_van_but_not_of_a_crate(surveys: Path) -> None:
    """A crate of 0.5 m drowns in the mean of a cell of 1 m."""
    flight = Flight(surveys, "source")
    assert flight.look(more=crate(0.5, 0.5)).state is PointState.SAFE
    assert flight.look(more=crate(2.0, 1.5)).state is PointState.UNSAFE


def test_the_source_keeps_the_state_of_a_point_out_of_its_maps(surveys: Path) -> None:
    """SLZ thesis, section 4.3.2.2."""
    flight = Flight(surveys, "source")
    assert flight.look().state is PointState.SAFE
    assert flight.look(way_m=600.0).state is PointState.SAFE
