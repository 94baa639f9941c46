"""Scenes in files: clouds, poses, truth and description, for any program and from any simulator (ADR 39)."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path, PurePosixPath
from typing import Any

import laspy
import numpy as np
import rasterio
import rasterio.crs
from numpy.typing import NDArray
from rasterio import Affine

from companion.desk.clouds.cloud_source import translated
from companion.desk.clouds.crs import from_option
from companion.desk.clouds.las import check_header, coordinates, pieces
from companion.desk.clouds.pcd import open_pcd
from companion.desk.open_benchmark.benchmark_case import BenchmarkCase, frozen_agreement, local_crs
from companion.desk.open_benchmark.footprint_truth import SceneTruth
from companion.desk.open_benchmark.landing_task import (
    F64,
    SAFE,
    U8,
    UNKNOWN,
    UNSAFE,
    CellGrid,
    FlownReturns,
    LandingTask,
)
from companion.desk.open_benchmark.scan_simulation import RESOLUTION_M
from companion.runtime.errors import UsageError

FORMAT, FORMAT_VERSION = "slz-benchmark-scene", 1
CLOUD_FORMATS = ("laz", "pcd")
POSE_COLUMNS = ("t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
LEVEL = ("0", "0", "0", "1")  # the sensor's axes are those of the scene
SCENE_FILE, TRUTH, KIND, VALUES = "scene.json", "truth.tif", "kind.tif", "truth_values.tif"
NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,99}")  # of scenes and flights, whose folders they name


def write_case(case: BenchmarkCase, out: Path, cloud_format: str = "laz") -> list[Path]:
    """Write a case into OUT/NAME and return the files.

    truth.tif: uint8, 0 unsafe, 1 safe, 255 not judged. kind.tif: uint8, index into `kinds` of scene.json.
    truth_values.tif: float64, slope (deg) and relief (m) of each footprint. All are north up. Each flight has
    a folder with its cloud in local metres and the sensor's poses; a pose holds until the next.

    Raises
    ------
    UsageError
        The name of the case or of a flight cannot be that of a folder.
    """
    for name in (case.name, *case.flights):
        _check_name(name, f"scene {case.name!r}")
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
    """Read a case that `write_case` or another program wrote; clouds are LAS, LAZ or PCD.

    A PCD file needs the fields x, y, z, t (s) and window (from 0). `digests_agree` is True where the case is
    a frozen scene, digest by digest, else None.

    Raises
    ------
    UsageError
        A file is missing, is not what scene.json says, or has values that mean nothing.
    """
    try:
        document = json.loads((folder / SCENE_FILE).read_text("utf-8"))
        if document["format"] != FORMAT or document["format_version"] != FORMAT_VERSION:
            raise UsageError(f"{folder}: scene.json is not of format {FORMAT} {FORMAT_VERSION}")
        name = str(document["name"])
        flights: Mapping[str, str] = document["flights"]
        for given in (name, *flights):
            _check_name(given, str(folder / SCENE_FILE))
        for cloud in flights.values():
            _check_inside(cloud, folder / SCENE_FILE)
        task = _task(document["task"], folder / SCENE_FILE)
        lat, lon, alt = (float(document["origin"][key]) for key in ("lat_deg", "lon_deg", "alt_m"))
        if not (abs(lat) <= 90 and abs(lon) <= 180 and math.isfinite(alt)):
            raise UsageError(f"{folder / SCENE_FILE}: its origin {lat:g}, {lon:g}, {alt:g} is no place")
        kinds = tuple(str(kind) for kind in document["kinds"])
        slope, relief = _read_rasters(folder / VALUES, task.grid, 2)
        safe, kind = _read_states(folder, task.grid, len(kinds))
        truth = SceneTruth(safe, kind, kinds, slope, relief)
        origin = lat, lon, alt
        read = {label: _read_flight(folder / path, origin) for label, path in flights.items() if with_flights}
        case = BenchmarkCase(name, origin, task, truth, read, document["scene"])
        return replace(case, digests_agree=frozen_agreement(case) or None)
    except UsageError:
        raise
    except (
        OSError,
        KeyError,
        TypeError,
        ValueError,
        AttributeError,
        csv.Error,
        rasterio.errors.RasterioError,
    ) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise UsageError(f"{folder}: it is no scene of the benchmark ({reason})") from None


def _check_name(name: str, where: str) -> None:
    if not NAME.fullmatch(name):
        raise UsageError(
            f"{where}: the name {name[:60]!r} cannot be that of a folder: use letters, digits, -, _ and .,"
            " no . first"
        )


def _check_inside(cloud: str, file: Path) -> None:
    """Refuse a flight's cloud outside the scene's folder, for a scene is read from its folder alone."""
    path = PurePosixPath(cloud)
    if path.is_absolute() or ".." in path.parts:
        raise UsageError(f"{file}: the cloud {cloud[:60]!r} of a flight must be inside the scene's folder")


def _task(values: Mapping[str, Any], file: Path) -> LandingTask:
    limits = {name: float(value) for name, value in values.items() if name != "grid"}
    grid = values["grid"]
    sides = {name: float(grid[name]) for name in ("west_m", "south_m", "cell_m")}
    positive = {name: value for name, value in limits.items() if name != "range_noise_m"}
    for name, value in {**positive, "cell_m": sides["cell_m"]}.items():
        if not (math.isfinite(value) and value > 0):
            raise UsageError(f"{file}: its {name} is {value:g}: it must be above 0")
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


def _read_states(folder: Path, grid: CellGrid, n_kinds: int) -> tuple[U8, U8]:
    """Return the states and kinds of a truth, (rows, cols) each, all of whose values are known ones."""
    states = _read_rasters(folder / TRUTH, grid, 1)[0]
    kinds = _read_rasters(folder / KIND, grid, 1)[0]
    _check_values(folder / TRUTH, states, np.isin(states, (UNSAFE, SAFE, UNKNOWN)), "0, 1 or 255")
    known = (kinds >= 0) & (kinds < n_kinds) & (kinds == np.floor(kinds))
    allowed = f"the index of one of the {n_kinds} kinds of scene.json"
    _check_values(folder / KIND, kinds, known | (kinds == UNKNOWN), f"{allowed}, or 255")
    _check_values(folder / KIND, kinds, known | (states != UNSAFE), f"{allowed} where truth.tif is 0")
    return states.astype(np.uint8), kinds.astype(np.uint8)


def _check_values(path: Path, values: NDArray[Any], right: NDArray[np.bool_], allowed: str) -> None:
    if not right.all():
        raise UsageError(f"{path}: it has the value {values[~right][0]:g}, not {allowed}")


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


def _read_flight(cloud_path: Path, origin: tuple[float, float, float]) -> FlownReturns:
    form = cloud_path.suffix.lower()
    if form in (".las", ".laz"):
        points, stamps, window = _read_las(cloud_path)
    elif form == ".pcd":
        points, stamps, window = _read_pcd(cloud_path, origin)
    else:
        raise UsageError(f"{cloud_path}: a flight's cloud is LAS, LAZ or PCD")
    with (cloud_path.parent / "poses.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    sensors = np.array([[float(row[axis] or "nan") for axis in POSE_COLUMNS[1:4]] for row in rows]).reshape(
        -1, 3
    )
    if len(points) == 0 or window.min() < 0 or window.max() >= len(sensors):
        field = "window, from 0" if form == ".pcd" else "point source ID, from 1"
        raise UsageError(f"{cloud_path}: its points must name one of {len(sensors)} poses by their {field}")
    if not (np.isfinite(points).all() and np.isfinite(stamps).all()):
        raise UsageError(f"{cloud_path}: a coordinate or time of it is no finite number")
    scaled = np.rint(points / RESOLUTION_M) * RESOLUTION_M
    return FlownReturns(scaled, stamps, window, sensors)


def _read_las(path: Path) -> tuple[F64, F64, NDArray[np.int64]]:
    """Return points, times and windows of a LAS or LAZ file."""
    check_header(path)
    with translated(path), laspy.open(path, encoding_errors="replace") as reader:
        n, names = int(reader.header.point_count), set(reader.header.point_format.dimension_names)
    if not n or "gps_time" not in names:
        raise UsageError(f"{path}: it has no {'gps_time' if n else 'points'}")
    parts = list(pieces(path, n))
    return (
        np.concatenate([coordinates(part) for part in parts]),
        np.concatenate([np.asarray(part.gps_time, np.float64) for part in parts]),
        np.concatenate([np.asarray(part.point_source_id, np.int64) for part in parts]) - 1,
    )


def _read_pcd(path: Path, origin: tuple[float, float, float]) -> tuple[F64, F64, NDArray[np.int64]]:
    """Return points, times and windows of a PCD file."""
    records = open_pcd(path, from_option(local_crs(origin).to_wkt())).records()
    lacking = [name for name in ("x", "y", "z", "t", "window") if name not in (records.dtype.names or ())]
    if lacking:
        raise UsageError(f"{path}: its points have no field {lacking[0]}")
    points = np.column_stack([records[axis].astype(np.float64) for axis in "xyz"])
    return points, records["t"].astype(np.float64), records["window"].astype(np.int64)
