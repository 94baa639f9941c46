"""Length of the CRS's units: known before the points are sorted, or found by sorting them twice."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from companion.desk.clouds.cloud_source import Source
from companion.desk.clouds.crs import Reference
from companion.desk.clouds.las import LasSource
from companion.desk.survey.local_metres import Metric, metric_for
from companion.desk.survey.tiled.census import Census
from companion.desk.survey.tiled.lattice import UNIT_M, Lattice
from companion.runtime.errors import UsageError


def first_guess(sources: Sequence[Source], cell_m: float) -> Lattice:
    """Return the lattice of a projected CRS, whose units have a fixed length; else one scaled at a point."""
    reference = sources[0].reference
    if reference.unit_m is not None:
        return Lattice(reference.unit_m, reference.unit_m, reference.vertical_m, cell_m)
    middle = _middle_of_header(sources[0])
    try:
        metric = None if middle is None else _metric_at(reference, middle, cell_m)
    except UsageError:  # a header's box may be invalid: use the points
        metric = None
    metric = metric or _metric_at(reference, _any_point(sources[0]), cell_m)
    return Lattice(metric.x_m, metric.y_m, metric.z_m, cell_m)


def _metric_at(reference: Reference, place: tuple[float, float], cell_m: float) -> Metric:
    corner = np.array([*place, 0.0])
    return metric_for(reference, corner, corner, cell_m)


def _middle_of_header(source: Source) -> tuple[float, float] | None:
    """Return the centre of the header's bounding box, if it has a finite one."""
    if not isinstance(source, LasSource) or source.low is None or source.high is None:
        return None
    x, y = (source.low[0] + source.high[0]) / 2, (source.low[1] + source.high[1]) / 2
    return (x, y) if math.isfinite(x) and math.isfinite(y) else None


def _any_point(source: Source) -> tuple[float, float]:
    for chunk in source.chunks():
        if len(chunk.points):
            x, y = np.median(chunk.points[:, :2], axis=0).tolist()
            return float(x), float(y)
    raise UsageError(f"{source.path}: none of its points is usable")


def metric_of(source: Source, census: Census, lattice: Lattice) -> Metric:
    """Return the local metres of a survey, as `metric_for` finds them for the cells it covers."""
    box, cell_m = census.box, lattice.cell_m
    z = np.floor(census.lowest * UNIT_M / lattice.z_m)
    low = np.array([box.col0 * cell_m / lattice.x_m, box.row0 * cell_m / lattice.y_m, z])
    high = np.array([box.col1 * cell_m / lattice.x_m, box.row1 * cell_m / lattice.y_m, z])
    return metric_for(source.reference, low, high, cell_m)
