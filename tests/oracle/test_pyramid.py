"""Levels of the pyramid against the returns themselves, and planes of known slope at every level."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from slz import LocalFrame, Pipeline, TerrainMaps, Window
from slz.grid import Box
from slz.kernels.cells.resolution_pyramid import downsample
from slz.kernels.raster.horizon import horizon
from slz.terrain.tiles import Noise, Tiles

COUNT, MEAN, NOISE, LOW, LOW2, HIGH, HIGH2, TIME = range(8)
FRAME = LocalFrame(47.0, 8.0, 400.0)
SIDE, CELL_M = 16, 0.5
seeds = st.integers(0, 10_000)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 3))
def test_a_level_holds_the_statistics_of_all_returns_below_it(seed: int, level: int) -> None:
    rng = np.random.default_rng(seed)
    tiles, box = Tiles(0.0, 0.0, CELL_M, 0), Box(0, SIDE, 0, SIDE)
    heights: dict[tuple[int, int], list[float]] = defaultdict(list)
    seen_s: dict[tuple[int, int], dict[tuple[int, int], float]] = defaultdict(dict)
    for now_s in (0.0, 5.0, 12.0):
        xy = rng.uniform(0, SIDE * CELL_M, (rng.integers(1, 150), 2))
        z = rng.normal(0, 1, len(xy))
        tiles.add(np.column_stack([xy, z]), np.zeros(3), Noise(0.02, 0.0), box, now_s, 8.0)
        for (east, north), up in zip(xy, z, strict=True):
            fine = int(north // CELL_M), int(east // CELL_M)
            place = fine[0] >> level, fine[1] >> level
            heights[place].append(up)
            seen_s[place][fine] = now_s
    evidence = tiles.read(box)
    for _ in range(level):
        evidence = downsample(evidence, 12.0, 100.0)
    for row in range(SIDE >> level):
        for col in range(SIDE >> level):
            got, values = evidence[row, col, 0], sorted(heights[row, col])
            assert got[COUNT] == len(values)
            if not values:
                continue
            assert got[MEAN] == pytest.approx(np.mean(values), abs=1e-5)
            assert got[[LOW, HIGH]] == pytest.approx([values[0], values[-1]], abs=1e-6)
            if len(values) > 1:
                assert got[[LOW2, HIGH2]] == pytest.approx([values[1], values[-2]], abs=1e-6)
            assert evidence[row, col, 1, TIME] == min(seen_s[row, col].values())


def test_returns_too_old_are_left_out_of_the_levels() -> None:
    tiles, box = Tiles(0.0, 0.0, 1.0, 0), Box(0, 2, 0, 2)
    sensor, noise = np.zeros(3), Noise(0.02, 0.0)
    tiles.add(np.array([[0.5, 0.5, 3.0]]), sensor, noise, box, 0.0, 8.0)
    tiles.add(np.array([[1.5, 0.5, 7.0]]), sensor, noise, box, 50.0, 8.0)
    assert downsample(tiles.read(box), 60.0, 100.0)[0, 0, 0, COUNT] == 2
    joint = downsample(tiles.read(box), 120.0, 100.0)[0, 0, 0]
    assert joint[[COUNT, MEAN]].tolist() == [1, 7.0]


def plane_at(level: int, slope_deg: float, seed: int = 0) -> TerrainMaps:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-30, 30, (72_000, 2))
    z = np.tan(np.radians(slope_deg)) * xy[:, 0] + rng.normal(0, 0.02, len(xy))
    own = ["zone_m=100", "safe_slope_deg=30", "relief_m=5"]
    pipe = Pipeline(params.load("quadcopter", own), (0.0, 0.0))
    stamps = np.zeros(len(xy), np.int64)
    pipe.process(Window(np.column_stack([xy, z]), stamps, np.full(3, np.nan), FRAME, 0, 0))
    maps = pipe.maps(level=level)
    assert maps is not None
    assert maps.grid.cell_m == pytest.approx(0.2 * 2**level)
    return maps


@pytest.mark.parametrize("level", range(5))
@pytest.mark.parametrize("slope_deg", [0.0, 12.0])
def test_the_slope_of_a_plane_is_found_at_every_level_with_its_standard_error(
    level: int, slope_deg: float
) -> None:
    maps = plane_at(level, slope_deg)
    known = np.isfinite(maps.slope_deg)
    assert known.sum() > 50
    error = maps.slope_deg[known] - slope_deg
    assert np.sqrt(np.mean(error**2)) < (
        0.35 if level == 0 else 0.5
    )  # a coarse cell's returns lie off its middle
    if slope_deg:
        assert 0.7 < np.std(error / maps.slope_sigma_deg[known]) < 1.4


def test_a_post_shows_as_relief_at_every_level() -> None:
    rng = np.random.default_rng(1)
    xy = rng.uniform(-20, 20, (32_000, 2))
    post = np.column_stack([np.full(6, 3.05), np.full(6, 1.05), np.linspace(0.3, 1.2, 6)])
    cloud = np.vstack([np.column_stack([xy, rng.normal(0, 0.02, len(xy))]), post])
    pipe = Pipeline(params.load("quadcopter", ["zone_m=80"]), (0.0, 0.0))
    stamps = np.zeros(len(cloud), np.int64)
    pipe.process(Window(cloud, stamps, np.full(3, np.nan), FRAME, 0, 0))
    for level in range(5):
        maps = pipe.maps(level=level)
        assert maps is not None
        row, col = maps.grid.index(3.05, 1.05)
        assert maps.state[row - maps.box.row0, col - maps.box.col0] == 0


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_the_horizon_is_the_greatest_elevation_angle_of_each_sector(seed: int) -> None:
    """Cells far enough for their middle to tell the sector."""
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(5, 30, 2)
    top = rng.normal(0, 3, (rows, cols)).astype(np.float32)
    top[rng.random((rows, cols)) < 0.3] = np.nan
    row, col = rng.uniform(0, rows), rng.uniform(0, cols)
    near, far, sectors = 1.0, 12.0, 12
    got = horizon(top, row, col, 0.5, 0.5, near, far, sectors)
    middle: list[list[float]] = [[] for _ in range(sectors)]
    touching: list[list[float]] = [[] for _ in range(sectors)]
    for r, c in np.argwhere(np.isfinite(top)):
        east, north = (c - col) * 0.5, (r - row) * 0.5
        distance = float(np.hypot(east, north))
        if not near <= distance <= far:
            continue
        angle = float(np.arctan2(top[r, c] - 0.5, distance))
        bearing = float(np.arctan2(east, north)) / (2 * np.pi / sectors)
        middle[round(bearing) % sectors].append(angle)
        for sector in range(sectors):
            off = abs((bearing - sector + sectors / 2) % sectors - sectors / 2) - 0.5
            if off * 2 * np.pi / sectors <= np.arcsin(0.25 / distance) + 1e-9:
                touching[sector].append(angle)
    for sector in range(sectors):
        if not touching[sector]:
            assert np.isnan(got[sector])
            continue
        assert got[sector] == pytest.approx(max(touching[sector]), abs=1e-6)
        assert got[sector] >= max(middle[sector], default=-np.inf) - 1e-6


def surface(kind: str, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y = xy.T
    return {
        "plane": 0.1 * x - 0.05 * y,
        "cone": -0.15 * np.hypot(x, y),
        "sine": 2.0 * np.sin(x / 12.0),
    }[kind]


def gradient(kind: str, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    x, _ = xy.T
    return {
        "plane": np.full(len(xy), np.hypot(0.1, 0.05)),
        "cone": np.full(len(xy), 0.15),
        "sine": np.abs(np.cos(x / 12.0)) / 6.0,
    }[kind]


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("kind", ["plane", "cone", "sine"])
def test_planes_follow_closed_forms_at_footprint_scale(kind: str, level: int) -> None:
    """Plane, cone and sine; the cone away from its tip, where no plane is its tangent."""
    rng = np.random.default_rng(2)
    xy = rng.uniform(-20, 20, (48_000, 2))
    cloud = np.column_stack([xy, surface(kind, xy)])
    own = ["zone_m=80", "safe_slope_deg=40", "relief_m=5"]
    pipe = Pipeline(params.load("quadcopter", own), (0.0, 0.0))
    stamps = np.zeros(len(cloud), np.int64)
    pipe.process(Window(cloud, stamps, np.full(3, np.nan), FRAME, 0, 0))
    maps = pipe.maps(level=level)
    assert maps is not None
    rows, cols = np.mgrid[maps.box.row0 : maps.box.row1, maps.box.col0 : maps.box.col1]
    cells = np.column_stack([rows.ravel(), cols.ravel()])
    centres = maps.grid.centres(cells)
    slope = maps.slope_deg.ravel()
    use = np.isfinite(slope) & (np.hypot(*centres.T) > 4.0)
    expected = np.degrees(np.arctan(gradient(kind, centres[use])))
    assert use.sum() > 400
    assert np.sqrt(np.mean((slope[use] - expected) ** 2)) < (0.1, 0.2, 0.3)[level]
