"""A scene of the simulator as a folder of the exchange format that `slz benchmark --scenes` reads (ADR 39).

The LiDAR of a flown survey sees a part of the scene, placed with the true pose; truth and kinds of hazard
come from the exact world. The outermost metres are flown over and not judged. All densities are thinned
from one flight.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl import scenes
from sitl.flown_survey import Lines, PlacedScan, extent_of, fly
from sitl.scenes import Scene
from sitl.sensors import lidars
from sitl.truth.hazard_kind import KINDS, NO_KIND, hazard_kinds
from sitl.truth.truth import Extent, safe_map

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FORMAT, FORMAT_VERSION = "slz-benchmark-scene", 1
ORIGIN = (47.0, 8.0, 400.0)
"""Latitude, longitude (deg) and altitude (m) of the local metres."""
NOT_JUDGED = 255
EDGE_M = 2.0
"""Ground along the edge that is seen from one side alone, and not judged; a footprint at least."""
SIDE_M = 40.0
"""Side of the part that is flown over if none is named, about the scene's start."""
WINDOW_NS = 1_000_000_000
RESOLUTION_M = 0.001
POSE_COLUMNS = ("t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")


@dataclass(frozen=True, slots=True)
class Task:
    """Size of a cell and of the footprint (m), limits of slope (deg) and relief (m)."""

    cell_m: float = 0.2
    footprint_m: float = 2.0
    slope_limit_deg: float = 10.0
    relief_limit_m: float = 0.3


@dataclass(frozen=True, slots=True)
class Flight:
    """Returns (n, 3), their times (n,) and windows (n,), and the sensor's place in each window (w, 3)."""

    points_enu_m: F64
    stamp_ns: I64
    window: I64
    sensors_enu_m: F64


