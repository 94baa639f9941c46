"""Memory of tiles: proportional to seen ground, within a budget, never at the cost of the chosen point."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from params import Parameters
from slz import SAFE, UNKNOWN, LocalFrame, Pipeline, PointState, Report, Window
from slz.grid import Box, Grid
from slz.kernels.cells.cell_record import TILE
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_view import DISPLAYED, read_changes
from slz.terrain.tiled_raster import TiledLayers
from slz.terrain.tiles import LEAST_CAPACITY, TILE_BYTES, Noise, Tiles
from slz.tile_slots import box_of_tile

FRAME = LocalFrame(47.0, 8.0, 400.0)
EVERYWHERE = Box(-(10**6), 10**6, -(10**6), 10**6)
NOISE = Noise(0.02, 0.0)
ABOVE = np.array([0.0, 0.0, 30.0])


def points_at(*places: tuple[float, float]) -> NDArray[np.float64]:
    return np.array([(east, north, 1.0) for east, north in places])


def add(tiles: Tiles, points: NDArray[np.float64], now_s: float = 0.0, **more: object) -> object:
    return tiles.add(points, ABOVE, NOISE, EVERYWHERE, now_s, 8.0, **more)  # type: ignore[arg-type]


def test_tiles_are_made_where_points_fall_and_nowhere_else() -> None:
    tiles = Tiles(0.0, 0.0, 0.2, 64 * TILE_BYTES)
    add(tiles, points_at((0.1, 0.1), (1000.0, -500.0)))
    assert len(tiles) == 2
    row, col = int(np.floor(-500 / 0.2)), 5000
    read = tiles.read(Box(row - 1, row + 2, col - 1, col + 2))
    assert read[..., 0, 0].sum() == 1
    assert read[1, 1, 0, 1] == 1.0  # its mean


def test_a_box_reads_the_same_whatever_tiles_it_crosses() -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-30, 30, (5000, 2)), rng.normal(0, 1, 5000)])
    tiles = Tiles(-1.0, 2.0, 0.5, 64 * TILE_BYTES)
    add(tiles, points)
    whole = tiles.read(Box(-70, 60, -65, 70))
    for box in (Box(-64, 0, -64, 0), Box(-1, 1, -1, 1), Box(13, 60, -65, 70)):
        part = whole[box.row0 + 70 : box.row1 + 70, box.col0 + 65 : box.col1 + 65]
        np.testing.assert_array_equal(tiles.read(box), part)
    assert whole[..., 0, 0].sum() == 5000


def test_a_point_differs_from_the_mean_of_its_own_cell_and_of_no_other() -> None:
    cell_m = 0.5
    row, col = np.mgrid[-70:70:3, -66:67:2]  # of several tiles, west and south of the corner too
    places = np.column_stack([(col.ravel() + 0.5) * cell_m, (row.ravel() + 0.5) * cell_m])
    height = 1.0 * row.ravel() + 0.01 * col.ravel()
    tiles = Tiles(0.0, 0.0, cell_m, 64 * TILE_BYTES)
    add(tiles, np.column_stack([places, height]))
    over = np.column_stack([places, height + 0.25])
    beside = over + np.array([cell_m, 0.0, 0.0])  # no cell there was hit
    rim = [(65.2, 0.2), (0.2, 65.2), (-64.3, 0.2), (0.2, -64.3)]  # the first tile beyond all that are held
    found = tiles.differences(np.vstack([beside, points_at(*rim), over]))
    number = len(beside) + len(rim) + np.arange(len(over))
    want = np.column_stack([places, np.full(len(places), 0.25), number])
    np.testing.assert_allclose(found, want, atol=1e-5)


def far_apart(number: int) -> NDArray[np.float64]:
    return points_at((number * 100.0 + 0.1, 0.1))


def test_the_ground_not_seen_for_longest_goes_first_and_a_pinned_tile_never() -> None:
    tiles = Tiles(0.0, 0.0, 0.2, 0)
    for number in range(LEAST_CAPACITY):
        add(tiles, far_apart(number), now_s=number)
    pinned = tiles.keys_over(Box(0, 1, 0, 1))
    add(tiles, far_apart(1), now_s=50.0)  # seen again
    change = add(tiles, far_apart(100), now_s=51.0, pinned=pinned)
    assert change.evicted == tiles.keys_over(Box(0, 1, 1000, 1001))  # type: ignore[attr-defined]
    assert tiles.read(Box(0, 1, 0, 1))[0, 0, 0, 0] == 1
    assert tiles.read(Box(0, 1, 500, 501))[0, 0, :, 0].tolist() == [1, 1]  # one return an epoch
    assert tiles.read(Box(0, 1, 1000, 1001))[0, 0, 0, 0] == 0


def test_of_more_ground_at_once_than_the_budget_holds_the_nearest_is_kept_and_the_rest_counted() -> None:
    tiles = Tiles(0.0, 0.0, 0.2, 0)
    points = np.vstack([far_apart(number) for number in range(LEAST_CAPACITY + 5)])
    change = add(tiles, points)
    assert change.n_dropped == 5  # type: ignore[attr-defined]
    assert tiles.read(Box(0, 1, 0, 1))[0, 0, 0, 0] == 1
    assert tiles.read(Box(0, 1, 500 * (LEAST_CAPACITY + 4), 500 * (LEAST_CAPACITY + 4) + 1))[0, 0, 0, 0] == 0


@pytest.mark.parametrize(("east", "north"), [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_the_nearest_ground_is_kept_in_whatever_direction_it_lies(east: int, north: int) -> None:
    tiles = Tiles(50.0, -30.0, 0.2, 0)
    sensor = np.array([-400.0, 300.0, 30.0])
    away = 40.0 * np.arange(1, LEAST_CAPACITY + 6)
    places = sensor[:2] + away[:, np.newaxis] * [east, north]
    points = points_at(*places[::-1].tolist())
    change = tiles.add(points, sensor, NOISE, EVERYWHERE, 0.0, 8.0)
    assert change.n_dropped == 5
    row, col = np.floor((places - [50.0, -30.0]) / 0.2).astype(int).T[::-1]
    seen = [tiles.read(Box(r, r + 1, c, c + 1))[0, 0, 0, 0] for r, c in zip(row, col, strict=True)]
    assert seen == [1.0] * LEAST_CAPACITY + [0.0] * 5


@pytest.mark.parametrize("level", [0, 1, 3])
def test_a_map_s_tile_is_kept_while_evidence_lies_under_or_beside_it(level: int) -> None:
    """Beside, because a footprint reaches over a tile's edge."""
    tiles = Tiles(0.0, 0.0, 0.2, 64 * TILE_BYTES)
    add(tiles, points_at((0.1, 0.1), (100.0, -70.0), (-200.0, 40.0)))
    held = {(0, 0), (-6, 7), (3, -16)}
    side = 2**level
    for row, col in np.ndindex(24, 24):
        key = row - 12, col - 12
        near = any(
            key[0] * side - 1 <= r <= (key[0] + 1) * side and key[1] * side - 1 <= c <= (key[1] + 1) * side
            for r, c in held
        )
        assert tiles.any_near(key, level) == near, key


