"""Comparison of `slz bench` with the C++ baseline, in times and zones, run in turn and pinned to one core.

python -m tests.bench.compare --baseline baseline.cpp --generator gen.py --work DIR [--configs abcde]
    [--scans disk,line] [--mode source|default] [--rounds 3] [--core 1] [--windows 60] [--cpu]
    [--opencv opencv_pipeline.py --opencv-python PYTHON]

The baselines and the workload generator are given by path; they are not part of this repository. Ratios are
of median window times, without the work of `slz` between windows. Each round runs the baseline, `slz
bench`, the baseline over changed cells, and the OpenCV pipeline on one thread, in wall-clock time.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CONFIGS = {  # cell m, zone m, square m, what the generator is told
    "a": (1.0, 5000.0, 24.0, ["--rate", "20000"]),
    "b": (0.2, 500.0, 2.0, ["--rate", "200000"]),
    "c": (0.2, 1000.0, 2.0, ["--rate", "1000000"]),
    "d": (0.1, 300.0, 2.0, ["--rate", "1000000", "--half", "100"]),
    "e": (0.1, 300.0, 2.0, ["--rate", "1000000", "--half", "100", "--noise", "0.005"]),
}
LEAST_BOUNDARY = 200
AREA_TOLERANCE = 1e-3
OPENCV_WINDOWS = 15
# The baseline's clock is that of the wall; this one counts only the time that its thread had the core.
CPU_CLOCK = """
#include <chrono>
#include <ctime>
struct cpu_clock { static std::chrono::nanoseconds now_() {
    timespec t; clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec); }
  struct point { std::chrono::nanoseconds d;
    std::chrono::nanoseconds time_since_epoch() const { return d; } };
  static point now() { return {now_()}; } };
