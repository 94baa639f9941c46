"""Census of all points: extent of the survey, trusted heights, and counts.

Everything is counted in whole numbers, so the result does not depend on the order of the pieces.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.cloud_source import Source
from companion.desk.clouds.crs import Reference
from companion.desk.clouds.las import LasSource
from companion.desk.survey.cloud_quality import CORE, REACH
from companion.desk.survey.local_metres import Metric, metric_for
from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.lattice import UNIT_M, Lattice
from companion.runtime.errors import UsageError
from slz import Box
from slz.kernels.points.histogram import ends_of

GAP_BINS = 4  # bins of height per empty gap
MOST_OUTLIERS = 0.002  # share of the points at either end, see `slz.points.outliers.gap_interval`
EVERYTHING = (-(2**31), 2**31 - 1)
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Census:
    """Totals over all points, known before any map is derived.

    box: cells of the survey, without strays. interval: lowest and highest trusted height, in `UNIT_M`;
    points outside it count only in groups. lowest: the lowest height of all. n_read, dropped: as in
    `Chunk`.
    """

    box: Box
    interval: tuple[int, int]
    lowest: int
    n_read: int
    dropped: dict[str, int]


def count_points(paths: Iterable[Path], bin_m: float) -> Census:
    """Return the census of sorted files; at least one must hold points."""
    rows, cols, bins = (_Tally() for _ in range(3))
    dropped: Counter[str] = Counter()
    n_read, low, high = 0, EVERYTHING[1], EVERYTHING[0]
    for path in paths:
        arrays, notes = array_file.read(path)
        n_read += int(notes["n_read"])
        dropped.update(notes["dropped"])
        for tally, name in ((rows, "rows"), (cols, "cols"), (bins, "bins")):
            tally.add(arrays[name])
        if len(arrays["low"]):
            low, high = min(low, int(arrays["low"].min())), max(high, int(arrays["high"].max()))
    (row0, row1), (col0, col1) = _reach(rows.table()), _reach(cols.table())
    interval = _interval(bins.table(), bin_m / UNIT_M, low, high)
    return Census(Box(row0, row1, col0, col1), interval, low, n_read, dict(dropped))


class _Tally:
    """Sum of counts by number."""

    def __init__(self) -> None:
        self.count: Counter[int] = Counter()

    def add(self, listed: Ints) -> None:
        for number, count in listed.tolist():
            self.count[number] += count

    def table(self) -> Ints:
        """Return (n, 2) numbers in their order, and counts."""
        return np.array(sorted(self.count.items()), np.int64)


def _reach(lines: Ints) -> tuple[int, int]:
    """Return the first line and the one after the last without strays, see `cloud_quality`."""
    number, count = lines.T
    below = np.cumsum(count)
    median = number[np.searchsorted(below, (below[-1] + 1) // 2)]
    distance = np.abs(number - median)
    order = np.argsort(distance, kind="stable")
    below = np.cumsum(count[order])
    reach = distance[order][np.searchsorted(below, int(np.floor(CORE * (below[-1] - 1))) + 1)]
    if reach > 0:
        number = number[distance <= REACH * reach]
    return int(number[0]), int(number[-1]) + 1


def _interval(bins: Ints, units: float, low: int, high: int) -> tuple[int, int]:
    """Return the trusted heights by the rule of `slz.points.outliers.gap_interval`, in bins from zero."""
    number, count = bins.T
    dense = np.zeros(number[-1] - number[0] + 1, np.int64)
    dense[number - number[0]] = count
    first, last = ends_of(dense, int(MOST_OUTLIERS * count.sum()), GAP_BINS)
    return (
        low if first <= 0 else int(np.ceil((number[0] + first) * units)),
        high if last >= len(dense) - 1 else int(np.floor((number[0] + last + 1) * units)),
    )


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
