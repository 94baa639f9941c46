"""Evidence of cells and planes under the footprint against plain Python and numpy.linalg."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.argument_types import Array1D
from slz.kernels.cells.cell_statistics import summary
from slz.kernels.footprint.certainty import certainty, hazard_quarters
from slz.kernels.footprint.derive_maps import derive_box
from slz.kernels.footprint.moments import (
    PATCH_LAYERS,
    RISES,
    SUMS,
    over_columns,
    over_rows,
    rises_over_columns,
)
from slz.kernels.footprint.patch import COLS as PATCH
from slz.kernels.footprint.patch import gather_cells, rows_of_patch
from slz.kernels.jit import kernel
from slz.kernels.raster.bitmap import ALL, packed
from slz.kernels.raster.morphology import eroded
from slz.kernels.simd import LANES, store, store_wide
from slz.terrain.gear import NO_GEAR
from slz.terrain.layers import LAYERS
from slz.terrain.tiles import Noise, Tiles

Floats = NDArray[np.float64]
Row = Array1D[np.float32]
Wide = Array1D[np.float64]
HEIGHT, BOTTOM, TOP, WEIGHT, EXCESS, SPREAD = range(6)
COUNT, MEAN, NOISE, LOW, LOW2, HIGH, HIGH2, TIME = range(8)
seeds = st.integers(0, 10_000)


# ---- planes -------------------------------------------------------------------------------------

NOISE_M, SLOPE_LIMIT = 0.02, 10.0


@dataclass
class Plane:
    slope_deg: float
    sigma_deg: float
    relief_m: float
    rms_m: float


def planes(
    cells: NDArray[np.float32],
    covered: NDArray[np.uint8],
    k: int,
    cell_m: float,
    limit: float = SLOPE_LIMIT,
    relief_limit: float = 9.0,
) -> NDArray[np.float32]:
    """Slope, its standard deviation, relief, roughness and certainty of all cells, drawn."""
    rows, cols = covered.shape
    wide = -(-cols // LANES) * LANES
    about = np.full((6, rows + 2 * k, cols + 2 * k), np.nan, np.float32)
    about[WEIGHT] = 0
    about[:, k : k + rows, k : k + cols] = cells
    whole = eroded(packed(np.pad(covered, k)), k, cols + 2 * k)
    maps, states = np.empty((len(LAYERS), rows, wide), np.float32), np.empty(rows * wide, np.uint8)
    levels = np.empty((rows, wide), np.float32)
    derive_box(
        about, whole, np.zeros_like(whole), k, k,
        (cell_m, NOISE_M, limit, relief_limit, 0.3), NO_GEAR.contacts_m, NO_GEAR.limits,
        (0, rows, 0, wide), maps.ravel(), 0, rows * wide, wide, states, 0, np.full_like(whole, ALL), levels,
    )  # fmt: skip
    return maps[2:7, :, :cols]


def fitted(cells: Floats, row: int, col: int, k: int, cell_m: float) -> Plane | None:
    """Least squares over the cells of the footprint that hold a height."""
    rows, cols = np.mgrid[row - k : row + k + 1, col - k : col + k + 1]
    part = cells[:, row - k : row + k + 1, col - k : col + k + 1]
    has = part[WEIGHT] > 0
    if has.sum() < 6:
        return None
    x, y = (cols[has] - col) * cell_m, (rows[has] - row) * cell_m
    design = np.column_stack([np.ones(len(x)), x, y])
    z = part[HEIGHT][has]
    (at, a, b), _, rank, _ = np.linalg.lstsq(design, z, rcond=None)
    if rank < 3:
        return None
    rms = math.sqrt(np.mean((z - design @ (at, a, b)) ** 2))
    free = math.sqrt(np.sum((z - design @ (at, a, b)) ** 2) / (len(z) - 3))
    noise = max(NOISE_M * math.sqrt(np.mean(1 / part[WEIGHT][has])), free)
    of_gradient = noise**2 * np.linalg.inv(design.T @ design)[1:, 1:]
    sigma = math.sqrt(np.trace(of_gradient) / 2) / (1 + a * a + b * b)
    level = design @ (at, a, b)
    high = (part[TOP][has] - part[EXCESS][has] - level).max()
    low = (part[BOTTOM][has] + part[EXCESS][has] - level).min()
    slope = math.degrees(math.atan(math.hypot(a, b)))
    return Plane(slope, math.degrees(sigma), max(0.0, high - low), rms)


def random_cells(seed: int, bumpy_m: float) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(9, 17, 2)
    y, x = np.mgrid[:rows, :cols] * 0.25
    tilt = rng.uniform(-0.2, 0.2, 2)
    cells = np.zeros((6, rows, cols))
    cells[HEIGHT] = 300 + tilt[0] * x + tilt[1] * y + rng.normal(0, bumpy_m, (rows, cols))
    cells[TOP] = cells[HEIGHT] + rng.exponential(bumpy_m, (rows, cols))
    cells[BOTTOM] = cells[HEIGHT] - rng.exponential(bumpy_m, (rows, cols))
    cells[WEIGHT] = rng.integers(0, 30, (rows, cols))
    cells[EXCESS] = np.where(cells[WEIGHT] > 8, rng.uniform(0, bumpy_m, (rows, cols)), 0)
    cells[SPREAD] = rng.uniform(0, 1e-3, (rows, cols))
    unknown = (cells[WEIGHT] == 0) | (rng.random((rows, cols)) < rng.choice([0, 0.3, 0.85]))
    cells[:, unknown] = np.nan
    cells[WEIGHT][unknown] = 0
    return cells.astype(np.float32)


@settings(max_examples=50, deadline=None)
@given(seeds, st.integers(1, 4), st.sampled_from([0.003, 0.02, 0.08, 0.2]))
def test_planes_are_those_of_least_squares(seed: int, k: int, bumpy_m: float) -> None:
    cells, cell_m = random_cells(seed, bumpy_m), 0.25
    rows, cols = cells.shape[1:]
    covered = np.random.default_rng(seed).random((rows, cols)) > 0.002
    out = planes(cells, covered.astype(np.uint8), k, cell_m)
    for row in range(rows):
        for col in range(cols):
            got = out[:, row, col]
            fits = k <= row < rows - k and k <= col < cols - k
            expected = None
            if fits and covered[row - k : row + k + 1, col - k : col + k + 1].all():
                expected = fitted(cells.astype(np.float64), row, col, k, cell_m)
            if expected is None:
                assert np.isnan(got[:4]).all()
                assert got[4] == 0
                continue
            assert got[0] == pytest.approx(expected.slope_deg, abs=2e-3)
            assert got[1] == pytest.approx(expected.sigma_deg, rel=2e-3, abs=1e-4)
            assert got[3] == pytest.approx(expected.rms_m, rel=1e-3, abs=1e-5)
            check_relief(float(got[2]), expected)


def check_relief(got: float, expected: Plane) -> None:
    """None where it is surely too steep, else the exact one."""
    surely_steep = expected.slope_deg - 2.5 * expected.sigma_deg - SLOPE_LIMIT
    if abs(surely_steep) < 1e-2:
        return
    if surely_steep > 0:
        assert np.isnan(got)
    else:
        assert got == pytest.approx(expected.relief_m, abs=1e-4)


RELIEF_LIMIT = 0.1


def expected_certainty(cells: Floats, row: int, col: int, k: int, cell_m: float) -> float | None:
    """Return the certainty by exact statistics; None where rounding decides."""
    plane = fitted(cells, row, col, k, cell_m)
    if plane is None:
        return 0.0
    part = cells[:, row - k : row + k + 1, col - k : col + k + 1]
    has = part[WEIGHT] > 0
    x, y = (axis[has] * cell_m for axis in np.mgrid[: 2 * k + 1, : 2 * k + 1])
    design = np.column_stack([np.ones(len(x)), x, y])
    level = design @ np.linalg.lstsq(design, part[HEIGHT][has], rcond=None)[0]
    highest = np.sort(part[TOP][has] - part[EXCESS][has] - level)[::-1]
    lowest = np.sort(part[BOTTOM][has] + part[EXCESS][has] - level)
    stand_out = has.sum() * plane.rms_m**2 / max(plane.relief_m, 1e-9) ** 2
    too_steep = plane.slope_deg - 2.5 * plane.sigma_deg - SLOPE_LIMIT
    if abs(stand_out - 1.5) < 0.02 or abs(too_steep) < 1e-2:
        return None
    if too_steep > 0:
        return 0.0
    inner = plane.relief_m
    if stand_out < 1.5:
        inner = max(0.0, min(highest[1] - lowest[0], highest[0] - lowest[1]))
    noise = math.sqrt(part[SPREAD][has].mean())
    share, quarters = has.mean(), hazard_quarters(cell_m, 0.3)
    return certainty(
        plane.slope_deg,
        plane.sigma_deg,
        plane.relief_m,
        inner,
        noise,
        share,
        SLOPE_LIMIT,
        RELIEF_LIMIT,
        quarters,
    )


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("bumpy_m", [0.003, 0.02, 0.06])
def test_certainties_are_those_of_exact_statistics(seed: int, bumpy_m: float) -> None:
    """Also where a kernel takes the short way because hidden hazards are the only doubt."""
    cells, cell_m, k = random_cells(seed, bumpy_m), 0.25, 2
    high = np.random.default_rng(seed).integers(2, 7, 2)
    cells[TOP, high[0], high[1]] += 0.5  # stands out alone
    known = np.ones(cells.shape[1:], np.uint8)
    got = planes(cells, known, k, cell_m, relief_limit=RELIEF_LIMIT)[4]
    rows, cols = known.shape
    for row in range(k, rows - k):
        for col in range(k, cols - k):
            expected = expected_certainty(cells.astype(np.float64), row, col, k, cell_m)
            if expected is not None:
                assert got[row, col] == pytest.approx(expected, abs=5e-3)


def test_the_random_cells_meet_every_case_of_the_relief() -> None:
    reliefs = []
    steep = 0
    for seed in range(20):
        for bumpy_m in (0.003, 0.02, 0.08):
            cells = random_cells(seed, bumpy_m)
            known = np.ones(cells.shape[1:], np.uint8)
            slope, _, relief, *_ = planes(cells, known, 2, 0.25)
            reliefs.append(relief[np.isfinite(relief)])
            steep += int((slope > SLOPE_LIMIT).sum())
    all_of_them = np.concatenate(reliefs)
    assert steep > 100
    for low, high in ((0, 0.15), (0.15, 0.3), (0.3, 9)):
        assert ((all_of_them > low) & (all_of_them < high)).sum() > 100


@pytest.mark.parametrize("k", [3, 5, 10])
@pytest.mark.parametrize(("down", "right"), [(0, 1), (1, 0), (1, 1), (1, -1), (1, 2)])
def test_cells_in_a_line_are_no_plane_however_many_and_two_lines_are(k: int, down: int, right: int) -> None:
    side, rng = 4 * k + 1, np.random.default_rng(k)
    cells = np.full((6, side, side), np.nan, np.float32)
    cells[WEIGHT] = 0
    steps = np.arange(-2 * k, 2 * k + 1)
    rows, cols = 2 * k + down * steps, 2 * k + right * steps
    inside = (rows >= 0) & (rows < side) & (cols >= 0) & (cols < side)
    rows, cols = rows[inside], cols[inside]
    cells[:, rows, cols] = 0
    cells[WEIGHT, rows, cols], cells[SPREAD, rows, cols] = 4, 4e-4
    cells[HEIGHT, rows, cols] = 300 + rng.normal(0, 0.02, len(rows))
    cells[BOTTOM], cells[TOP] = cells[HEIGHT], cells[HEIGHT]
    covered = np.ones((side, side), np.uint8)
    assert np.isnan(planes(cells, covered, k, 0.1)[0]).all()
    if down == 0:
        cells[:, 2 * k + 1] = cells[:, 2 * k]
        cells[[HEIGHT, BOTTOM, TOP], 2 * k + 1] += 0.02
        slope = planes(cells, covered, k, 0.1, 90.0)[0, 2 * k, 2 * k]
        expected = fitted(cells.astype(np.float64), 2 * k, 2 * k, k, 0.1)
        assert expected is not None
        assert slope == pytest.approx(expected.slope_deg, rel=1e-4)


def test_the_excess_is_taken_off_the_relief_at_both_ends() -> None:
    cells = np.zeros((SPREAD + 1, 5, 5), np.float32)
    cells[WEIGHT] = 10
    cells[TOP, 2, 2], cells[EXCESS, 2, 2] = 0.25, 0.03
    cells[BOTTOM, 1, 3], cells[EXCESS, 1, 3] = -0.04, 0.01
    out = planes(cells, np.ones((5, 5), np.uint8), 2, 0.25)
    assert out[2, 2, 2] == pytest.approx((0.25 - 0.03) - (-0.04 + 0.01), abs=1e-6)


def test_a_first_cell_far_up_rounds_no_relief_but_those_that_hold_it() -> None:
    cells = random_cells(3, 0.02)
    rows, cols = cells.shape[1:]
    cells[:, 0, 0] = cells[:, rows // 2, cols // 2] = 0.0
    cells[WEIGHT, 0, 0] = 1
    known, far_up = np.ones((rows, cols), np.uint8), cells.copy()
    far_up[[HEIGHT, BOTTOM, TOP], 0, 0] = 10_000.0
    plain, other = (planes(c, known, 1, 0.25) for c in (cells, far_up))
    assert np.isfinite(plain[2, 3:, 3:]).any()
    rounding = np.finfo(np.float32).eps  # of reliefs of 300 m
    np.testing.assert_allclose(other[2, 3:, 3:], plain[2, 3:, 3:], rtol=rounding, atol=2e-6)


@kernel
def _told(sums: Row, rises: Wide, at: int, layer: int, away: Row, y: float, out: Row, heights: Wide) -> None:
    s, z = over_columns(sums, at, layer, away, y), rises_over_columns(rises, at, layer, away, y)
    store(out, 0, s[0])
    store(out, LANES, s[1])
    store(out, 2 * LANES, s[2])
    store(out, 3 * LANES, s[3])
    store(out, 4 * LANES, s[4])
    store(out, 5 * LANES, s[5])
    store(out, 6 * LANES, s[6])
    store(out, 7 * LANES, s[7])
    store_wide(heights, 0, z[0])
    store_wide(heights, LANES, z[1])
    store_wide(heights, 2 * LANES, z[2])
    store_wide(heights, 3 * LANES, z[3])


@pytest.mark.parametrize("k", [1, 2, 3, 4, 9, 20])
def test_sums_over_footprints_are_those_of_their_cells(k: int) -> None:
    rng, rows, level = np.random.default_rng(k), rows_of_patch(k), np.float32(299.5)
    tall, wide = rows + 2 * k, -(-(PATCH + 2 * k) // LANES) * LANES
    cells = np.zeros((6, tall + 3, PATCH + 2 * k + 2), np.float32)
    cells[HEIGHT] = 300 + rng.normal(0, 1, cells.shape[1:])
    cells[WEIGHT] = rng.integers(0, 9, cells.shape[1:])
    cells[SPREAD] = rng.uniform(0, 1e-3, cells.shape[1:])
    unknown = cells[WEIGHT] == 0
    cells[[HEIGHT, SPREAD]] = np.where(unknown, np.nan, cells[[HEIGHT, SPREAD]])
    held, sums = np.empty(PATCH_LAYERS * tall * wide, np.float32), np.empty(SUMS * rows * wide, np.float32)
    rises, heights = np.empty(RISES * rows * wide), np.empty((4, LANES))
    gather_cells(cells.ravel(), cells.shape[2], 3, 2, tall, wide, level, held)
    over_rows(held, rows, k, wide, sums, rises)
    away, got = np.arange(-k, k + 1).astype(np.float32), np.empty((8, LANES), np.float32)
    y, x = np.mgrid[-k : k + 1, -k : k + 1]
    for row in range(rows):
        for first in range(0, PATCH, LANES):
            at, y_row = row * wide + first, row - rows // 2
            _told(sums, rises, at, rows * wide, away, y_row, got.ravel(), heights.ravel())
            for col in range(first, first + LANES):
                part = cells[:, 3 + row : 4 + row + 2 * k, 2 + col : 3 + col + 2 * k].astype(np.float64)
                has = part[WEIGHT] > 0
                z, noise = np.where(has, part[HEIGHT] - level, 0), np.where(has, part[SPREAD], 0)
                inverse = np.where(has, 1 / np.where(has, part[WEIGHT], 1), 0)
                of = has, has * x, has * x * x, has * y, has * x * y, has * y * y
                expected = [np.sum(each) for each in of]
                np.testing.assert_array_equal(got[:6, col - first], expected, "of whole numbers, exactly")
                expected = [np.sum(inverse), np.sum(noise)]
                np.testing.assert_allclose(got[6:, col - first], expected, rtol=2e-6)
                expected = [np.sum(each) for each in (z, z * x, z * y, z * z)]
                np.testing.assert_allclose(heights[:, col - first], expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("step_m", [0.0, 8.0, 300.0])
def test_a_wall_near_by_does_not_blur_the_roughness_of_even_ground(step_m: float) -> None:
    rng = np.random.default_rng(1)
    cells = np.zeros((6, 40, 64), np.float32)
    cells[WEIGHT], cells[SPREAD] = 3, 4e-4
    cells[HEIGHT] = 100 + rng.normal(0, 0.002, cells.shape[1:])
    cells[HEIGHT, :, 40:] += step_m
    cells[HEIGHT, 25:] += 2 * step_m
    cells[BOTTOM] = cells[TOP] = cells[HEIGHT]
    roughness = planes(cells, np.ones(cells.shape[1:], np.uint8), 5, 0.2)[3]
    for row, col in np.argwhere(np.isfinite(roughness)):
        part = np.s_[row - 5 : row + 6, col - 5 : col + 6]
        if np.ptp(cells[HEIGHT][part]) < 1:
            expected = fitted(cells.astype(np.float64), int(row), int(col), 5, 0.2)
            assert expected is not None
            assert roughness[row, col] == pytest.approx(expected.rms_m, abs=2e-6)


# ---- evidence -----------------------------------------------------------------------------------

ROWS, COLS, CELL_M, HOLD_S, MAX_AGE_S, FEW = 4, 5, 0.5, 5.0, 60.0, 20
CROWD = {1: 64, -1: 32}  # returns of a cell, for tops and for bottoms
RANGE_NOISE_M, ANGLE_NOISE_RAD = 0.02, 0.003


@dataclass
class Epoch:
    heights: list[float] = field(default_factory=list)
    variances: list[float] = field(default_factory=list)
    start_s: float = 0.0


@dataclass
class Cell:
    now: Epoch = field(default_factory=Epoch)
    before: Epoch = field(default_factory=Epoch)
    last_s: float = 0.0


Windows = list[tuple[float, Floats, Floats]]
Cells = dict[tuple[int, int], Cell]


def random_windows(seed: int) -> Windows:
    """Returns in some of the cells of some windows: single ones and many, with hazards and ghosts."""
    rng = np.random.default_rng(seed)
    windows = []
    stamp = 0.0
    for _ in range(rng.integers(1, 5)):
        sensor = np.array([*rng.uniform(-4, 6, 2), rng.uniform(2, 20)])
        if rng.random() < 0.15:
            sensor[:] = np.nan
        clouds = []
        for row in range(-1, ROWS + 1):
            for col in range(-1, COLS + 1):
                n = rng.choice([0, 1, 2, 5, 12, 40, 80], p=[0.2, 0.25, 0.15, 0.15, 0.1, 0.1, 0.05])
                xy = (rng.random((n, 2)) + np.array([col, row])) * CELL_M
                z = rng.normal(0, 0.05, n) + rng.choice([0.0, 2.0, -2.0, 50.0], n, p=[0.9, 0.05, 0.04, 0.01])
                clouds.append(np.column_stack([xy, z]))
        windows.append((stamp, rng.permutation(np.vstack(clouds)), sensor))
        stamp += rng.choice([1.0, 3.0, 6.0, 70.0])
    return windows


def gathered(windows: Windows) -> NDArray[np.float32]:
    tiles, place = Tiles(0.0, 0.0, CELL_M, 0), Box(0, ROWS, 0, COLS)
    for stamp, points, sensor in windows:
        noise = Noise(RANGE_NOISE_M, ANGLE_NOISE_RAD)
        tiles.add(np.ascontiguousarray(points), sensor, noise, place, stamp, HOLD_S, max_age_s=MAX_AGE_S)
    return tiles.read(place)


def plain(windows: Windows) -> Cells:
    cells: Cells = defaultdict(Cell)
    for stamp, points, sensor in windows:
        for east, north, up in points:
            row, col = math.floor(north / CELL_M), math.floor(east / CELL_M)
            if not (0 <= row < ROWS and 0 <= col < COLS):
                continue
            cell = cells[row, col]
            if stamp - cell.last_s > MAX_AGE_S:
                cell.now, cell.before = Epoch(), Epoch()
            if cell.now.heights and stamp - cell.now.start_s > HOLD_S:
                cell.before, cell.now = cell.now, Epoch()
            if not cell.now.heights:
                cell.now.start_s = stamp
            across = math.hypot(east - sensor[0], north - sensor[1])
            down = up - sensor[2]
            along = RANGE_NOISE_M * down / math.hypot(across, down)
            variance = along**2 + (ANGLE_NOISE_RAD * across) ** 2
            cell.now.heights.append(up)
            cell.now.variances.append(RANGE_NOISE_M**2 if math.isnan(variance) else variance)
            cell.last_s = stamp
    return cells


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_epochs_hold_count_mean_noise_and_the_two_lowest_and_highest(seed: int) -> None:
    windows = random_windows(seed)
    evidence, expected = gathered(windows), plain(windows)
    for row in range(ROWS):
        for col in range(COLS):
            cell = expected.get((row, col), Cell())
            for got, epoch in zip(evidence[row, col], (cell.now, cell.before), strict=True):
                heights = sorted(epoch.heights)
                assert got[COUNT] == len(heights)
                if not heights:
                    continue
                assert got[MEAN] == pytest.approx(np.mean(heights), abs=1e-4)
                assert got[NOISE] == pytest.approx(np.mean(epoch.variances), rel=1e-3)
                assert got[[LOW, HIGH]] == pytest.approx([heights[0], heights[-1]], abs=1e-5)
                if len(heights) > 1:
                    assert got[[LOW2, HIGH2]] == pytest.approx([heights[1], heights[-2]], abs=1e-5)
            if cell.now.heights:
                assert evidence[row, col, 0, TIME] == cell.now.start_s
                assert evidence[row, col, 1, TIME] == cell.last_s


Heights = dict[tuple[int, int], list[float]]


def supported(
    cells: Heights, row: int, col: int, seen: Heights, alone: tuple[float, float] | None = None
) -> tuple[float, float, float]:
    """Height, bottom and top of one cell by the rule that a second return must reach as far.

    seen: heights of both epochs, by whose number support is needed. alone: bottom and top where the only
    return has none to support it; by default its own.
    """

    def upper(sign: int) -> tuple[float, float]:
        """Return the highest return and how high the next one reaches, of heights times the sign."""
        own = sorted((sign * z for z in cells[row, col]), reverse=True)
        others = own[1:2]
        if len(own) < CROWD[sign]:
            for i in range(row - 1, row + 2):
                for j in range(col - 1, col + 2):
                    around = sorted((sign * z for z in cells.get((i, j), [])), reverse=True)
                    if around and (i, j) != (row, col):
                        others.append(around[1] if len(around) >= CROWD[sign] else around[0])
        return own[0], max(others, default=math.inf)

    own = cells[row, col]
    nearby = sum(len(seen.get((i, j), [])) for i in range(row - 1, row + 2) for j in range(col - 1, col + 2))
    if nearby <= FEW:
        return float(np.mean(own)), min(own), max(own)
    (high, next_high), (low, next_low) = upper(1), upper(-1)
    low, next_low = -low, -next_low
    if math.isinf(next_high):
        return float(np.mean(own)), *(alone or (low, high))
    top, bottom = min(high, next_high), max(low, next_low)
    if top < bottom:
        top = bottom = next_high if high > next_high else next_low
    if len(own) == 1:
        return min(max(own[0], bottom), top), bottom, top
    kept = sorted(own)
    if high - top > 0.5:
        kept = kept[:-1]
    if bottom - low > 0.5 and len(kept) > 1:
        kept = kept[1:]
    return float(np.mean(kept)), bottom, top


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_the_summary_joins_the_epochs_and_drops_what_stands_alone(seed: int) -> None:
    windows = random_windows(seed)
    end_s = windows[-1][0]
    known = {place: cell for place, cell in plain(windows).items() if end_s - cell.last_s <= MAX_AGE_S}
    cells = {place: c.now.heights + c.before.heights for place, c in known.items()}
    current = {place: c.now.heights for place, c in known.items()}
    noise = {place: c.now.variances + c.before.variances for place, c in known.items()}
    out = summary(gathered(windows), end_s, MAX_AGE_S)
    for row in range(ROWS):
        for col in range(COLS):
            got = out[:, row, col]
            if (row, col) not in cells:
                assert got[WEIGHT] == 0
                assert np.isnan(got[HEIGHT])
                continue
            n = len(cells[row, col])
            assert got[WEIGHT] == n
            height, bottom, top = supported(cells, row, col, cells)
            expected = height, bottom, top
            if (bottom, top) != (min(cells[row, col]), max(cells[row, col])):
                _, own_bottom, own_top = supported(current, row, col, cells, (bottom, top))
                expected = height, min(bottom, own_bottom), max(top, own_top)
            assert got[[HEIGHT, BOTTOM, TOP]] == pytest.approx(expected, abs=1e-3)
            check_excess(float(got[EXCESS]), n, float(np.mean(noise[row, col])))


def check_excess(got: float, n: int, variance: float) -> None:
    """Compare with the expected maximum of n normal numbers, from its integral."""
    if n <= 8:
        assert got == 0
        return
    z = np.linspace(-8, 8, 4001)
    below = np.array([0.5 * math.erfc(-value / math.sqrt(2)) for value in z])
    maximum = 8 - np.trapezoid(below**n, z)
    assert got == pytest.approx((maximum - 1) * math.sqrt(variance), rel=0.25)
    assert got / math.sqrt(variance) + 1 == pytest.approx(maximum, rel=0.08)


def test_a_cell_not_seen_for_too_long_is_unknown() -> None:
    windows = random_windows(3)
    evidence = gathered(windows)
    last = {place: cell.last_s for place, cell in plain(windows).items()}
    assert len(set(last.values())) > 1
    for now in (MAX_AGE_S, MAX_AGE_S + min(last.values()) + 0.5, MAX_AGE_S + windows[-1][0] + 1):
        known = summary(evidence, now, MAX_AGE_S)[WEIGHT] > 0
        expected = {place for place, stamp in last.items() if now - stamp <= MAX_AGE_S}
        assert {(int(row), int(col)) for row, col in np.argwhere(known)} == expected