def test_what_stands_over_known_ground_is_told_in_every_tile_and_over_unknown_ground_in_none() -> None:
    row, col = np.mgrid[-140:140:9, -130:131:11]
    places = np.column_stack([(col.ravel() + 0.5) * 0.5, (row.ravel() + 0.5) * 0.5])
    height = 0.1 * np.arange(len(places))
    tiles = Tiles(0.0, 0.0, 0.5, 64 * TILE_BYTES)
    add(tiles, np.column_stack([places, height]))
    over = 0.9 + 0.2 * (np.arange(len(places)) % 2)  # every other one more than the least of 1 m
    asked = np.column_stack([places, height + over])
    sensor = np.array([10.0, -20.0, 30.0])
    told = tiles.contradicted_by(asked, sensor, NOISE, 1.0)
    np.testing.assert_array_equal(told, np.arange(len(places)) % 2 == 1)
    flags = (np.arange(len(places)) // 2 % 8).astype(np.uint16)
    marked = np.where(told & ((flags & (2 | 4)) == 2), flags | 8, flags)
    tiles.mark_above(asked, flags, (2, 4, 8), sensor, NOISE, 1.0)
    np.testing.assert_array_equal(flags, marked)
    assert not tiles.contradicted_by(asked + np.array([0.5, 0.0, 0.0]), sensor, NOISE, 1.0).any()
    rim = [(100.2, 0.2), (0.2, 100.2), (-100.3, 0.2), (0.2, -100.3)]
    assert not tiles.contradicted_by(points_at(*rim) * [1, 1, 99], sensor, NOISE, 1.0).any()
    blurred = Noise(0.02, 0.01)  # four deviations of the angle, 4 cm for each metre of the way
    way_m = np.hypot(*(places - sensor[:2]).T)
    told = tiles.contradicted_by(np.column_stack([places, height + 2.0]), sensor, blurred, 1.0)
    clear = np.abs(0.04 * way_m - 1.0) > 0.01
    np.testing.assert_array_equal(told[clear], (0.04 * way_m < 1.0)[clear])


def test_layers_hold_what_was_written_and_zero_elsewhere() -> None:
    layers = TiledLayers([0.0, 0.0])
    values = np.arange(2 * 90 * 70, dtype=np.float32).reshape(2, 90, 70)
    states = (np.arange(90 * 70, dtype=np.uint32) % 3).astype(np.uint8).reshape(1, 90, 70)
    layers.write(Box(-20, 70, 60, 130), values, states)
    np.testing.assert_array_equal(layers.states(Box(-20, 70, 60, 130)), states[0])
    assert (layers.states(Box(-21, 71, 59, 131)) == UNKNOWN).sum() == 92 * 72 - 90 * 70
    np.testing.assert_array_equal(layers.read(Box(-20, 70, 60, 130), 1), values[1])
    assert layers.read(Box(-21, 71, 59, 131)).sum() == values[0].sum()
    layers.keep(lambda key: key != (0, 1))
    assert not layers.read(box_of_tile((0, 1))).any()
    assert layers.read(Box(-20, 0, 60, 130)).any()


# ---- through the pipeline -----------------------------------------------------------------------


def strip(east: float, seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-10, 10, (8_000, 2)) + np.array([east, 0.0])
    return np.column_stack([xy, rng.normal(0, 0.02, len(xy))])


def fly(pipe: Pipeline, east: float, second: int) -> Report:
    points = strip(east, second)
    start = second * 10**9
    stamps = np.full(len(points), start, np.int64)
    return pipe.process(Window(points, stamps, np.array([east, 0.0, 20.0]), FRAME, start, start))


@pytest.fixture
def small() -> Pipeline:
    own = ["zone_m=60", "memory_mb=16", "register_m=0", "min_boundary_points=10", "max_age_s=1000"]
    return Pipeline(params.load("quadcopter", own).model_copy(update={"memory_mb": 8.0}), (0.0, 0.0))


def test_the_chosen_point_stays_known_when_the_budget_gives_up_the_ground_around(small: Pipeline) -> None:
    fly(small, 0.0, 0)
    small.select(np.array([0.0, 0.0, 0.0]))
    evicted, last = 0, None
    for second in range(1, 20):
        last = fly(small, 12.0 * second, second)
        evicted += last.n_evicted
    assert last is not None
    assert evicted > 10
    assert last.n_without_tile == 0
    assert last.selected is not None
    assert last.selected.state is PointState.SAFE


@pytest.mark.parametrize("around_m", [0.0, 9.0, 21.0])
def test_all_tiles_that_decide_on_the_chosen_point_are_pinned(around_m: float) -> None:
    terrain = EvidenceTerrain(Grid(-40.0, -40.0, 0.2, 400, 400), Parameters())
    for east, north in ((0.05, 0.05), (-12.9, 3.0), (7.7, -25.5)):
        terrain.pin(np.array([east, north, 0.0]), around_m)
        for angle in np.linspace(0, 2 * np.pi, 32, endpoint=False):
            rim = np.array([east + around_m * np.cos(angle), north + around_m * np.sin(angle)])
            key = tuple(np.floor((rim + 40.0) / (64 * 0.2)).astype(int)[::-1].tolist())
            assert key in terrain.pinned
        assert len(terrain.pinned) <= (2 * (around_m + 6.0) / 12.8 + 2) ** 2
    terrain.pin(None)
    assert not terrain.pinned


def test_ground_given_up_is_unknown_and_so_is_the_edge_of_what_is_left(small: Pipeline) -> None:
    for second in range(20):
        report = fly(small, 12.0 * second, second)
    grid = report.grid

    def state(east: float) -> int:
        row, col = grid.index(east, 0.0)
        found = small.maps(Box(row, row + 1, col, col + 1))
        assert found is not None
        return int(found.state[0, 0])

    assert state(12.0 * 19) == SAFE
    assert state(0.0) == UNKNOWN
    states = np.array([state(east) for east in np.arange(0.0, 12.0 * 19, 0.2)])
    assert set(np.unique(states)) == {SAFE, UNKNOWN}
    first = int(np.argmax(states == SAFE))
    assert (states[first:] == SAFE).all()


def test_returning_to_a_place_shows_what_was_seen_there_before() -> None:
    """Zones are windows onto the ground: moving one forgets nothing."""
    own = ["zone_m=60", "register_m=0", "min_boundary_points=10"]
    pipe = Pipeline(params.load("quadcopter", own), (0.0, 0.0))
    first = fly(pipe, 0.0, 0)
    for second in range(1, 8):
        away = fly(pipe, 15.0 * second, second)
    assert all(zone.id != first.zones[0].id or away.grid != first.grid for zone in away.zones)
    back = pipe.process(
        Window(
            np.array([[0.05, 12.0, 0.0]]), np.array([9 * 10**9]), np.array([0.0, 0.0, 20.0]),
            FRAME, 9 * 10**9, 9 * 10**9,
        )
    )  # fmt: skip
    assert back.grid != away.grid
    row, col = back.grid.index(0.0, 0.0)
    found = pipe.maps(Box(row, row + 1, col, col + 1))
    assert found is not None
    assert found.state[0, 0] == SAFE


# Order of changed tiles: nearest to the vehicle first.


CELL_M = 0.5
SIDE_M = TILE * CELL_M
KEYS = {(0, 0), (0, 7), (6, 0), (-3, -4)}


def terrain() -> Any:
    nothing = (list(np.zeros((len(DISPLAYED), TILE, TILE), np.float32)), np.zeros((TILE, TILE), np.uint8))
    return SimpleNamespace(
        changed_tiles=set(KEYS), grid=SimpleNamespace(cell_m=CELL_M), corner_m=(100.0, 200.0), serial=7,
        tile=lambda key, _names: None if key == (-3, -4) else nothing,
    )  # fmt: skip


@pytest.mark.parametrize("nearest", sorted(KEYS - {(-3, -4)}))
def test_the_nearest_tile_comes_first_and_the_others_wait(nearest: tuple[int, int]) -> None:
    maps = terrain()
    row, col = nearest
    around = np.array([100.0 + (col + 0.4) * SIDE_M, 200.0 + (row + 0.6) * SIDE_M, 30.0])
    drawn = read_changes(maps, 1, around)
    assert [tile.key for tile in drawn.tiles] == [nearest]
    assert drawn.left == 3
    assert maps.changed_tiles == KEYS - {nearest}


def test_the_order_is_that_of_the_distance() -> None:
    around = np.array([100.0 + 0.5 * SIDE_M, 200.0 + 0.5 * SIDE_M])
    maps = terrain()
    taken = [read_changes(maps, 1, around) for _ in range(4)]
    assert [[t.key for t in d.tiles] or list(d.gone) for d in taken] == [
        [(0, 0)],
        [(-3, -4)],
        [(6, 0)],
        [(0, 7)],
    ]
    assert not maps.changed_tiles


def test_where_the_vehicle_is_not_known_any_come_first() -> None:
    maps = terrain()
    assert len(read_changes(maps, 2, np.full(3, np.nan)).tiles) in (1, 2)
    assert len(maps.changed_tiles) == 2
