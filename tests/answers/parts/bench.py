"""Zones of `slz bench` on all workloads, in both modes."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.answers.program import slz
from tests.answers.recorder import Recorder
from tests.answers.shared import SHARED, absent

GENERATOR = SHARED / "bench" / "gen.py"
LEAST_BOUNDARY = 200
ALL_WINDOWS = 60


@dataclass(frozen=True)
class Workload:
    """One workload: the map, options of the generator, and windows of 1 s unless all 60 are recorded."""

    cell_m: float
    zone_m: float
    min_square_m: float
    windows: int
    options: tuple[str, ...]


WORKLOADS = {
    "a": Workload(1.0, 5000.0, 24.0, 60, ("--rate", "20000")),
    "b": Workload(0.2, 500.0, 2.0, 60, ("--rate", "200000")),
    "c": Workload(0.2, 1000.0, 2.0, 6, ("--rate", "1000000")),
    "d": Workload(0.1, 300.0, 2.0, 6, ("--rate", "1000000", "--half", "100")),
    "e": Workload(0.1, 300.0, 2.0, 6, ("--rate", "1000000", "--half", "100", "--noise", "0.005")),
}
SCANS = ("disk", "line")
MODES = ("default", "source")


def record(recorder: Recorder) -> None:
    """Record the zones after the last window of each workload and mode, and the digest of its points."""
    if line := absent(GENERATOR):
        recorder.skip(line)
        return
    for name, workload in WORKLOADS.items():
        for scan in SCANS:
            points = recorder.work / f"{name}_{scan}.bin"
            _generate(points, workload, scan, recorder)
            with points.open("rb") as file:
                recorder.add(f"{name}_{scan}/points", hashlib.file_digest(file, "sha256").hexdigest())
            for mode in MODES:
                recorder.add(f"{name}_{scan}/{mode}", slz(_arguments(points, workload, mode), recorder.work))
            points.unlink()


def _generate(points: Path, workload: Workload, scan: str, recorder: Recorder) -> None:
    windows = ALL_WINDOWS if recorder.full else workload.windows
    command = [sys.executable, str(GENERATOR), str(points), *workload.options, "--scan", scan]
    cache = os.environ | {"NUMBA_CACHE_DIR": str(recorder.work / "numba")}
    subprocess.run([*command, "--windows", str(windows)], env=cache, stdout=subprocess.DEVNULL, check=True)


def _arguments(points: Path, workload: Workload, mode: str) -> list[str]:
    options = {
        "points": points,
        "cell-m": workload.cell_m,
        "zone-m": workload.zone_m,
        "min-square-m": workload.min_square_m,
        "min-boundary": LEAST_BOUNDARY,
        "mode": mode,
    }
    return ["bench", *(text for name, value in options.items() for text in (f"--{name}", str(value)))]
