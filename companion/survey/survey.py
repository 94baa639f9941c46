"""A survey of stored clouds: from files to zones, maps and pictures."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion import figures
from companion.errors import UsageError
from companion.survey import memory, raster, zones
from companion.survey.cloud import Cloud, read
from companion.survey.density import coverage_for, density_per_m2
from companion.survey.metric import Metric, about
from companion.survey.stray import near
from params import Parameters
from slz import SAFE, UNKNOWN, UNSAFE, Pipeline, Report, TerrainMaps, Window

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Survey:
    """What the pipeline made of a cloud."""

    report: Report
    maps: TerrainMaps
    metric: Metric
    parameters: Parameters
    density_per_m2: float
    dropped: dict[str, int]


def run(
    files: Sequence[Path], out: Path, parameters: Parameters, progress: Progress, crs: str | None = None
) -> dict[str, Any]:
    """Survey clouds, write zones.geojson, the GeoTIFF and the pictures, and return the summary for JSON.

    Parameters
    ----------
    files
        LAS or LAZ files of one CRS.
    out
        Folder, made where there is none.
    parameters
        `coverage_m` and `max_zones` follow the cloud where nobody set them.
    progress
        Called with what is done next and the share that is done.
    crs
        Overrides the CRS of the files.

    Raises
    ------
    UsageError
        A file, the CRS, the folder or the size of the grid cannot be used.
    """
    started = time.perf_counter()
    _make(out)
    progress("reading", 0.0)
    cloud = read(files, crs, lambda share: progress("reading", 0.5 * share))
    progress("mapping", 0.5)
    found = survey(cloud, parameters)
    progress("writing", 0.65)
    described = zones.rows(found.report.zones, found.maps, found.metric)
    try:
        outputs = raster.write(out, found.maps, found.metric, found.parameters.mode == "source")
        outputs.append(out / "zones.geojson")
        zones.write_geojson(outputs[-1], found.report.zones, described, found.maps, found.metric)
        progress("drawing", 0.8)
        outputs += figures.save_maps(out, found.maps, found.report.zones, found.parameters)
    except OSError as error:
        raise UsageError(f"--out {out}: cannot be written: {error}") from None
    progress("done", 1.0)
    return _summary(files, cloud, found, described, outputs) | {
        "seconds": round(time.perf_counter() - started, 3)
    }


def survey(cloud: Cloud, parameters: Parameters) -> Survey:
    """Feed a cloud to the pipeline as one window.

    Raises
    ------
    UsageError
        No point is left, they are not on the Earth, or their grid does not fit into memory.
    """
    keep = near(cloud.points, cloud.reference.vertical_m)
    points = cloud.points if keep.all() else cloud.points[keep]
    if not len(points):
        raise UsageError("no point is left: all are higher than 20 km; is the vertical unit right?")
    low, high = points.min(axis=0), points.max(axis=0)
    metric = about(cloud.reference, low, high, parameters.cell_m)
    width, height = (float(v) for v in (high - low)[:2] * (metric.x_m, metric.y_m))
    memory.check_cells(width, height, parameters.cell_m, len(points))
    points = metric.local(points)
    density = density_per_m2(points)
    own = _fitted(parameters, density, max(width, height))
    pipeline = Pipeline(own, (0.0, 0.0))
    report = pipeline.process(_window(points, cloud.gps_s, keep, metric))
    maps = pipeline.maps()
    if maps is None:
        raise UsageError("no point is left after the outlier filter")
    dropped = cloud.dropped | {"stray": int((~keep).sum()), "outlier": report.n_points - report.n_used}
    return Survey(report, maps, metric, own, density, dropped)


def _fitted(parameters: Parameters, density: float, extent_m: float) -> Parameters:
    """Return parameters whose map, range and ages hold the whole cloud, beyond the table's limits."""
    p = parameters
    halves = math.ceil(extent_m / 2 / p.cell_m) + 3  # the origin is half a cloud from either edge, to a cell
    own: dict[str, Any] = {
        "zone_m": 2 * halves * p.cell_m,
        "max_range_m": 2 * halves * p.cell_m,
        "max_age_s": 1e12,
    }
    if "coverage_m" not in p.model_fields_set:
        own["coverage_m"] = coverage_for(density, p.cell_m, p.coverage_m, p.min_square_m)
    if "max_zones" not in p.model_fields_set:
        own["max_zones"] = 10_000
    return p.model_copy(update=own)


def _window(
    points_m: NDArray[np.float64],
    gps_s: NDArray[np.float64] | None,
    keep: NDArray[np.bool_],
    metric: Metric,
) -> Window:
    """Return all points as one window, in the order of their time where they have one."""
    stamp_ns = np.arange(len(points_m), dtype=np.int64) * 1000
    if gps_s is not None:
        time_s = gps_s[keep]
        if np.isfinite(time_s).all() and np.ptp(time_s) < 1e9:
            order = np.argsort(time_s, kind="stable")
            points_m, time_s = points_m[order], time_s[order]
            stamp_ns = np.rint((time_s - time_s[0]) * 1e9).astype(np.int64)
    return Window(
        points_enu_m=points_m,
        stamp_ns=stamp_ns,
        sensor_enu_m=np.zeros(3),
        frame=metric.frame,
        start_ns=int(stamp_ns[0]),
        end_ns=int(stamp_ns[-1]),
    )


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"--out {out}: this folder cannot be made: {error.strerror}") from None


def _summary(
    files: Sequence[Path], cloud: Cloud, found: Survey, described: list[dict[str, Any]], outputs: list[Path]
) -> dict[str, Any]:
    state, grid = found.maps.state, found.maps.grid
    rows, cols = state.shape
    reference = cloud.reference
    return {
        "files": [str(path) for path in files],
        "crs": reference.name,
        "unit_m": reference.unit_m,
        "vertical_unit_m": reference.vertical_m,
        "vertical_unit_from": reference.vertical_from,
        "wgs84_error_m": found.metric.wgs84_error_m,
        "points": {
            "read": cloud.n_read,
            "used": found.report.n_used,
            "dropped": {name: count for name, count in found.dropped.items() if count},
            "per_m2": round(found.density_per_m2, 3),
        },
        "cells": {
            "cell_m": grid.cell_m,
            "rows": rows,
            "cols": cols,
            "safe": int((state == SAFE).sum()),
            "unsafe": int((state == UNSAFE).sum()),
            "unknown": int((state == UNKNOWN).sum()),
        },
        "coverage_m": found.parameters.coverage_m,
        "zones": described,
        "outputs": [str(path) for path in outputs],
        "warnings": _warnings(found),
        "stage_ms": {name: round(ms, 1) for name, ms in found.report.stage_ms.items()},
    }


def _warnings(found: Survey) -> list[str]:
    """Say what the user must know before he trusts the zones."""
    own, warnings = found.parameters, []
    default = Parameters.model_fields["coverage_m"].default
    if own.coverage_m > default:
        warnings.append(
            f"{found.density_per_m2:.1f} points/m2: gaps of up to {own.coverage_m:g} m count as seen,"
            " so a narrower hazard may have no return"
        )
    if not (found.maps.state != UNKNOWN).any():
        warnings.append(
            f"{found.density_per_m2:.1f} points/m2 cover no ground without gaps of {own.coverage_m:g} m:"
            " try a larger --cell-m or --set coverage_m"
        )
    if found.dropped.get("stray"):
        warnings.append(f"{found.dropped['stray']} points lie far from all others and were dropped")
    return warnings
