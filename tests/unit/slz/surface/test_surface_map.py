"""Surface map of a flight: look-ups, changes, age and memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import params
from slz.kernels.cells.cell_record import TILE
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceKind
from slz.surface.surface_map import LEAST_TILES, NO_SIGNAL, SHAPE_HOLD_S, Edges, Signal, SurfaceMap
from tests.unit.slz.surface.made_ground import Flags, Floats, from_middle, lake, returns_of

EVERYWHERE = (-1e5, -1e5, 1e5, 1e5)
SENSOR = np.array([40.0, 40.0, 30.0])
MAX_AGE_S = 20.0
WEST_M, SOUTH_M = -13.5, -7.5  # lakes are across the edges of tiles
FAR_OFF_M = np.array([1000.0, 0, 0])
LAKE = returns_of(lake(), 80, 4)
SLOPE = returns_of(lambda x, _: 0.05 * x, 80, 4)


def new(*settings: str) -> SurfaceMap:
    own = ["cell_m=0.5", f"max_age_s={MAX_AGE_S}", *settings]
    return SurfaceMap(WEST_M, SOUTH_M, params.load("quadcopter", own))


def shown(
    surface: SurfaceMap,
    points: Floats,
    now_s: float = 0.0,
    signal: Signal = NO_SIGNAL,
    grid: Edges = EVERYWHERE,
    sensor: Floats = SENSOR,
) -> list[Edges]:
    points = np.ascontiguousarray(points)
    return surface.update(points, np.ones(len(points), np.bool_), sensor, now_s, signal, grid)


def around(surface: SurfaceMap) -> Flags:
    """Return which cells of 200 m x 200 m around the lake are refused."""
    found = surface.refused(WEST_M - 50, SOUTH_M - 50, 1.0, 200, 200)
    return np.zeros((200, 200), np.bool_) if found is None else found


def test_a_lake_is_refused_and_told() -> None:
    surface = new()
    shown(surface, LAKE)
    x, y = np.meshgrid(np.arange(200) + WEST_M - 49.5, np.arange(200) + SOUTH_M - 49.5)
    refused = around(surface)
    assert refused[from_middle(x, y) < 17].all()
    assert not refused[from_middle(x, y) > 23].any()
    here = surface.here(40, 40, 3)
    assert here.water > 0.3
    assert surface.here(500, 500, 3) is UNKNOWN_SURFACE


@pytest.mark.parametrize(
    ("west_m", "south_m", "cell_m", "rows", "cols"),
    [
        (0, 0, 1.0, 80, 80), (0.3, -0.4, 1.0, 80, 70), (17.1, 22.7, 0.5, 60, 91), (20, 20, 0.25, 33, 47),
        (10, 10, 4.0, 15, 15), (40, 40, 0.5, 1, 1), (-60, -60, 2.0, 90, 90),
    ],
)  # fmt: skip
def test_a_raster_is_refused_where_its_cells_centres_are(
    west_m: float, south_m: float, cell_m: float, rows: int, cols: int
) -> None:
    surface = new()
    shown(surface, LAKE)
    found = surface.refused(west_m, south_m, cell_m, rows, cols)
    assert found is not None
    assert found.shape == (rows, cols)
    for row, col in np.ndindex(rows, cols):
        if (row * cols + col) % 7 == 0:
            at = west_m + (col + 0.5) * cell_m, south_m + (row + 0.5) * cell_m
            assert found[row, col] == bool(surface.refused(at[0] - 5e-3, at[1] - 5e-3, 0.01, 1, 1))


def test_where_nothing_is_refused_there_is_no_raster() -> None:
    surface = new()
    assert surface.refused(0, 0, 1.0, 9, 9) is None
    assert shown(surface, SLOPE) == []
    assert surface.refused(-50, -50, 1.0, 200, 200) is None
    shown(surface, LAKE + FAR_OFF_M, 1)
    assert surface.refused(0, 0, 1.0, 80, 80) is None
    assert surface.refused(1000, 0, 1.0, 80, 80) is not None


@pytest.mark.parametrize("seed", range(3))
def test_the_edges_returned_cover_every_cell_whose_refusal_changed(seed: int) -> None:
    """Strips of a lake come in any order, then its bed falls dry."""
    rng, surface = np.random.default_rng(seed), new()
    dry = LAKE + np.column_stack([np.zeros((len(LAKE), 2)), rng.uniform(-0.2, 0.2, len(LAKE))])
    strips = [LAKE[np.floor(LAKE[:, 0] / 20) == k] for k in rng.permutation(4)]
    n_changes = 0
    for now_s, points in enumerate([*strips, LAKE, *[dry] * 4]):
        before = around(surface)
        edges = shown(surface, points, now_s)
        for row, col in np.argwhere(before != around(surface)):
            east, north = WEST_M - 49.5 + col, SOUTH_M - 49.5 + row
            assert any(w < east < e and s < north < n for w, s, e, n in edges)
            n_changes += 1
    assert n_changes > 500


def test_an_update_that_changes_nothing_returns_no_edges() -> None:
    surface, amid = new(), LAKE[from_middle(LAKE[:, 0], LAKE[:, 1]) < 10]
    assert shown(surface, LAKE)
    assert [shown(surface, amid, now_s) for now_s in (1, 2)] == [[], []]


def test_evidence_older_than_its_age_limit_is_forgotten() -> None:
    """The lake has become a slope; without its old evidence, nothing is left of it."""
    surface = new()
    shown(surface, LAKE, 1.0)
    shown(surface, SLOPE, 1.0 + MAX_AGE_S + 1)
    assert not around(surface).any()
    assert surface.here(40, 40, 3).kind is SurfaceKind.BARE


def test_old_evidence_around_a_newer_window_is_forgotten_with_it() -> None:
    surface = new()
    shown(surface, LAKE, 1.0)
    few = SLOPE[(np.abs(SLOPE[:, :2] - 40) < 9).all(axis=1)]
    edges = shown(surface, few, 1.0 + MAX_AGE_S + 1)
    assert edges
    assert not around(surface).any()


def lost_over(half_m: float, n: int = 600) -> Signal:
    """Return rays lost over a square in the middle."""
    xy = 40 + np.random.default_rng(4).uniform(-half_m, half_m, (n, 2))
    rays = np.column_stack([xy, np.zeros(n)])
    sensor = np.tile(np.array([15.0, 40.0, 20.0]), (n, 1))
    return replace(NO_SIGNAL, lost_enu_m=rays, lost_origin_enu_m=sensor, lost_weight=np.ones(n, np.float32))


def pond() -> Floats:
    """Return ground with a pond of 12 m, of which one cell in four answers."""
    points = returns_of(lambda x, y: 0.05 * np.maximum(0, square(x, y) - 6), 80, 4)
    x, y = points[:, 0], points[:, 1]
    answer: Floats = points[(square(x, y) > 6) | ((np.floor(x) + np.floor(y)) % 4 == 0)]
    return answer


def square(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.maximum(np.abs(x - 40), np.abs(y - 40)))


def n_refused_by_lost_rays(now_s: float) -> int:
    surface = new()
    shown(surface, pond(), now_s)
    shown(surface, pond(), now_s + 1, lost_over(6))
    return int(np.count_nonzero(around(surface)))


def test_a_lake_told_long_ago_stays_refused_while_its_middle_is_seen_again() -> None:
    """A near look does not reach the shores; what a far one told of them is older than it may be kept."""
    surface = SurfaceMap(WEST_M, SOUTH_M, params.load("quadcopter", ["cell_m=0.5", "max_age_s=300"]))
    wide = returns_of(lake(30.0), 80, 4)
    amid = wide[from_middle(wide[:, 0], wide[:, 1]) < 3]
    shown(surface, wide)
    x, y = np.meshgrid(np.arange(200) + WEST_M - 49.5, np.arange(200) + SOUTH_M - 49.5)
    water = from_middle(x, y) < 27
    assert around(surface)[water].all()
    for now_s in (1.0, 2.0 * SHAPE_HOLD_S, 2.0 * SHAPE_HOLD_S + 1, 2.0 * SHAPE_HOLD_S + 2):
        shown(surface, amid, now_s)
        assert around(surface)[water].all()


def test_rays_lost_over_a_pond_make_it_refused() -> None:
    surface = new()
    shown(surface, pond())
    before = np.count_nonzero(around(surface))
    assert n_refused_by_lost_rays(0.0) > before


def test_rays_lost_late_in_a_flight_count_as_those_lost_early() -> None:
    assert n_refused_by_lost_rays(5 * MAX_AGE_S) == n_refused_by_lost_rays(0.0)


def test_without_the_sensor_s_place_lost_rays_do_not_count() -> None:
    known, unknown = new(), new()
    shown(known, pond())
    shown(unknown, pond(), 0.0, lost_over(6), sensor=np.full(3, np.nan))
    np.testing.assert_array_equal(around(known), around(unknown))


def test_a_small_memory_gives_up_the_tile_not_seen_for_longest() -> None:
    surface = new("memory_mb=16")
    side_m = TILE * surface.cell_m
    spot = 3 + returns_of(lambda x, _: 0.05 * x, 20, 4)
    where = [(k * side_m + WEST_M, SOUTH_M, 0.0) for k in range(LEAST_TILES + 1)]
    for now_s, corner in enumerate(where[:-1]):
        shown(surface, spot + corner, now_s * 0.1)
    shown(surface, spot + where[0], 2.0)  # seen again
    shown(surface, spot + where[-1], 3.0)
    known = [surface.here(x + 13, y + 13, 2).kind is SurfaceKind.BARE for x, y, _ in where]
    assert [k for k, each in enumerate(known) if not each] == [1]


def test_the_edges_returned_cover_what_a_tile_given_up_refused() -> None:
    surface = new("memory_mb=16")
    spot = 3 + returns_of(lambda x, _: 0.05 * x, 20, 4)
    shown(surface, LAKE)
    assert around(surface).any()
    edges = []
    for k in range(LEAST_TILES):
        corner = np.array([(k + 5) * TILE * surface.cell_m + WEST_M, SOUTH_M, 0])
        edges += shown(surface, spot + corner, 0.1 * (k + 1))
    assert not around(surface).any()
    assert edges


def test_a_window_of_more_tiles_than_memory_has_is_mapped_as_far_as_it_goes() -> None:
    surface = new("memory_mb=16")
    side_m = TILE * surface.cell_m
    spot = 3 + returns_of(lambda x, _: 0.05 * x, 10, 4)
    where = [(k * side_m + WEST_M, SOUTH_M, 0.0) for k in range(LEAST_TILES + 3)]
    shown(surface, np.vstack([spot + corner for corner in where]))
    known = [surface.here(x + 8, y + 8, 2).kind is SurfaceKind.BARE for x, y, _ in where]
    assert known.count(True) == LEAST_TILES


def test_points_beyond_the_map_s_edges_and_uncertain_ones_are_left_out() -> None:
    surface = new()
    far = np.array([[1e9, 0, 0], [np.nan, 3, 0], [0, -np.inf, 0]])
    assert shown(surface, far) == []
    shown(surface, np.vstack([SLOPE, far]), grid=(0.0, 0.0, 40.0, 80.0))
    assert surface.here(20, 40, 3).kind is SurfaceKind.BARE
    assert surface.here(60, 40, 3).kind is SurfaceKind.UNKNOWN
    assert surface.update(SLOPE, np.zeros(len(SLOPE), np.bool_), SENSOR, 1.0, NO_SIGNAL, EVERYWHERE) == []


def test_an_empty_window_is_no_evidence() -> None:
    assert shown(new(), np.empty((0, 3))) == []
