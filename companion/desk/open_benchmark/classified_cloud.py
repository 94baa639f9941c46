"""Cases of real surveys: the truth is the classes of a LAS or LAZ file, where they say enough."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer
from scipy.ndimage import uniform_filter

from companion.desk.clouds.crs import from_option
from companion.desk.clouds.las import coordinates, open_las, pieces
from companion.desk.open_benchmark.benchmark_case import BenchmarkCase, local_crs
from companion.desk.open_benchmark.footprint_truth import SLOPE, SceneTruth
from companion.desk.open_benchmark.landing_task import (
    F64,
    SAFE,
    UNKNOWN,
    UNSAFE,
    CellGrid,
    FlownReturns,
    LandingTask,
)
from companion.desk.open_benchmark.methods.elevation_grid import (
    footprint_planes,
    footprint_reach,
    footprint_relief,
)
from companion.runtime.errors import UsageError

CELL_M = 0.5
MOST_CELLS = 4_000_000
GROUND, BUILDING = (2,), (6,)
NOISE = (7, 18)
KINDS: dict[str, tuple[int, ...]] = {
    "wire": (13, 14, 15),
    "building": BUILDING,
    "vegetation": (4, 5),
    "water": (9, 40, 41, 42, 43, 45),
}
JUDGING = {*GROUND, *NOISE, *(c for classes in KINDS.values() for c in classes)}
LEAST = 2  # returns of a class
LEAST_GROUND = 8
CLEAR = 0.3  # share by which ground must differ from a limit to be judged


class Counter(Protocol):
    """Function that counts returns in footprints by their classes."""

    def __call__(self, of: tuple[int, ...], others: bool = False) -> F64: ...


def classified_case(path: Path, crs: str | None = None) -> BenchmarkCase:
    """Return the case of a classified survey.

    A footprint is unsafe with returns of wires, towers, water or vegetation over 0.5 m (classes 4 and 5), at
    the edge of a building (returns of it and of the ground), and where the ground's plane exceeds the slope
    limit by 30 %. It is safe where all returns are ground, at least 8, by 30 % below both limits. All else is
    not judged: roofs, low vegetation, unclassified returns, thin data, ground near a limit.

    Raises
    ------
    UsageError
        The file cannot be read, is too large, or no cell of it can be judged.
    """
    source = open_las(path, from_option(crs) if crs else None)
    parts = [
        (coordinates(piece), np.asarray(piece.classification)) for piece in pieces(path, source.n_points)
    ]
    points = np.concatenate([part for part, _ in parts])
    classes = np.concatenate([part for _, part in parts]).astype(np.int64)
    middle = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
    lonlat = Transformer.from_crs(source.reference.horizontal, "EPSG:4326", always_xy=True)
    lon, lat = lonlat.transform(*middle)
    origin = round(lat, 7), round(lon, 7), float(math.floor(points[:, 2].min()))
    local = Transformer.from_crs(source.reference.horizontal, local_crs(origin), always_xy=True)
    x, y = local.transform(points[:, 0], points[:, 1])
    z = (points[:, 2] - origin[2]) * source.reference.vertical_m
    local_m = np.column_stack([x, y, z])
    grid = _grid(path, local_m)
    task = LandingTask(grid)
    n = len(local_m)
    flight = FlownReturns(local_m, np.linspace(0.0, 0.9, n), np.zeros(n, np.int64), np.full((1, 3), np.nan))
    truth = _truth(flight, classes, task)
    if (truth.safe == UNKNOWN).all():
        raise UsageError(f"{path}: no cell can be judged by its classes: is it classified?")
    document = {"file": path.name, "crs": source.reference.name, "points": n, "truth": "classes of the file"}
    return BenchmarkCase(path.stem, origin, task, truth, {path.stem: flight}, document)


def _grid(path: Path, local_m: F64) -> CellGrid:
    low = np.floor(local_m[:, :2].min(axis=0) / CELL_M) * CELL_M
    cols, rows = (int(n) for n in np.ceil((local_m[:, :2].max(axis=0) - low) / CELL_M) + 1)
    if rows * cols > MOST_CELLS:
        raise UsageError(f"{path}: it covers {rows * cols} cells of {CELL_M} m: cut out a part of it first")
    return CellGrid(float(low[0]), float(low[1]), CELL_M, rows, cols)


def _truth(flight: FlownReturns, classes: NDArray[np.int64], task: LandingTask) -> SceneTruth:
    grid = task.grid
    reach = footprint_reach(task, grid.cell_m)
    counted = _counter(flight, classes, grid, reach)
    ground = _only(flight, np.isin(classes, GROUND))
    n_ground, level, gx, gy = footprint_planes(ground, grid, reach)
    slope = np.degrees(np.arctan(np.hypot(gx, gy)))
    relief = footprint_relief(ground, grid, reach, level, gx, gy)
    kinds = (*KINDS, SLOPE)
    seen = {name: counted(of) >= LEAST for name, of in KINDS.items()}
    seen["building"] &= n_ground >= LEAST
    steep = (n_ground >= LEAST_GROUND) & (slope > (1 + CLEAR) * task.slope_limit_deg)
    other = counted((*GROUND, *NOISE), others=True) > 0
    level_ground = (slope < (1 - CLEAR) * task.slope_limit_deg) & (relief < (1 - CLEAR) * task.relief_limit_m)
    safe = (n_ground >= LEAST_GROUND) & level_ground & ~other
    unclear = counted(tuple(JUDGING), others=True) > 0
    kind = np.full(grid.shape, UNKNOWN, np.uint8)
    for index, name in reversed(list(enumerate(kinds))):
        kind[(steep & ~unclear & ~other) if name == SLOPE else seen[name]] = index
    state = np.where(kind != UNKNOWN, UNSAFE, np.where(safe, SAFE, UNKNOWN)).astype(np.uint8)
    return SceneTruth(state, kind, kinds, slope, relief)


def _counter(flight: FlownReturns, classes: NDArray[np.int64], grid: CellGrid, reach: int) -> Counter:
    """Return a function that counts, in each footprint, the returns of some classes, or of all others."""
    row, col, inside = grid.index(flight.points_m[:, 0], flight.points_m[:, 1])
    at, size = row * grid.cols + col, 2 * reach + 1

    def counted(of: tuple[int, ...], others: bool = False) -> F64:
        mine = inside & np.isin(classes, of, invert=others)
        cells = np.bincount(at[mine], minlength=grid.rows * grid.cols).reshape(grid.shape).astype(np.float64)
        cells = uniform_filter(cells, size, mode="constant")
        return np.rint(cells * size**2)

    return counted


def _only(flight: FlownReturns, keep: NDArray[np.bool_]) -> FlownReturns:
    return FlownReturns(flight.points_m[keep], flight.stamp_s[keep], flight.window[keep], flight.sensors_m)
