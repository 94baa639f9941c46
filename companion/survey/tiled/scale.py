"""How long a unit of the CRS is: known before the points are sorted, or found by sorting them twice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from companion.errors import UsageError
from companion.survey.las import LasSource
from companion.survey.metric import Metric, about
from companion.survey.source import Source
from companion.survey.tiled.census import Census
from companion.survey.tiled.lattice import UNIT_M, Lattice


def first_guess(sources: Sequence[Source], cell_m: float) -> Lattice:
    """Return the lattice of a projected CRS, whose units keep their length; else that of some point."""
    reference = sources[0].reference
    if reference.unit_m is not None:
        return Lattice(reference.unit_m, reference.unit_m, reference.vertical_m, cell_m)
    x, y = _any_point(sources[0])
    corner = np.array([x, y, 0.0])
    metric = about(reference, corner, corner, cell_m)
    return Lattice(metric.x_m, metric.y_m, metric.z_m, cell_m)


def _any_point(source: Source) -> tuple[float, float]:
    if isinstance(source, LasSource) and source.low is not None and source.high is not None:
        return (source.low[0] + source.high[0]) / 2, (source.low[1] + source.high[1]) / 2
    for chunk in source.chunks():
        if len(chunk.points):
            x, y = np.median(chunk.points[:, :2], axis=0).tolist()
            return float(x), float(y)
    raise UsageError(f"{source.path}: none of its points is usable")


def metric_of(source: Source, census: Census, lattice: Lattice) -> Metric:
    """Return the local metres of a survey, as `about` finds them for the cells it covers."""
    box, cell_m = census.box, lattice.cell_m
    z = np.floor(census.lowest * UNIT_M / lattice.z_m)
    low = np.array([box.col0 * cell_m / lattice.x_m, box.row0 * cell_m / lattice.y_m, z])
    high = np.array([box.col1 * cell_m / lattice.x_m, box.row1 * cell_m / lattice.y_m, z])
    return about(source.reference, low, high, cell_m)
