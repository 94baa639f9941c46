"""Maps after long, far or unusual flights: their size, their time, and their output."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNKNOWN, UNSAFE, LocalFrame, Pipeline, Window
from slz.grid import Box, Grid
from slz.kernels.cells.cell_record import NOISE
from slz.kernels.paper.zone_statistics import inside_count
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.tiles import TILE_BYTES, Noise, Tiles
from slz.zones.detection import search_components
from slz.zones.zone_map import ZoneMap
from tests.unit.slz.hand_made import near_map

FRAME = LocalFrame(47.0, 8.0, 400.0)
S = 1_000_000_000
Points = NDArray[np.float64]


def ground(half_m: float, step_m: float = 0.2, east_m: float = 0.0, up_m: float = 0.0) -> Points:
    axis = np.arange(-half_m, half_m, step_m) + step_m / 2
    east, north = (part.ravel() for part in np.meshgrid(axis, axis))
    rng = np.random.default_rng(len(axis))
    return np.column_stack([east + east_m, north, up_m + rng.normal(0, 0.005, len(east))])


def window(points: Points, sensor: tuple[float, float, float], second: float) -> Window:
    stamps = np.full(len(points), round(second * S), np.int64)
    return Window(points, stamps, np.array(sensor), FRAME, int(stamps[0]), int(stamps[0]))


@pytest.mark.parametrize("far_m", [1_000.0, 300_000.0])
def test_returns_are_looked_up_in_tiles_however_far_others_lie(far_m: float) -> None:
    tiles = Tiles(0.0, 0.0, 0.2, 64 * TILE_BYTES)
    everywhere = Box(-(2**30), 2**30, -(2**30), 2**30)
    for east_m in (far_m, 0.0):
        tiles.add(ground(8.0, 0.2, east_m), np.zeros(3), Noise(0.02, 0.0), everywhere, 0.0, 8.0)
    above = ground(8.0, 0.4, 0.0, 0.5)
    assert len(tiles.differences(above)) == len(above)
    assert tiles.contradicted_by(above, np.array([0.0, 0.0, 9.0]), Noise(0.02, 0.0), 0.2).all()
    elsewhere = above + np.array([far_m / 2, 0.0, 0.0])
    assert not len(tiles.differences(elsewhere))
    assert not tiles.contradicted_by(elsewhere, np.zeros(3), Noise(0.02, 0.0), 0.2).any()


def test_a_clock_that_leaps_ahead_keeps_its_seconds() -> None:
    """Numbers of four bytes tell 128 s apart at the seconds of today."""
    tiles = Tiles(0.0, 0.0, 0.2, 0)
    assert [tiles.now_s(stamp) for stamp in (5.0, 6.0)] == [0.0, 1.0]
    leapt = tiles.now_s(1_700_000_000.0)
    assert 86_400.0 < leapt < 200_000.0
    assert tiles.now_s(1_700_000_000.5) == leapt + 0.5


@pytest.mark.parametrize("zone_m", [20.0, 61.0])
def test_the_window_keeps_its_size_through_all_changes_of_level(zone_m: float) -> None:
    parameters = params.load("quadcopter", [f"zone_m={zone_m}"])
    far = ZoneMap(parameters, (3.0, 4.0), iter(range(9)))
    first = far.terrain.grid
    for step in range(60):
        far.add_points(np.empty((0, 3)), np.array([1.7 * step, -0.9 * step, 30.0]), float(step))
        before = far.terrain.grid
        far.at_level((0, 2, 1, 3)[step % 4])
        grid = far.terrain.grid
        coarse_m = max(before.cell_m, grid.cell_m)
        assert abs(grid.west_m + grid.east_m - before.west_m - before.east_m) <= 2 * coarse_m
        assert abs(grid.south_m + grid.north_m - before.south_m - before.north_m) <= 2 * coarse_m
        assert zone_m <= grid.rows * grid.cell_m + 1e-6 <= zone_m + 2 * grid.cell_m
        assert grid.rows == grid.cols
    far.at_level(0)
    assert (far.terrain.grid.rows, far.terrain.grid.cols) == (first.rows, first.cols)


def test_what_was_drawn_is_bounded_though_nobody_looks_and_who_looks_then_is_told_all() -> None:
    parameters = params.load("quadcopter", ["zone_m=60", "memory_mb=16", "adaptive=off"])
    pipe = Pipeline(parameters)
    serials = set()
    for second in range(60):
        east_m = 12.0 * second
        pipe.process(window(ground(9.0, 0.3, east_m), (east_m, 0.0, 15.0), second))
        near = near_map(pipe)
        assert isinstance(near, ZoneMap)
        assert len(near.terrain.changed_tiles) <= 2 * near.terrain.tiles.capacity + 60
        serials.add(near.terrain.serial)
    assert len(serials) > 1
    drawn = pipe.drawn("near", 1000)
    assert drawn is not None
    assert drawn.serial == near.terrain.serial


def test_noise_is_of_the_way_from_the_sensor_whatever_the_barometer_s_drift() -> None:
    """The maps keep heights without the drift: the sensor's is taken as they are."""
    parameters = params.load("quadcopter", ["zone_m=60", "range_noise_m=0.05", "angle_noise_deg=0"])
    noises = []
    for drift_m in (0.0, 2.0, -1.5):
        zone_map = ZoneMap(parameters, (0.0, 0.0), iter(range(9)))
        zone_map.tiles.datum_m = drift_m
        zone_map.add_points(ground(6.0), np.array([0.0, 0.0, 4.0 + drift_m]), 0.0)
        noises.append(zone_map.tiles.read(Box(0, 300, 0, 300))[..., 0, NOISE])
    assert noises[0].max() > 0
    for noise in noises[1:]:
        np.testing.assert_allclose(noise, noises[0], rtol=1e-5)