namespace std { namespace chrono { using cpu_clock = ::cpu_clock; } }
#define steady_clock cpu_clock
"""


@dataclass(frozen=True)
class Run:
    """Times of one program: median, 99th percentile and greatest, and between windows, and its zones."""

    median: float
    p99: float
    most: float
    zones: list[dict[str, Any]]
    rss_mb: float = 0.0
    between: float = 0.0


def compiled(source: Path, work: Path, cpu: bool) -> Path:
    """Return the baseline's program, with its clock counting the thread's time when asked."""
    out, clock = work / ("baseline_cpu" if cpu else "baseline"), work / "cpu_clock.hpp"
    clock.write_text(CPU_CLOCK)
    flags = ["-include", str(clock)] if cpu else []
    command = ["g++", "-O3", "-march=native", "-std=c++17", *flags, str(source), "-o", str(out)]
    subprocess.run(command, check=True)
    return out


def workload(generator: Path, work: Path, config: str, scan: str, windows: int) -> Path:
    """Return the file of a workload, generated when it is not there."""
    out = work / f"{config}_{scan}.bin"
    if not out.exists():
        own = [*CONFIGS[config][3], "--scan", scan, "--windows", str(windows)]
        cache = os.environ | {"NUMBA_CACHE_DIR": str(work / "numba")}
        subprocess.run([sys.executable, str(generator), str(out), *own], check=True, env=cache)
    return out


def baseline(program: Path, points: Path, config: str, core: int, *flags: str) -> Run:
    cell, zone, square, _ = CONFIGS[config]
    numbers = [str(v) for v in (cell, zone, square, LEAST_BOUNDARY)]
    command = ["taskset", "-c", str(core), str(program), str(points), *numbers, "--quiet", *flags]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    summary = json.loads(said[0])["summary"]
    zones = [json.loads(line)["slz"] for line in said[1:]]
    return Run(summary["median_ms"], summary["p99_ms"], summary["max_ms"], zones)


def ours(points: Path, config: str, core: int, mode: str, windows: int, cpu: bool) -> Run:
    cell, zone, square, _ = CONFIGS[config]
    own = [
        "--points",
        str(points),
        "--cell-m",
        str(cell),
        "--zone-m",
        str(zone),
        "--min-square-m",
        str(square),
    ]
    own += ["--min-boundary", str(LEAST_BOUNDARY), "--mode", mode, "--windows", str(windows), "--json"]
    command = ["taskset", "-c", str(core), sys.executable, "-m", "companion.cli", "bench", *own]
    said = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    ms, between_ms = said["cpu_ms" if cpu else "ms"], said["between_ms"]["median"]
    return Run(ms["median"], ms["p99"], ms["max"], said["zones"], said["rss_mb"], between_ms)


def opencv(args: argparse.Namespace, points: Path, config: str) -> float:
    """Return the median window (ms) of the pipeline made with OpenCV; NaN where none is given."""
    if args.opencv is None:
        return math.nan
    cell, zone, square, _ = CONFIGS[config]
    numbers = [str(v) for v in (cell, zone, square, LEAST_BOUNDARY)]
    own = ["--quiet", "--maxwin", str(min(args.windows, OPENCV_WINDOWS))]
    command = [
        "taskset",
        "-c",
        str(args.core),
        args.opencv_python,
        str(args.opencv),
        str(points),
        *numbers,
        *own,
    ]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    summary = json.loads(next(line for line in said.splitlines() if "median_ms" in line))
    return float(summary.get("summary", summary)["median_ms"])


def same_zones(mine: list[dict[str, Any]], theirs: list[dict[str, Any]]) -> bool:
    """Tell whether two lists hold as many zones, of the same areas within the tolerance."""
    return len(mine) == len(theirs) and all(
        abs(a["area_m2"] - b["area_m2"]) <= AREA_TOLERANCE * b["area_m2"]
        for a, b in zip(mine, theirs, strict=True)
    )


def compare(config: str, scan: str, program: Path, points: Path, args: argparse.Namespace) -> bool:
    rounds, by_opencv = [], []
    for _ in range(args.rounds):
        plain = baseline(program, points, config, args.core, "--maxwin", str(args.windows))
        mine = ours(points, config, args.core, args.mode, args.windows, args.cpu)
        touched = baseline(program, points, config, args.core, "--touched", "--maxwin", str(args.windows))
        rounds.append((plain, touched, mine))
        by_opencv.append(opencv(args, points, config))
    ratio, ratio_touched = (statistics.median(r[k].median / r[2].median for r in rounds) for k in (0, 1))
    plain, touched, mine = sorted(rounds, key=lambda r: r[2].median)[len(rounds) // 2]
    same = args.mode != "source" or all(same_zones(r[2].zones, r[0].zones) for r in rounds)
    print(
        f"| {config} {scan} | {plain.median:.2f} | {touched.median:.2f} | {mine.median:.3f} | "
        f"{mine.between:.2f} | {mine.p99:.2f} ({mine.p99 / mine.median:.1f}x) | "
        f"{mine.most:.2f} ({mine.most / mine.median:.1f}x) | "
        f"{ratio:.1f} | {ratio_touched:.1f} | {len(mine.zones)} {'same' if same else 'DIFFERENT'} | "
        f"{mine.rss_mb:.0f} | {statistics.median(by_opencv):.0f} |",
        flush=True,
    )
    return same


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--baseline", type=Path, required=True)
    parser.add_argument("--generator", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--configs", default="abcde")
    parser.add_argument("--scans", default="disk,line")
    parser.add_argument("--mode", default="source")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--core", type=int, default=1)
    parser.add_argument("--windows", type=int, default=60)
    parser.add_argument("--cpu", action="store_true", help="time of the thread instead of the wall's")
    parser.add_argument("--opencv", type=Path, help="the pipeline made with OpenCV")
    parser.add_argument("--opencv-python", default=sys.executable, help="a Python that has OpenCV")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    program = compiled(args.baseline, args.work, args.cpu)
    print(
        "| config | C++ ms | touched ms | slz ms | between | p99 | max | x C++ | x touched | zones | MB |"
        " OpenCV ms |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    good = True
    for config in args.configs:
        for scan in args.scans.split(","):
            points = workload(args.generator, args.work, config, scan, args.windows)
            good &= compare(config, scan, program, points, args)
    sys.exit(0 if good else "zones differ")


if __name__ == "__main__":
    main()