def flight_of(scans: Sequence[PlacedScan], extent: Extent) -> Flight:
    """Return the returns within an extent, in windows of a second; a window's place is that of its middle."""
    of_scan = np.array([scan.stamp_ns[0] if len(scan.stamp_ns) else -1 for scan in scans]) // WINDOW_NS
    numbers = np.unique(of_scan[of_scan >= 0])
    windows = [[scan for scan, k in zip(scans, of_scan, strict=True) if k == number] for number in numbers]
    points = np.concatenate([scan.points_enu_m for window in windows for scan in window])
    stamps = np.concatenate([scan.stamp_ns for window in windows for scan in window])
    counts = [sum(len(scan.stamp_ns) for scan in window) for window in windows]
    sensors = np.array([window[len(window) // 2].sensor_enu_m for window in windows])
    x0, y0, x1, y1 = extent
    x, y = points[:, 0], points[:, 1]
    inside = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
    numbered = np.repeat(np.arange(len(windows)), counts)
    return Flight(points[inside], stamps[inside], numbered[inside], sensors)


def thinned(flight: Flight, returns: int, rng: np.random.Generator) -> Flight:
    """Return a flight with a number of its returns, chosen at random; ValueError if it has fewer."""
    n = len(flight.stamp_ns)
    if returns > n:
        raise ValueError(f"the flight has {n} returns, {returns} are needed: more --point-rate, less --speed")
    keep = np.sort(rng.choice(n, returns, replace=False))
    return Flight(flight.points_enu_m[keep], flight.stamp_ns[keep], flight.window[keep], flight.sensors_enu_m)


def write(
    out: Path, name: str, scene: Scene, extent: Extent, task: Task, flights: dict[str, Flight], **flown: Any
) -> Path:
    """Write OUT/NAME and return it: truth, kinds, flights by label, and scene.json with what was flown."""
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    truth = safe_map(scene.world, extent, *asdict(task).values())
    limits = task.cell_m, task.footprint_m, task.slope_limit_deg
    kinds = hazard_kinds(scene.world, extent, truth, *limits)
    edge = math.ceil(max(EDGE_M, task.footprint_m) / task.cell_m - 1e-9)
    judged = np.zeros(truth.safe.shape, bool)
    judged[edge:-edge, edge:-edge] = True
    rows, cols = truth.safe.shape
    rasters: dict[str, tuple[NDArray[Any], float]] = {
        "truth.tif": (np.where(judged, truth.safe, NOT_JUDGED).astype(np.uint8)[None], NOT_JUDGED),
        "kind.tif": (np.where(judged, kinds, NO_KIND).astype(np.uint8)[None], NO_KIND),
        "truth_values.tif": (np.stack([truth.slope_deg, truth.relief_m]).astype(np.float64), math.nan),
    }
    for file, (bands, nodata) in rasters.items():
        _write_raster(folder / file, bands, extent, task.cell_m, nodata)
    for label, flight in flights.items():
        (folder / label).mkdir(exist_ok=True)
        _write_laz(folder / label / "points.laz", flight)
        _write_poses(folder / label / "poses.csv", flight)
    grid = {"west_m": extent[0], "south_m": extent[1], "cell_m": task.cell_m, "rows": rows, "cols": cols}
    of_task = {key: value for key, value in asdict(task).items() if key != "cell_m"}
    document = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "name": name,
        "origin": dict(zip(("lat_deg", "lon_deg", "alt_m"), ORIGIN, strict=True)),
        "crs": _crs().to_wkt(),
        "task": {"grid": grid} | of_task | {"range_noise_m": flown.pop("range_noise_m")},
        "kinds": list(KINDS),
        "flights": {label: f"{label}/points.laz" for label in flights},
        "scene": {"simulator": scene.name, "seed": scene.seed, "description": scene.description, **flown},
    }
    (folder / "scene.json").write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    return folder


def _crs() -> Any:
    from pyproj import CRS

    lat, lon, _ = ORIGIN
    return CRS.from_proj4(
        f"+proj=tmerc +lat_0={lat!r} +lon_0={lon!r} +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
    )


def _write_raster(path: Path, bands: NDArray[Any], extent: Extent, cell_m: float, nodata: float) -> None:
    import rasterio
    from rasterio import Affine

    count, rows, cols = bands.shape
    north_up = Affine(cell_m, 0.0, extent[0], 0.0, -cell_m, extent[1] + rows * cell_m)
    shape = {"width": cols, "height": rows, "count": count, "dtype": bands.dtype.name}
    place = {"crs": _crs().to_wkt(), "transform": north_up, "nodata": nodata}
    with rasterio.open(path, "w", driver="GTiff", compress="deflate", **shape, **place) as file:
        file.write(bands[:, ::-1])


def _write_laz(path: Path, flight: Flight) -> None:
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, RESOLUTION_M), np.zeros(3)
    header.add_crs(_crs())
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = flight.points_enu_m.T
    cloud.gps_time = flight.stamp_ns * 1e-9
    cloud.point_source_id = (flight.window + 1).astype(np.uint16)
    cloud.return_number = cloud.number_of_returns = np.ones(len(flight.stamp_ns), np.uint8)
    cloud.write(str(path))


def _write_poses(path: Path, flight: Flight) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(POSE_COLUMNS)
        for k, place in enumerate(flight.sensors_enu_m):
            level = ("0", "0", "0", "1")  # the points are placed: the sensor's axes are those of the scene
            writer.writerow([f"{k * WINDOW_NS * 1e-9:.3f}", *(f"{v:.3f}" for v in place), *level])


def main(arguments: list[str] | None = None) -> int:
    """Fly over a scene and write it as a folder."""
    parser = argparse.ArgumentParser(
        prog="python -m sitl.benchmark_scene", description=str(__doc__).splitlines()[0]
    )
    usual = Task()
    parser.add_argument("--scene", default="stadium", help=", ".join(scenes.NAMES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lidar", default="mid360", help=", ".join(lidars.PULSED))
    parser.add_argument("--extent", metavar="X0,Y0,X1,Y1", help=f"metres; default: {SIDE_M:.0f} m about home")
    parser.add_argument("--height", type=float, default=20.0, help="m above the highest thing below")
    parser.add_argument("--spacing", type=float, default=20.0, help="m between lines")
    parser.add_argument("--speed", type=float, default=12.0, help="m/s")
    parser.add_argument(
        "--point-rate", type=int, default=200_000, help="pulses per second that are simulated"
    )
    parser.add_argument("--density", type=int, action="append", help="returns per m², often (20 and 100)")
    parser.add_argument("--cell", type=float, default=usual.cell_m, help="m")
    parser.add_argument("--footprint", type=float, default=usual.footprint_m, help="m")
    parser.add_argument("--slope-limit", type=float, default=usual.slope_limit_deg, help="degrees")
    parser.add_argument("--relief-limit", type=float, default=usual.relief_limit_m, help="m")
    parser.add_argument("--name", help="of the folder; default: SCENE-SEED")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    options = parser.parse_args(arguments)
    task = Task(options.cell, options.footprint, options.slope_limit, options.relief_limit)
    try:
        folder = _write(options, task)
    except ModuleNotFoundError as error:
        parser.error(f"{error.name} is missing: pip install 'slz[survey]'")
    except ValueError as error:
        parser.error(str(error))
    print(folder)
    return 0


def _write(options: argparse.Namespace, task: Task) -> Path:
    scene = scenes.build(options.scene, options.seed)
    extent = extent_of(options.extent, scene) if options.extent else _about_home(scene)
    x0, y0, x1, y1 = extent
    least = 2 * max(EDGE_M, task.footprint_m) + task.cell_m
    if min(x1 - x0, y1 - y0) < least:
        raise ValueError(f"--extent: nothing is left to judge: its sides must be {least:g} m or more")
    densities = tuple(dict.fromkeys(options.density or (20, 100)))
    if min(densities) < 1:
        raise ValueError(f"--density {min(densities)}: it must be 1 or more")
    lines = Lines(extent, options.height, options.spacing, options.speed)
    scans = list(fly(scene, lines, options.seed, options.point_rate, options.lidar))
    flight = flight_of(scans, extent)
    flights = {}
    for density in densities:
        returns = round(density * (x1 - x0) * (y1 - y0))
        flights[str(density)] = thinned(flight, returns, np.random.default_rng([options.seed, density]))
    sensor = lidars.build_pulsed(options.lidar, np.random.default_rng(0), options.point_rate)
    flown = {
        "lidar": options.lidar,
        "height_m": options.height,
        "spacing_m": options.spacing,
        "speed_ms": options.speed,
        "point_rate_hz": options.point_rate,
        "range_noise_m": sensor.noise.range_sigma_m,
    }
    name = options.name or f"{options.scene}-{options.seed}"
    return write(options.out, name, scene, extent, task, flights, **flown)


def _about_home(scene: Scene) -> Extent:
    """Return a square about the scene's start, moved into the scene."""
    x0, y0, x1, y1 = scene.extent_m
    west, south = (
        min(max(round(at) - SIDE_M / 2, low), max(low, high - SIDE_M))
        for at, low, high in zip(scene.home_enu[:2], (x0, y0), (x1, y1), strict=True)
    )
    return west, south, min(west + SIDE_M, x1), min(south + SIDE_M, y1)


if __name__ == "__main__":
    sys.exit(main())