def test_what_stands_on_unseen_ground_is_as_high_as_its_highest_return() -> None:
    """Nothing is known of the ground about a mast: it is no less in the way."""
    rng = np.random.default_rng(8)
    level = ground(12.0)
    level = level[np.hypot(level[:, 0] - 6.0, level[:, 1]) > 2.5]
    mast = rng.uniform((5.9, -0.1, 0.3), (6.1, 0.1, 10.0), (300, 3))
    pipe = Pipeline(params.load("quadcopter", ["adaptive=off"]))
    report = pipe.process(window(np.vstack([level, mast]), (0.0, 0.0, 15.0), 0.0))
    maps = pipe.maps(which="near")
    assert maps is not None
    row, col = maps.grid.index(6.0, 0.0)
    assert maps.state[row - maps.box.row0, col - maps.box.col0] == UNKNOWN
    assert report.nearby is not None
    assert report.nearby.columns_enu_m(9.0)[:, 2].max() == pytest.approx(mast[:, 2].max(), abs=0.4)
    pipe.select(np.array([0.0, 0.0, 0.0]))
    selected = pipe.process(window(level, (0.0, 0.0, 15.0), 1.0)).selected
    assert selected is not None
    assert selected.surroundings is not None
    horizon_deg = np.degrees(np.arctan2(mast[:, 2].max(), 6.0))
    assert np.nanmax(selected.surroundings.horizon_deg) == pytest.approx(horizon_deg, abs=2.0)


def test_a_zone_holds_the_square_for_which_it_is_one() -> None:
    """A square of four cells that touches a line of cells at a corner is no crumb."""
    safe = np.zeros((20, 20), np.uint8)
    safe[5:7, 5:7] = 1
    safe[7, 7:19] = 1
    (found,) = search_components(safe, Box(0, 20, 0, 20), 2, 1)
    assert found.square_side == 2
    assert found.component.sum() == 16


@pytest.mark.parametrize("form", ["fortran", "strided", "columns"])
def test_points_may_lie_in_memory_in_any_order(form: str) -> None:
    points = ground(8.0)
    made = {
        "fortran": np.asfortranarray(points),
        "strided": np.repeat(points, 2, axis=0)[::2],
        "columns": np.column_stack([points, np.ones(len(points))])[:, :3],
    }[form]
    reports = [Pipeline(params.Parameters()).process(window(p, (0, 0, 15), 0)) for p in (points, made)]
    assert reports[0].zones
    assert [zone.area_m2 for zone in reports[1].zones] == [zone.area_m2 for zone in reports[0].zones]


@pytest.mark.parametrize("place", [1e308, 1e9, -2e8])
def test_a_point_beyond_the_earth_is_refused_and_the_next_window_is_computed(place: float) -> None:
    pipe = Pipeline(params.Parameters())
    pipe.process(window(ground(8.0), (0, 0, 15), 0))
    with pytest.raises(ValueError, match="within"):
        pipe.select(np.array([place, 0.0, 0.0]))
    assert pipe.process(window(ground(8.0), (0, 0, 15), 1)).selected is None


def test_a_long_strip_is_drawn_in_parts_as_it_would_be_as_a_whole() -> None:
    """Longer than what is drawn at a time, and along both axes."""
    parameters = params.load("quadcopter", ["zone_m=200"])
    strip = ground(40.0, 0.25)
    along = {"east": np.abs(strip[:, 1]) < 3.0, "north": np.abs(strip[:, 0]) < 3.0}
    for part in along.values():
        whole, parts = (EvidenceTerrain(Grid(-100, -100, 0.2, 1000, 1000), parameters) for _ in "wp")
        whole.add(strip[part], np.array([0.0, 0.0, 20.0]), 0.0)
        for side in (strip[part, 0] + strip[part, 1] < 0, strip[part, 0] + strip[part, 1] >= 0):
            parts.add(strip[part][side], np.array([0.0, 0.0, 20.0]), 0.0)
        state = whole.state(Box(0, 1000, 0, 1000))
        np.testing.assert_array_equal(state, parts.state(Box(0, 1000, 0, 1000)))
        assert (state == SAFE).sum() > 300 * 10
        assert not (state == UNSAFE).any()


def test_boundary_cells_just_outside_a_content_are_not_in_it() -> None:
    content = np.full((4, 1), ~np.uint64(0))
    for row, col in ((9, 22), (10, 19), (14, 22), (10, 20 + 64)):
        assert inside_count(np.array([[row, col]], np.int32), content, 10, 20, 5) == 0
    assert inside_count(np.array([[10, 20], [13, 20 + 63]], np.int32), content, 10, 20, 5) == 2


def test_too_many_boundary_cells_outside_a_content_are_not_counted_on() -> None:
    content = np.zeros((1, 2), np.uint64)
    content[0, 1] = 1 << 3  # column 67 only
    boundary = np.array([[0, 67], [0, 66], [0, 68]], np.int32)
    assert inside_count(boundary, content, 0, 0, 2) == 1
    assert inside_count(boundary, content, 0, 0, 1) == -1
