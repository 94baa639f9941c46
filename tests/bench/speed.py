"""All speeds in one table, with commit, date and load of the machine: `make bench`, docs/benchmark/speed.md.

python -m tests.bench.speed [--out PAGE] [--work DIR] [--only NAME] [--first-start]
    [--baseline baseline.cpp --generator gen.py]

Processor time, so that other programs matter little; five minutes on an idle machine. The workloads of the
ten loads and their C++ baseline are given by path; they are not part of this repository. `--first-start`
compiles all kernels in an empty cache, two minutes more.
"""

from __future__ import annotations

import argparse
import cProfile
import itertools
import json
import os
import pstats
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

import params
from companion.desk.open_benchmark import scan_simulation
from companion.desk.reproduce.survey_recording import SurveyFlight, SurveyRecording, fly
from companion.runtime import kernel_compilation
from slz import Pipeline, join
from tests import REPOSITORY
from tests.bench.compare import CONFIGS, baseline, compiled, ours, workload

PAGE = REPOSITORY / "docs" / "benchmark" / "speed.md"
SURVEY = SurveyFlight("stadium", (-60, -50, 60, 50), point_rate_hz=200_000, surface=True)
WINDOWS = {
    "1 s": (10, slice(0, 200)),
    "0.1 s": (1, slice(300, 700)),
}  # scans of 0.1 s a window, and which windows
LOAD_WINDOWS = 20
WORLD_PULSES_PER_M2 = 100
SAMPLE_S = 0.2
Row = tuple[str, str, str]  # figure, value, unit


def survey_rows(work: Path) -> Iterator[Row]:
    """Yield costs of the pipeline on a flown survey with surface signals, on one thread."""
    recording = fly(SURVEY, work)
    costs = [_costs(recording, n_scans, which) for n_scans, which in WINDOWS.values()]
    for (name, unit), values in costs[0].items():
        both = values, *(other.get((name, unit), "-") for other in costs[1:])
        yield f"survey: {name}", " / ".join(both), unit


def _costs(recording: SurveyRecording, n_scans: int, which: slice) -> dict[tuple[str, str], str]:
    """Return the costs of windows of so many scans by name and unit."""
    pipeline, scans = Pipeline(params.load("quadcopter"), threads=1), recording.scans()
    stages, cpu, calls, returns = defaultdict[str, list[float]](list), list[float](), list[int](), list[int]()
    for number in range(which.stop):
        part = [scan for scan in itertools.islice(scans, n_scans) if len(scan) or scan.attributes is not None]
        if number < which.start or not any(len(scan) for scan in part):
            continue
        window, start = join(part), time.process_time()
        if number % 10 == 9:  # counted, not timed
            profile = cProfile.Profile()
            profile.runcall(pipeline.process, window)
            calls.append(pstats.Stats(profile).total_calls)  # type: ignore[attr-defined]
        else:
            report = pipeline.process(window)
            cpu.append((time.process_time() - start) * 1e3)
            returns.append(len(window))
            for name, ms in report.stage_ms.items():
                stages[name].append(ms)
        pipeline.prepare()
    by_cost = sorted(stages, key=lambda name: -float(np.median(stages[name])))
    return {
        ("returns", "a window"): f"{np.median(returns):,.0f}",
        ("processor time, median", "ms"): f"{np.median(cpu):.1f}",
        ("processor time, p99", "ms"): f"{np.percentile(cpu, 99):.1f}",
        ("calls from Python", "a window"): f"{np.median(calls):,.0f}",
        **{(f"stage {name}", "ms"): f"{np.median(stages[name]):.1f}" for name in by_cost},
    }


def load_rows(work: Path, cpp: Path | None, generator: Path | None) -> Iterator[Row]:
    """Yield the processor time of a window of each load beside that of the C++ baseline."""
    if generator is None:
        yield "ten loads", "-", "not run: their generator was not given (GENERATOR=, BASELINE=)"
        return
    reason = (
        "no C++ baseline was given" if cpp is None else "no g++ here" if shutil.which("g++") is None else ""
    )
    program = None if cpp is None or reason else compiled(cpp, work, cpu=True)
    core = max(os.sched_getaffinity(0))
    for config, scan in itertools.product(CONFIGS, ("disk", "line")):
        points = workload(generator, work, config, scan, LOAD_WINDOWS)
        mine = ours(points, config, core, "default", LOAD_WINDOWS, cpu=True)
        if program is None:
            yield f"load {config} {scan}", f"{mine.median:.1f}", f"ms; {reason}"
            continue
        plain = baseline(program, points, config, core, "--maxwin", str(LOAD_WINDOWS))
        ratio = plain.median / mine.median
        yield f"load {config} {scan}", f"{mine.median:.1f}", f"ms; {ratio:.2f} × C++"


def world_rows(work: Path) -> Iterator[Row]:
    """Yield the processor time of a window of the worlds of `slz benchmark`."""
    out = work / "worlds"
    pulses = str(WORLD_PULSES_PER_M2)
    _slz("benchmark", "--out", str(out), "--method", "slz (this project)", "--density", pulses, "--json")
    (method,) = json.loads((out / "results.json").read_text("utf-8"))["methods"]
    ms = next(iter(method["groups"].values()))["ms"] / scan_simulation.WINDOWS
    yield f"worlds, {pulses} pulses/m²: window", f"{ms:.1f}", "ms"


