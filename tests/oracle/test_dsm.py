"""Window DSM and its fusion against lists of heights per cell (SLZ paper, Eq. (3) to (5), Section 3.2.3)."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from slz.grid import Grid
from slz.kernels.cells.accumulate import cells_of, sum_and_count
from slz.paper.paper_terrain import PaperTerrain

Floats = NDArray[np.float64]
Cells = dict[tuple[int, int], float]
EIGHTH = 8  # lengths are drawn in eighths of a metre: exact, and often on the edge of a cell
ROWS, COLS, CELL_8, WEST_8, SOUTH_8 = 7, 9, 4, -20, 12
CELL_M = CELL_8 / EIGHTH

eighths = st.tuples(
    st.integers(WEST_8 - 6, WEST_8 + COLS * CELL_8 + 6),
    st.integers(SOUTH_8 - 6, SOUTH_8 + ROWS * CELL_8 + 6),
    st.integers(-12, 20),
)


def heights_of(points_8: list[tuple[int, int, int]]) -> dict[tuple[int, int], list[float]]:
    cells = defaultdict(list)
    for east, north, up in points_8:
        row, col = (north - SOUTH_8) // CELL_8, (east - WEST_8) // CELL_8
        if 0 <= row < ROWS and 0 <= col < COLS:
            cells[row, col].append(up / EIGHTH)
    return cells


@settings(max_examples=60, deadline=None)
@given(st.lists(eighths, max_size=120))
def test_a_cell_holds_the_mean_of_its_points(points_8: list[tuple[int, int, int]]) -> None:
    points = np.array(points_8, float).reshape(-1, 3) / EIGHTH
    west, south = WEST_8 / EIGHTH, SOUTH_8 / EIGHTH
    expected = heights_of(points_8)
    _, (r0, r1, c0, c1, inside) = cells_of(points, west, south, CELL_M, np.array([0, ROWS, 0, COLS]))
    assert inside == sum(len(heights) for heights in expected.values())
    if not expected:
        return
    rows, cols = zip(*expected, strict=True)
    assert (r0, r1, c0, c1) == (min(rows), max(rows) + 1, min(cols), max(cols) + 1)
    total, count = np.zeros((r1 - r0, c1 - c0)), np.zeros((r1 - r0, c1 - c0), np.int32)
    sum_and_count(points, west, south, CELL_M, r0, c0, total, count)
    for row in range(r0, r1):
        for col in range(c0, c1):
            heights = expected.get((row, col), [])
            assert count[row - r0, col - c0] == len(heights)
            if heights:
                mean = total[row - r0, col - c0] / count[row - r0, col - c0]
                assert mean == pytest.approx(sum(heights) / len(heights), abs=1e-12)


# ---- fusing -------------------------------------------------------------------------------------

SIDE, MAX_SLOPE = 10, 40.0


def terrain(fusing: str) -> PaperTerrain:
    own = ["mode=source", f"fusing={fusing}", "cell_m=1", f"worst_slope_deg={MAX_SLOPE}", "safe_slope_deg=4"]
    return PaperTerrain(Grid(0.0, 0.0, 1.0, SIDE, SIDE), params.load("quadcopter", own))


def window(seed: int) -> Floats:
    """One to three returns in most cells of a random part of the grid, some steep."""
    rng = np.random.default_rng(seed)
    tilt, steep = rng.uniform(-0.3, 0.3, 2), rng.uniform(0.02, 0.6)
    r0, c0 = rng.integers(0, 4, 2)
    points = []
    for row in range(r0, r0 + rng.integers(4, 10)):
        for col in range(c0, c0 + rng.integers(4, 10)):
            if rng.random() < 0.08:
                continue
            for _ in range(rng.integers(1, 4)):
                up = tilt[0] * col + tilt[1] * row + rng.normal(0, steep)
                points.append((col + rng.random(), row + rng.random(), up))
    return np.array(points)


def plain_slope(height: Cells) -> Cells:
    """Eq. 6-9 where a cell and its four neighbours are known."""
    slope = {}
    for row, col in height:
        around = [(row, col + 1), (row, col - 1), (row + 1, col), (row - 1, col)]
        if all(place in height for place in around):
            east, west, north, south = (height[place] for place in around)
            slope[row, col] = math.degrees(math.atan(math.hypot((east - west) / 2, (north - south) / 2)))
    return slope


def plain_fusing(clouds: list[Floats], fusing: str) -> tuple[Cells, Cells, Cells]:
    """Total height, slope and roughness; what is missing was never written."""

    def join(total: Cells, place: tuple[int, int], new: float) -> None:
        old = total.get(place)
        if old is None:
            total[place] = new
        else:
            total[place] = max(old, new) if fusing == "max" else (old + new) / 2

    total_height: Cells = {}
    total_slope: Cells = {}
    total_rough: Cells = {}
    for cloud in clouds:
        cells = defaultdict(list)
        for east, north, up in cloud:
            row, col = math.floor(north), math.floor(east)
            if 0 <= row < SIDE and 0 <= col < SIDE:
                cells[row, col].append(up)
        height = {place: sum(values) / len(values) for place, values in cells.items()}
        slope = plain_slope(height)
        rough = plain_slope(slope)
        for place, value in slope.items():
            if value >= MAX_SLOPE:
                continue
            join(total_slope, place, value)
            join(total_height, place, height[place])
            if place in rough:
                join(total_rough, place, rough[place])
    return total_height, total_slope, total_rough


def full(cells: Cells, empty: float) -> Floats:
    out = np.full((SIDE, SIDE), empty)
    for place, value in cells.items():
        out[place] = value
    return out


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 10_000), min_size=1, max_size=3), st.sampled_from(["mean", "max"]))
def test_windows_are_fused_by_the_written_rule(seeds: list[int], fusing: str) -> None:
    clouds = [window(seed) for seed in seeds]
    total = terrain(fusing)
    for cloud in clouds:
        total.add(cloud)
    height, slope, rough = plain_fusing(clouds, fusing)
    np.testing.assert_allclose(total.height_m, full(height, np.nan), atol=1e-4)
    np.testing.assert_allclose(total.slope_deg, full(slope, MAX_SLOPE), atol=1e-2)
    np.testing.assert_allclose(total.roughness, full(rough, MAX_SLOPE), atol=2e-2)
    safe = full(slope, MAX_SLOPE) < 4.0
    safe[[0, -1]], safe[:, [0, -1]] = False, False
    np.testing.assert_array_equal(total.binary == 1, safe)


def test_the_fused_windows_hold_every_case() -> None:
    """The random windows do write, join and leave out cells; else the test above would say nothing."""
    clouds = [window(seed) for seed in (6, 7, 8)]
    once = plain_fusing(clouds[:1], "mean")[1]
    thrice = plain_fusing(clouds, "mean")[1]
    assert 0 < len(once) < len(thrice) < (SIDE - 2) ** 2
    assert any(abs(once[place] - thrice[place]) > 1 for place in once)
