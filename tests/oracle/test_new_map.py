"""Move to a new map: only the common cells are copied (SLZ paper, Section 3.2.5 and Figure 2)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.grid import Box, Grid, overlap
from slz.kernels.raster.bitmap import unpacked
from slz.paper.paper_terrain import PaperTerrain
from slz.terrain.layers import LAYERS
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE

ROWS, COLS, CELL_M, WEST_M, SOUTH_M = 40, 48, 0.25, -6.0, 100.0
GRID = Grid(WEST_M, SOUTH_M, CELL_M, ROWS, COLS)
WORST_DEG = 40.0
# Rows and columns by which the new zone lies farther north and east: the four sign cases, no move along an
# axis, a corner of one cell, and no common ground by one cell and by far.
MOVES = [(7, 9), (7, -9), (-7, 9), (-7, -9), (0, 5), (-5, 0), (0, 0), (39, 47), (-39, -47)]
AWAY = [(40, 0), (0, -48), (-40, 48), (400, 3)]


def moved_grid(move: tuple[int, int], rows: int = ROWS, cols: int = COLS) -> Grid:
    return Grid(WEST_M + move[1] * CELL_M, SOUTH_M + move[0] * CELL_M, CELL_M, rows, cols)


def cloud() -> NDArray[np.float64]:
    """Ground over the whole zone with a steep bank, a hole and a post."""
    rng = np.random.default_rng(0)
    xy = rng.random((40_000, 2)) * [COLS * CELL_M, ROWS * CELL_M]
    z = np.where(xy[:, 0] > 8, 0.7 * (xy[:, 0] - 8), 0.02 * xy[:, 1])
    hole = np.hypot(xy[:, 0] - 4, xy[:, 1] - 4) < 1.2
    post = np.column_stack([np.full(9, 2.1), np.full(9, 7.6), np.linspace(0.5, 1.5, 9)])
    points = np.vstack([np.column_stack([xy, z])[~hole], post])
    return np.asarray(points + np.array([WEST_M, SOUTH_M, 0.0]))


def source() -> PaperTerrain:
    own = ["mode=source", f"cell_m={CELL_M}", f"worst_slope_deg={WORST_DEG}", "safe_slope_deg=4"]
    terrain = PaperTerrain(GRID, params.load("quadcopter", own))
    terrain.add(cloud())
    return terrain


def evidence() -> EvidenceTerrain:
    terrain = EvidenceTerrain(GRID, params.load("quadcopter", [f"cell_m={CELL_M}"]))
    terrain.add(cloud(), np.array([0.0, 105.0, 20.0]), 0.0)
    return terrain


def carried(
    old: NDArray[np.generic], move: tuple[int, int], empty: float, rows: int = ROWS, cols: int = COLS
) -> NDArray[np.generic]:
    """Copy cell by cell: the cell at (row, col) of the new zone is at (row + move, col + move) of the old."""
    new = np.full((rows, cols), empty, old.dtype)
    for row in range(rows):
        for col in range(cols):
            r, c = row + move[0], col + move[1]
            if 0 <= r < old.shape[0] and 0 <= c < old.shape[1]:
                new[row, col] = old[r, c]
    return new


def without_margin(safe: NDArray[np.bool_]) -> NDArray[np.bool_]:
    out = np.zeros(safe.shape, bool)
    out[1:-1, 1:-1] = safe[1:-1, 1:-1]
    return out


@pytest.mark.parametrize("size", [(ROWS, COLS), (ROWS + 6, COLS - 9)])
@pytest.mark.parametrize("move", MOVES + AWAY)
def test_the_overlap_holds_the_common_cells(move: tuple[int, int], size: tuple[int, int]) -> None:
    new = moved_grid(move, *size)
    mine, theirs = overlap(GRID, new)
    number = np.arange(ROWS * COLS).reshape(ROWS, COLS)
    copied = np.full(size, -1)
    copied[theirs.slices] = number[mine.slices]
    np.testing.assert_array_equal(copied, carried(number, move, -1, *size))
    assert mine.shape == theirs.shape
    for row, col in np.argwhere(copied >= 0):
        was = GRID.centre(*divmod(int(copied[row, col]), COLS))
        assert new.centre(int(row), int(col)) == pytest.approx(was)


@pytest.mark.parametrize("move", MOVES + AWAY)
def test_the_source_s_maps_are_carried_over_and_the_rest_is_the_worst_case(move: tuple[int, int]) -> None:
    old = source()
    new = old.moved(moved_grid(move))
    slope = carried(old.slope_deg, move, WORST_DEG)
    np.testing.assert_array_equal(new.height_m, carried(old.height_m, move, np.nan))
    np.testing.assert_array_equal(new.slope_deg, slope)
    np.testing.assert_array_equal(new.roughness, carried(old.roughness, move, WORST_DEG))
    np.testing.assert_array_equal(new.binary == 1, without_margin(slope < 4))
    known = np.isfinite(new.height_m)
    state = new.state(new.grid.everything)
    np.testing.assert_array_equal(state == UNKNOWN, ~known)
    np.testing.assert_array_equal(state == SAFE, new.binary == 1)


@pytest.mark.parametrize("move", MOVES + AWAY)
def test_the_evidence_is_carried_over_and_the_rest_is_unknown(move: tuple[int, int]) -> None:
    old = evidence()
    new = old.moved(moved_grid(move))
    everything = new.grid.everything
    for layer in LAYERS:
        expected = carried(old.layer(layer.name, everything), move, layer.empty)
        np.testing.assert_array_equal(new.layer(layer.name, everything), expected)
    state = carried(old.state(everything), move, UNKNOWN)
    np.testing.assert_array_equal(new.state(everything), state)
    bits, row, col = new.safe_bits(Box(2, ROWS - 1, 1, COLS - 3))
    rows, cols = np.nonzero(unpacked(bits, 0, 64 * bits.shape[1]))
    safe = np.argwhere(state[2 : ROWS - 1, 1 : COLS - 3] == SAFE) + np.array([2, 1])
    np.testing.assert_array_equal(np.column_stack([rows + row, cols + col]), safe)


def test_the_maps_carried_over_hold_every_state() -> None:
    for terrain in (source(), evidence()):
        state = terrain.state(terrain.grid.everything)
        assert min((state == value).sum() for value in (SAFE, UNSAFE, UNKNOWN)) > 20


@pytest.mark.parametrize("move", [(7, 9), (7, -9), (-7, 9), (-7, -9)])
def test_new_returns_join_the_evidence_carried_over(move: tuple[int, int]) -> None:
    """A second window gives the same maps where the footprint lies in both zones, moved or not."""
    stay, sensor = evidence(), np.array([0.0, 105.0, 20.0])
    new = evidence().moved(moved_grid(move))
    again = cloud()[::7] + np.array([0.0, 0.0, 0.05])
    for terrain in (stay, new):
        terrain.add(again, sensor, 1.0)
    rows, cols = ROWS - abs(move[0]), COLS - abs(move[1])
    margin = 12  # footprint and closing
    mine = Box(max(0, move[0]), max(0, move[0]) + rows, max(0, move[1]), max(0, move[1]) + cols)
    inner = (slice(margin, rows - margin), slice(margin, cols - margin))
    theirs = Box(mine.row0 - move[0], mine.row1 - move[0], mine.col0 - move[1], mine.col1 - move[1])
    kept, carried_on = stay.state(mine)[inner], new.state(theirs)[inner]
    assert kept.size > 50
    np.testing.assert_array_equal(kept, carried_on)
    np.testing.assert_array_equal(stay.layer("height_m", mine)[inner], new.layer("height_m", theirs)[inner])


def test_what_was_seen_lies_within_the_common_cells() -> None:
    for terrain in (source(), evidence()):
        for move in MOVES:
            seen = terrain.moved(moved_grid(move)).seen
            known = carried(np.isfinite(terrain.layer("height_m", GRID.everything)), move, 0)
            rows, cols = np.nonzero(known)
            if not len(rows):
                continue
            assert seen.row0 <= rows.min()
            assert seen.row1 > rows.max()
            assert seen.col0 <= cols.min()
            assert seen.col1 > cols.max()
        for move in AWAY:
            assert terrain.moved(moved_grid(move)).seen.empty