def demo_rows(work: Path) -> Iterator[Row]:
    """Yield age of ground truth, processor time and peak memory of a demonstration, by process."""
    command = [sys.executable, "-m", "companion.cli", "demo", "--headless", "--speedup", "1", "--json"]
    command += ["--out", str(work / "demo")]
    with (
        (work / "demo.log").open("w") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as demo,
    ):
        cpu, peak = dict[str, float](), dict[str, float]()
        while demo.poll() is None:
            for name, pid in (("slz", demo.pid), *(("simulator", child) for child in _children(demo.pid))):
                cpu[name], peak[name] = _usage(pid, (cpu.get(name, 0.0), peak.get(name, 0.0)))
            time.sleep(SAMPLE_S)
        assert demo.stdout is not None
        summary = json.loads(demo.stdout.read())
    age, flown = summary["latency_ms"], f"{summary['simulated_s']:.0f} s flown"
    yield "demo, real time: age of ground truth, p50 (p99)", f"{age['p50']:.0f} ({age['p99']:.0f})", "ms"
    for name in cpu:
        yield f"demo, {flown}: processor time of {name}", f"{cpu[name]:.0f}", "s"
        yield f"demo: peak memory of {name}", f"{peak[name]:.0f}", "MB"


def _children(pid: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def _usage(pid: int, before: tuple[float, float]) -> tuple[float, float]:
    """Return processor time (s) and peak memory (MB) of a process, those of before if it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        peak = Path(f"/proc/{pid}/status").read_text().partition("VmHWM:")[2].split()
        ticks = int(fields[11]) + int(fields[12])
        return ticks / os.sysconf("SC_CLK_TCK"), int(peak[0]) / 1024
    except (OSError, IndexError):
        return before


def start_rows(first: bool) -> Iterator[Row]:
    """Yield kernels and processor time of a warm start, and of a first one."""
    for command, needs in (
        ("a flight", kernel_compilation.of_flight()),
        ("slz map", kernel_compilation.of_survey()),
    ):
        yield f"kernels of {command}", str(sum(map(len, needs.values()))), ""
    ready = "import companion.flight.app, params, slz.warm_up as w; w.warm_up(params.Parameters())"
    _run([sys.executable, "-c", ready])  # the cache is filled
    yield "warm start, to ready: processor time", f"{_cpu_s([sys.executable, '-c', ready]):.1f}", "s"
    if not first:
        return
    for command in ("flight", "survey"):
        with tempfile.TemporaryDirectory() as cache:
            compiling = (
                "from companion.runtime import kernel_compilation as k;"
                f" k.compile_kernels(lambda *_: None, k.of_{command}())"
            )
            start = time.perf_counter()
            cpu = _cpu_s([sys.executable, "-c", compiling], NUMBA_CACHE_DIR=cache)
            wall = time.perf_counter() - start
        yield f"first start, {command}: processor time (wall time)", f"{cpu:.0f} ({wall:.0f})", "s"


def _slz(*options: str) -> None:
    _run([sys.executable, "-m", "companion.cli", *options])


def _run(command: list[str], **environment: str) -> None:
    subprocess.run(
        command, check=True, stdout=subprocess.DEVNULL, env=os.environ | environment, cwd=REPOSITORY
    )


def _cpu_s(command: list[str], **environment: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _run(command, **environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def page(rows: list[Row], commit: str, load: tuple[float, float]) -> str:
    """Return the page of a table."""
    lines = [
        "# Speed",
        "",
        "```",
        "make bench             # for the ten loads: BASELINE=baseline.cpp GENERATOR=gen.py",
        "```",
        "",
        f"Commit `{commit}`, {datetime.now(UTC):%Y-%m-%d}. {os.cpu_count()} cores; load average"
        f" {load[0]:.1f} before and {load[1]:.1f} after, of which this program is 1.",
        "Processor time on a loaded machine is an upper bound, because programs share the units of a core.",
        f"Survey: windows of {' / '.join(WINDOWS)}, stages by wall time.",
        "[Loads](index.md#workloads-of-the-speed-comparisons): median of 20 windows of 1 s.",
        "Limits of time and memory that fail a test:",
        "`python -m pytest -m bench tests/bench/test_budgets.py`.",
        "",
        "| figure | value | |",
        "|---|---|---|",
        *(f"| {' | '.join(row)} |" for row in rows),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--out", type=Path, default=PAGE)
    ask.add_argument("--work", type=Path, default=Path("out/bench"), help="what is flown and generated once")
    ask.add_argument(
        "--only", default="", help="survey, loads, worlds, demo or start; prints, writes no page"
    )
    ask.add_argument("--baseline", type=Path)
    ask.add_argument("--generator", type=Path)
    ask.add_argument("--first-start", action="store_true")
    args = ask.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    parts: dict[str, Callable[[], Iterator[Row]]] = {
        "survey": lambda: survey_rows(args.work),
        "loads": lambda: load_rows(args.work, args.baseline, args.generator),
        "worlds": lambda: world_rows(args.work),
        "demo": lambda: demo_rows(args.work),
        "start": lambda: start_rows(args.first_start),
    }
    head = ["git", "-C", str(REPOSITORY), "describe", "--always", "--dirty"]
    commit = subprocess.run(head, check=True, capture_output=True, text=True).stdout.strip()
    before, rows = os.getloadavg()[0], list[Row]()
    for name, part in parts.items():
        if args.only in ("", name):
            for row in part():
                print(f"{row[0]:<60} {row[1]:>14} {row[2]}", flush=True)
                rows.append(row)
    if not args.only:
        args.out.write_text(page(rows, commit, (before, os.getloadavg()[0])), "utf-8")


if __name__ == "__main__":
    main()
