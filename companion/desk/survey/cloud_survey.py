"""Survey of a cloud in one window, on a map that holds all of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds import cloud_source
from companion.desk.clouds.cloud import GeoreferencedCloud
from companion.desk.survey.cloud_quality import check_steps, coverage_for, density_per_m2, inlier_mask
from companion.desk.survey.local_metres import Metric, metric_for
from companion.runtime.errors import UsageError
from params import Parameters
from slz import Pipeline, Report, TerrainMaps, Window


@dataclass(frozen=True, slots=True)
class CloudSurvey:
    """Result of the pipeline for a cloud."""

    report: Report
    maps: TerrainMaps
    metric: Metric
    parameters: Parameters
    density_per_m2: float
    dropped: dict[str, int]


def survey(cloud: GeoreferencedCloud, parameters: Parameters) -> CloudSurvey:
    """Process a cloud with the pipeline as one window.

    Raises
    ------
    UsageError
        No point is left, they are not on the Earth, or their grid does not fit into memory.
    """
    keep = inlier_mask(cloud.points, cloud.reference.vertical_m)
    points = cloud.points if keep.all() else cloud.points[keep]
    if not len(points):
        raise UsageError("no point is left: all are higher than 20 km; is the vertical unit right?")
    low, high = points.min(axis=0), points.max(axis=0)
    metric = metric_for(cloud.reference, low, high, parameters.cell_m)
    check_steps("the cloud", cloud.scales, (metric.x_m, metric.y_m, metric.z_m), parameters)
    width, height = (float(v) for v in (high - low)[:2] * (metric.x_m, metric.y_m))
    cloud_source.check_cells(width, height, parameters.cell_m, len(points))
    points = metric.local(points)
    density = density_per_m2(points)
    own = _fitted(parameters, density, max(width, height))
    pipeline = Pipeline(own, (0.0, 0.0))
    report = pipeline.process(_window(points, cloud.gps_s, keep, metric))
    maps = pipeline.maps()
    assert maps is not None  # noqa: S101 - outlier removal never removes all points
    dropped = cloud.dropped | {"stray": int((~keep).sum()), "outlier": report.n_points - report.n_used}
    return CloudSurvey(report, maps, metric, own, density, dropped)


def _fitted(parameters: Parameters, density: float, extent_m: float) -> Parameters:
    """Return parameters whose map, ages and memory fit the whole cloud, beyond the table's limits."""
    p = parameters
    halves = math.ceil(extent_m / 2 / p.cell_m) + 3  # the origin is in the middle, within a cell
    own: dict[str, Any] = {
        "zone_m": 2 * halves * p.cell_m,
        "max_age_s": 1e12,
        "memory_mb": 64 + (2 * halves + 128) ** 2 * 64 / 2**20,  # more than is used: all points are kept
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
    """Return all points as one window, in time order where they have finite times."""
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
        sensor_enu_m=np.full(3, np.nan),
        frame=metric.frame,
        start_ns=int(stamp_ns[0]),
        end_ns=int(stamp_ns[-1]),
    )
