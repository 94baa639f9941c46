"""Benchmark of the pipeline: time per window over a file of points (`slz bench`)."""

from __future__ import annotations

import gc
import resource
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import params
from companion.runtime.errors import UsageError
from companion.runtime.process_tuning import keep_memory
from slz import LocalFrame, Pipeline, Report, Window
from slz.terrain.terrain import Tally
from slz.warm_up import warm_up

FIELDS = 4  # t (s), x, y, z (m), little-endian float64
SAFE_SLOPE_DEG, WORST_SLOPE_DEG = 4.0, 40.0  # SLZ paper, Table 4
FRAME = LocalFrame(45.0, -75.0, 0.0)
NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True, slots=True)
class Case:
    """Benchmark case: file of points, map size and cells, zone criteria, mode and number of windows."""

    points: Path
    cell_m: float
    zone_m: float
    min_square_m: float
    min_boundary: int
    mode: str
    windows: int | None = None

    def parameters(self) -> params.Parameters:
        """Return the parameters; in source mode those of SLZ paper, Table 4."""
        if self.mode not in ("source", "default"):
            raise UsageError(f"--mode {self.mode!r}: use source or default")
        own = {
            "mode": self.mode,
            "cell_m": self.cell_m,
            "zone_m": self.zone_m,
            "min_square_m": self.min_square_m,
            "min_boundary_points": self.min_boundary,
            "max_zones": 10_000,
        }
        if self.mode == "source":
            own |= {
                "safe_slope_deg": SAFE_SLOPE_DEG,
                "worst_slope_deg": WORST_SLOPE_DEG,
                "repeat_depth": 100_000,
            }
        return params.load("quadcopter", [f"{name}={value}" for name, value in own.items()])


def run(case: Case) -> dict[str, Any]:
    """Warm up, process every window, and return times (ms), zones and memory.

    A window's time is that of `Pipeline.process`, from points to the report. `between_ms` is the time of
    `Pipeline.prepare`, which runs between windows, as in flight. The map is fixed about (0, 0); points
    outside it are ignored. The allocator keeps freed memory, as in flight.
    """
    keep_memory()
    parameters = case.parameters()
    records = _records(case.points)
    warm_up(parameters)
    pipeline = Pipeline(parameters, (0.0, 0.0), follow=False)
    wall_ms, cpu_ms, between_ms, stages, tallies, n_points = [], [], [], [], [], 0
    report: Report | None = None
    gc.collect()
    gc.freeze()
    for window in _windows(records, case.windows):
        cpu, start = time.thread_time(), time.perf_counter()
        report = pipeline.process(window)
        wall_ms.append((time.perf_counter() - start) * 1e3)
        cpu_ms.append((time.thread_time() - cpu) * 1e3)
        stages.append(report.stage_ms)
        tallies.append(pipeline.tally)
        n_points += len(window)
        cpu = time.thread_time()
        pipeline.prepare()
        between_ms.append((time.thread_time() - cpu) * 1e3)
    gc.unfreeze()
    if report is None:
        raise UsageError(f"{case.points} holds no points")
    return {
        "windows": len(wall_ms),
        "points": n_points,
        "ms": _spread(wall_ms),
        "cpu_ms": _spread(cpu_ms),
        "between_ms": _spread(between_ms),
        "window_ms": [round(ms, 4) for ms in wall_ms],
        "stage_ms": {name: round(float(np.median([s[name] for s in stages])), 4) for name in stages[0]},
        **_cells(tallies),
        "points_per_s": round(n_points / (sum(wall_ms) * 1e-3)),
        "zones": _zones(report),
        "rss_mb": round(_rss_mb(), 1),
    }


def _cells(tallies: list[Tally | None]) -> dict[str, dict[str, int]]:
    """Return the medians of the cells hit, derived and changed a window; nothing in source mode."""
    counted = [tally for tally in tallies if tally is not None]
    if not counted:
        return {}
    names = [field.name for field in fields(Tally)]
    return {"cells": {name: int(np.median([getattr(tally, name) for tally in counted])) for name in names}}


def _records(path: Path) -> NDArray[np.float64]:
    """Map the file into memory; (n, 4)."""
    try:
        size = path.stat().st_size
        if size == 0 or size % (8 * FIELDS):
            raise UsageError(f"{path} is no file of little-endian float64 t, x, y, z: it has {size} bytes")
        records = np.memmap(path, dtype="<f8", mode="r").reshape(-1, FIELDS)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    first, last = float(records[0, 0]), float(records[-1, 0])
    if not (np.isfinite([first, last]).all() and first <= last):
        raise UsageError(f"{path}: times run from {first} to {last} s, they must rise")
    return np.asarray(records)


def _windows(records: NDArray[np.float64], most: int | None) -> Iterator[Window]:
    """Yield windows of 1 s of t, each with its own copy of the points."""
    start, count = 0, 0
    stamps = records[:, 0]
    while start < len(records) and (most is None or count < most):
        end_s = np.floor(stamps[start]) + 1.0
        stop = start + _length(stamps[start:], end_s)
        points = np.ascontiguousarray(records[start:stop, 1:])
        points.setflags(write=False)
        stamp_ns = (stamps[start:stop] * 1e9).astype(np.int64)
        yield Window(points, stamp_ns, NOWHERE, FRAME, int(stamp_ns[0]), int(stamp_ns[-1]))
        start, count = stop, count + 1


def _length(stamps: NDArray[np.float64], end_s: float) -> int:
    """Return the number of leading stamps before a time, at least one."""
    step = 1_000_000
    for first in range(0, len(stamps), step):
        later = stamps[first : first + step] >= end_s
        if later.any():
            return max(1, first + int(np.argmax(later)))
    return len(stamps)


def _spread(ms: list[float]) -> dict[str, float]:
    low, high, most = np.percentile(ms, [50, 99, 100])
    return {"median": round(float(low), 4), "p99": round(float(high), 4), "max": round(float(most), 4)}


def _zones(report: Report) -> list[dict[str, Any]]:
    return [
        {
            "id": zone.id,
            "area_m2": round(zone.area_m2, 2),
            "certainty": round(zone.certainty, 4),
            "n_boundary": len(zone.boundary_cells),
            "n_filtered": len(zone.corners_enu_m),
            "safe": zone.n_safe,
            "unsafe": zone.n_unsafe,
            "uncertain": zone.n_uncertain,
        }
        for zone in sorted(report.near.zones, key=lambda zone: zone.id)
    ]


def _rss_mb() -> float:
    """Return the resident memory (MB) without mapped files; where /proc has none, the peak."""
    try:
        status = Path("/proc/self/status").read_text()
        return int(status.split("RssAnon:")[1].split()[0]) / 2**10
    except (OSError, IndexError):
        unit = 2**20 if sys.platform == "darwin" else 2**10
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
