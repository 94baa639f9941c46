"""Ground truth of safe landing places, computed from the exact world and written for evaluation.

It uses NumPy and SciPy on exact heights, without rays, sensors or the companion's code, so that an error
there cannot be repeated here.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array1D, Array2D, Strided2D
from sitl.compilation import kernel
from sitl.scenes.scene import Scene
from sitl.truth.truth_raster_file import write_geotiff
from sitl.truth.truth_surface import sample_top
from sitl.world.primitives import Kind
from sitl.world.world import World

Plane = Strided2D[np.float64]
F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
Extent = tuple[float, float, float, float]
MAX_SAMPLE_M = 0.1
_TILE = 192
NO_STAND = (Kind.WATER, Kind.MAIZE, Kind.WHEAT, Kind.REED)
"""Kinds of surface without anything to stand on."""


@kernel
def measure_span(
    z: Array2D[np.float64],
    offsets_m: Array1D[np.float64],
    step: int,
    mean: Plane,
    gradient_x: Plane,
    gradient_y: Plane,
    room: Array2D[np.float64],
    span: Plane,
) -> None:
    """Write the greatest less the smallest residual of each footprint; NaN where its plane is NaN.

    Parameters
    ----------
    z
        (rows, columns) samples of heights, m.
    offsets_m
        Of a footprint's samples from its centre, the same in both directions.
    step
        Samples from one footprint to the next.
    mean, gradient_x, gradient_y, span
        (columns, rows) of the footprints: their planes, and the result, m.
    room
        (3, samples of a footprint's side): the plane and the extremes along a row of samples, so that the
        compiler takes several samples at once.
    """
    n = len(offsets_m)
    plane, lowest, highest = room[0], room[1], room[2]
    for column in range(mean.shape[0]):
        for row in range(mean.shape[1]):
            for i in range(n):
                plane[i] = mean[column, row] + gradient_x[column, row] * offsets_m[i]
                lowest[i], highest[i] = np.inf, -np.inf
            for j in range(n):
                north = gradient_y[column, row] * offsets_m[j]
                samples = z[row * step + j, column * step : column * step + n]
                for i in range(n):
                    residual = samples[i] - (plane[i] + north)
                    lowest[i], highest[i] = min(lowest[i], residual), max(highest[i], residual)
            least, most = np.inf, -np.inf
            for i in range(n):
                least, most = min(least, lowest[i]), max(most, highest[i])
            span[column, row] = np.nan if np.isnan(mean[column, row]) else most - least


class TruthMap(NamedTuple):
    """Rasters (row = y, from the south) of one extent; NaN where the footprint leaves the world."""

    safe: U8
    """1 where the whole footprint about the cell centre is safe, else 0."""
    height_m: F32
    """Exact height of the top surface at the cell centre."""
    slope_deg: F32
    """Slope of the best-fit plane of the footprint."""
    relief_m: F32
    """Height of the footprint's surface, peak to peak, about that plane."""


def safe_map(
    world: World,
    extent: Extent,
    cell_m: float = 0.2,
    footprint_m: float = 2.0,
    slope_limit_deg: float = 10.0,
    relief_limit_m: float = 0.3,
) -> TruthMap:
    """Classify every cell of an extent as safe or unsafe.

    A cell is safe if, over the square footprint about its centre, the best-fit plane is not steeper than the
    limit, the exact surface spans no more than the limit, peak to peak, about that plane (so that a step
    counts with its full height wherever it crosses the footprint), and there is no water, no crop and no edge
    of the world. Water up to 5 cm deep is a puddle, which one can land in, and grass of 0.15 m a meadow. The
    surface is sampled at 0.1 m or less; objects thinner than the sampling count with their full
    height wherever they touch a sample's square.

    Parameters
    ----------
    world
        Movers count at their current places.
    extent
        (x_min, y_min, x_max, y_max), metres; cells fill it from its south-west corner.
    cell_m, footprint_m
        Side of a cell, side of the square the vehicle needs.
    slope_limit_deg, relief_limit_m
        Limits, inclusive.

    Raises
    ------
    ValueError
        If the extent is smaller than a cell.
    """
    x0, y0, x1, y1 = extent
    columns, rows = int(np.floor((x1 - x0) / cell_m + 1e-9)), int(np.floor((y1 - y0) / cell_m + 1e-9))
    if columns < 1 or rows < 1:
        raise ValueError(f"truth: extent {extent} holds no cell of {cell_m} m")
    per_cell = int(np.ceil(cell_m / MAX_SAMPLE_M - 1e-9))
    pitch = cell_m / per_cell
    offsets = _sample_offsets(per_cell, pitch, footprint_m)
    pad = (len(offsets) - per_cell) // 2 if len(offsets) > per_cell else 0
    xs = x0 + (np.arange(columns * per_cell + 2 * pad, dtype=np.float64) - pad + 0.5) * pitch
    ys = y0 + (np.arange(rows * per_cell + 2 * pad, dtype=np.float64) - pad + 0.5) * pitch
    z, kind = sample_top(world, xs, ys, pitch)
    bad = ~np.isfinite(z) | np.isin(kind, NO_STAND)
    skip = (per_cell + 2 * pad - len(offsets)) // 2
    slope, relief, spoilt = _footprints(
        z[skip:, skip:], bad[skip:, skip:], offsets, per_cell, (rows, columns)
    )
    safe = ~spoilt & (slope <= slope_limit_deg) & (relief <= relief_limit_m)
    centre_x = x0 + (np.arange(columns) + 0.5) * cell_m
    centre_y = y0 + (np.arange(rows) + 0.5) * cell_m
    height, _ = world.surface(*np.meshgrid(centre_x, centre_y))
    return TruthMap(safe.astype(np.uint8), height.astype(np.float32), slope, relief)


def _sample_offsets(per_cell: int, pitch_m: float, footprint_m: float) -> F64:
    """Return the offsets, about a cell centre, of all samples whose square meets the footprint.

    Samples are at odd half pitches from the centre if per_cell is even, else at whole pitches.
    """
    first = 0.0 if per_cell % 2 else 0.5
    count = int(np.ceil(footprint_m / 2 / pitch_m + 0.5 - first - 1e-9))
    half = first + np.arange(max(count, 1))
    offsets: F64 = np.unique(np.concatenate([-half, half])) * pitch_m
    return offsets


def _footprints(
    z: F64, bad: NDArray[np.bool_], offsets: F64, per_cell: int, shape: tuple[int, int]
) -> tuple[F32, F32, NDArray[np.bool_]]:
    """Return slope, relief and the mask of bad cells, computed tile by tile."""
    slope, relief = np.empty(shape, np.float32), np.empty(shape, np.float32)
    spoilt = np.empty(shape, bool)
    for row in range(0, shape[0], _TILE):
        for column in range(0, shape[1], _TILE):
            rows, columns = min(_TILE, shape[0] - row), min(_TILE, shape[1] - column)
            window = np.s_[
                row * per_cell : (row + rows - 1) * per_cell + len(offsets),
                column * per_cell : (column + columns - 1) * per_cell + len(offsets),
            ]
            tile = np.s_[row : row + rows, column : column + columns]
            slope[tile], relief[tile] = _fit(z[window], offsets, per_cell)
            spoilt[tile] = _any(bad[window], len(offsets), per_cell)
    return slope, relief, spoilt


def _shifted(a: NDArray[Any], k: int, n: int, step: int) -> NDArray[Any]:
    """Return every step-th row of a, from the k-th of n samples of each footprint."""
    last = a.shape[0] - n + k
    return a[k : last + 1 : step]


def _fit(z: F64, offsets: F64, step: int) -> tuple[F32, F32]:
    """Return slope (deg) and relief (m) of the footprints that slide over a tile of samples."""
    n = len(offsets)
    down = np.array([_shifted(z, k, n, step) for k in range(n)])
    column_sum = down.sum(axis=0).T
    column_moment = np.tensordot(offsets, down, axes=1).T
    across = np.array([_shifted(column_sum, k, n, step) for k in range(n)])
    total, moment_x = across.sum(axis=0), np.tensordot(offsets, across, axes=1)
    moment_y = np.sum([_shifted(column_moment, k, n, step) for k in range(n)], axis=0)
    # The offsets are symmetric about zero, so the normal equations of the plane are diagonal.
    spread = n * float(np.sum(offsets**2))
    mean, gradient_x, gradient_y = total / n**2, moment_x / spread, moment_y / spread
    relief = np.empty(mean.shape)
    measure_span(
        np.ascontiguousarray(z), offsets, step, mean, gradient_x, gradient_y, np.empty((3, n)), relief
    )
    slope = np.degrees(np.arctan(np.hypot(gradient_x, gradient_y)))
    return slope.T.astype(np.float32), relief.T.astype(np.float32)


def _any(bad: NDArray[np.bool_], n: int, step: int) -> NDArray[np.bool_]:
    """Return whether any sample of each footprint is bad."""
    columns = np.any([_shifted(bad, k, n, step) for k in range(n)], axis=0).T
    found: NDArray[np.bool_] = np.any([_shifted(columns, k, n, step) for k in range(n)], axis=0).T
    return found


def write(
    directory: Path,
    scene: Scene,
    origin_lla: tuple[float, float, float],
    *,
    cell_m: float = 0.2,
    footprint_m: float = 2.0,
    slope_limit_deg: float = 10.0,
    relief_limit_m: float = 0.3,
    extent: Extent | None = None,
) -> TruthMap:
    """Write ``truth.tif``, ``dsm_truth.tif`` and ``scene.json`` and return the map.

    ``truth.tif`` is uint8, 1 safe and 0 not; ``dsm_truth.tif`` float32, metres above the origin's altitude.
    Both are north-up in a transverse Mercator projection about the origin, so that their coordinates are the
    world's x and y.

    Parameters
    ----------
    directory
        Created if missing.
    scene
        Scene to evaluate, with movers at their current places.
    origin_lla
        Latitude and longitude (deg), altitude (m) of the ENU origin.
    cell_m, footprint_m, slope_limit_deg, relief_limit_m
        As in ``safe_map``.
    extent
        Part of the scene; default all of it.
    """
    area = extent or scene.extent_m
    limits = (cell_m, footprint_m, slope_limit_deg, relief_limit_m)
    truth = safe_map(scene.world, area, *limits)
    directory.mkdir(parents=True, exist_ok=True)
    names = ("cell_m", "footprint_m", "slope_limit_deg", "relief_limit_m")
    tags = {name: str(value) for name, value in zip(names, limits, strict=True)}
    heights = {
        "height_reference": "metres above the origin altitude",
        "origin_altitude_m": str(origin_lla[2]),
    }
    document = _document(scene, origin_lla, area) | dict(zip(names, limits, strict=True))
    with tempfile.TemporaryDirectory(dir=directory, prefix=".unfinished-") as name:  # complete files, or none
        folder = Path(name)
        _write_tif(folder / "truth.tif", truth.safe, area, cell_m, origin_lla, tags, None)
        _write_tif(folder / "dsm_truth.tif", truth.height_m, area, cell_m, origin_lla, heights, np.nan)
        (folder / "scene.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        for file in ("dsm_truth.tif", "scene.json", "truth.tif"):
            (folder / file).replace(directory / file)
    return truth


def _write_tif(
    path: Path,
    values: U8 | F32,
    extent: Extent,
    cell_m: float,
    origin_lla: tuple[float, float, float],
    tags: dict[str, str],
    nodata: float | None,
) -> None:
    corner = extent[0], extent[1] + len(values) * cell_m
    write_geotiff(path, values[::-1], corner, cell_m, origin_lla[:2], tags, nodata)


def _document(scene: Scene, origin_lla: tuple[float, float, float], extent: Extent) -> dict[str, object]:
    """Return the description of a scene: its place, objects and named regions."""
    fixed = [
        {"name": solid.name, "kind": solid.kind.name.lower(), **solid.describe()}
        for solid in scene.world.solids
    ]
    moving = [
        {"name": part.name, "kind": part.kind.name.lower(), "mover": name, **part.describe()}
        for name, mover in scene.world.movers.items()
        for part in mover.placed()
    ]
    x, y, heading = scene.home_enu
    return {
        "scene": scene.name,
        "seed": scene.seed,
        "description": scene.description,
        "origin": {"lat_deg": origin_lla[0], "lon_deg": origin_lla[1], "alt_m": origin_lla[2]},
        "extent_enu_m": list(extent),
        "home_enu_m": [x, y, scene.world.height_m(x, y)],
        "home_heading_rad": heading,
        "regions": {name: [list(corner) for corner in polygon] for name, polygon in scene.regions.items()},
        "objects": fixed + moving,
    }
