"""Scenes in files: clouds, poses, truth and description, for any program and from any simulator (ADR 39)."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import rasterio
import rasterio.crs
from numpy.typing import NDArray
from rasterio import Affine

from companion.desk.open_benchmark.benchmark_case import BenchmarkCase
from companion.desk.open_benchmark.footprint_truth import SceneTruth
from companion.desk.open_benchmark.landing_task import UNKNOWN, CellGrid, FlownReturns, LandingTask
from companion.desk.open_benchmark.scan_simulation import RESOLUTION_M
from companion.runtime.errors import UsageError

FORMAT, FORMAT_VERSION = "slz-benchmark-scene", 1
CLOUD_FORMATS = ("laz", "pcd")
POSE_COLUMNS = ("t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
LEVEL = ("0", "0", "0", "1")  # the sensor's axes are those of the scene
SCENE_FILE, TRUTH, KIND, VALUES = "scene.json", "truth.tif", "kind.tif", "truth_values.tif"


def write_case(case: BenchmarkCase, out: Path, cloud_format: str = "laz") -> list[Path]:
    """Write a case into OUT/NAME and return the files.

    truth.tif: uint8, 0 unsafe, 1 safe, 255 not judged. kind.tif: uint8, index into `kinds` of scene.json.
    truth_values.tif: float64, slope (deg) and relief (m) of each footprint. All are north up. Each flight has
    a folder with its cloud in local metres and the sensor's poses; a pose holds until the next.
    """
    folder = out / case.name
    folder.mkdir(parents=True, exist_ok=True)
    truth, grid = case.truth, case.task.grid
    crs = rasterio.crs.CRS.from_wkt(case.crs.to_wkt())
    _write_raster(folder / TRUTH, truth.safe[None], grid, crs, UNKNOWN)
    _write_raster(folder / KIND, truth.kind[None], grid, crs, UNKNOWN)
    _write_raster(folder / VALUES, np.stack([truth.slope_deg, truth.relief_m]), grid, crs, np.nan)
    files = [folder / name for name in (TRUTH, KIND, VALUES)]
    for label, returns in case.flights.items():
        place = folder / label
        place.mkdir(exist_ok=True)
        cloud = place / f"points.{cloud_format}"
        if cloud_format == "laz":
            _write_laz(cloud, returns, case)
        else:
            _write_pcd(cloud, returns)
        _write_poses(place / "poses.csv", returns)
        files += [cloud, place / "poses.csv"]
    document = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "name": case.name,
        "origin": dict(zip(("lat_deg", "lon_deg", "alt_m"), case.origin, strict=True)),
        "crs": case.crs.to_wkt(),
        "task": asdict(case.task),
        "kinds": list(truth.kinds),
        "flights": {label: f"{label}/points.{cloud_format}" for label in case.flights},
        "scene": case.document,
    }
    files.append(folder / SCENE_FILE)
    files[-1].write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    return files


def read_case(folder: Path, with_flights: bool = True) -> BenchmarkCase:
    """Read a case that `write_case` or another program wrote; clouds must be LAS or LAZ.

    Raises
    ------
    UsageError
        A file is missing, or is not what scene.json says.
    """
    try:
        document = json.loads((folder / SCENE_FILE).read_text("utf-8"))
        if document["format"] != FORMAT or document["format_version"] != FORMAT_VERSION:
            raise UsageError(f"{folder}: scene.json is not of format {FORMAT} {FORMAT_VERSION}")
        task = _task(document["task"])
        lat, lon, alt = (float(document["origin"][name]) for name in ("lat_deg", "lon_deg", "alt_m"))
        kinds = tuple(str(kind) for kind in document["kinds"])
        slope, relief = _read_rasters(folder / VALUES, task.grid, 2)
        truth = SceneTruth(
            _read_rasters(folder / TRUTH, task.grid, 1)[0],
            _read_rasters(folder / KIND, task.grid, 1)[0],
            kinds,
            slope,
            relief,
        )
        flights: Mapping[str, str] = document["flights"] if with_flights else {}
        read = {label: _read_flight(folder / path) for label, path in flights.items()}
        return BenchmarkCase(str(document["name"]), (lat, lon, alt), task, truth, read, document["scene"])
    except UsageError:
        raise
    except (
        OSError,
        KeyError,
        TypeError,
        ValueError,
        rasterio.errors.RasterioError,
        laspy.LaspyException,
    ) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise UsageError(f"{folder}: it is no scene of the benchmark ({reason})") from None


def _task(values: Mapping[str, Any]) -> LandingTask:
    limits = {name: float(value) for name, value in values.items() if name != "grid"}
    grid = values["grid"]
    sides = {name: float(grid[name]) for name in ("west_m", "south_m", "cell_m")}
    return LandingTask(CellGrid(**sides, rows=int(grid["rows"]), cols=int(grid["cols"])), **limits)


def _write_raster(
    path: Path, bands: NDArray[Any], grid: CellGrid, crs: rasterio.crs.CRS, nodata: float
) -> None:
    north_m = grid.south_m + grid.rows * grid.cell_m
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=grid.cols,
        height=grid.rows,
        count=len(bands),
        dtype=bands.dtype.name,
        crs=crs,
        transform=Affine(grid.cell_m, 0.0, grid.west_m, 0.0, -grid.cell_m, north_m),
        nodata=nodata,
        compress="deflate",
    ) as file:
        file.write(bands[:, ::-1])


def _read_rasters(path: Path, grid: CellGrid, bands: int) -> NDArray[Any]:
    with rasterio.open(path) as file:
        values = file.read()
    if values.shape != (bands, *grid.shape):
        raise UsageError(f"{path}: it has {values.shape}, scene.json says {(bands, *grid.shape)}")
    return np.ascontiguousarray(values[:, ::-1])


def _write_laz(path: Path, returns: FlownReturns, case: BenchmarkCase) -> None:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, RESOLUTION_M)
    header.offsets = np.zeros(3)
    header.add_crs(case.crs)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = returns.points_m.T
    cloud.gps_time = returns.stamp_s
    cloud.point_source_id = (returns.window + 1).astype(np.uint16)
    cloud.return_number = cloud.number_of_returns = np.ones(len(returns), np.uint8)
    cloud.write(str(path))


def _write_pcd(path: Path, returns: FlownReturns) -> None:
    n = len(returns)
    record = np.zeros(n, np.dtype([(name, "<f8") for name in ("x", "y", "z", "t")] + [("window", "<u4")]))
    record["x"], record["y"], record["z"] = returns.points_m.T
    record["t"], record["window"] = returns.stamp_s, returns.window
    lines = (
        "VERSION 0.7",
        "FIELDS x y z t window",
        "SIZE 8 8 8 8 4",
        "TYPE F F F F U",
        "COUNT 1 1 1 1 1",
        f"WIDTH {n}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {n}",
        "DATA binary",
    )
    path.write_bytes("\n".join(lines).encode() + b"\n" + record.tobytes())


def _write_poses(path: Path, returns: FlownReturns) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(POSE_COLUMNS)
        for k, sensor in enumerate(returns.sensors_m):
            place = ["" if np.isnan(v) else f"{v:.3f}" for v in sensor]
            writer.writerow([f"{float(k):.3f}", *place, *LEVEL])


def _read_flight(cloud_path: Path) -> FlownReturns:
    cloud = laspy.read(cloud_path)
    points = np.column_stack([np.asarray(cloud[axis], np.float64) for axis in "xyz"])
    with (cloud_path.parent / "poses.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    sensors = np.array([[float(row[axis] or "nan") for axis in POSE_COLUMNS[1:4]] for row in rows]).reshape(
        -1, 3
    )
    window = np.asarray(cloud.point_source_id).astype(np.int64) - 1
    if len(points) == 0 or window.min() < 0 or window.max() >= len(sensors):
        raise UsageError(f"{cloud_path}: its points name poses 1 to {len(sensors)} by their point source ID")
    scaled = np.rint(points / RESOLUTION_M) * RESOLUTION_M
    return FlownReturns(scaled, np.asarray(cloud.gps_time, np.float64), window, sensors)
