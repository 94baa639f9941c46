"""Checks of this computer: cores, pipeline speed, timer latency, clock."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Sequence

import numpy as np

from companion.flight.doctor.finding import Finding, judged
from params import Parameters
from slz import Pipeline, Window
from slz.frame import LocalFrame

CORES = 2
TIMER_MS = 10.0
POINTS = 100_000
# A window must be processed within this share of its own span.
SHARE = 0.5
YEAR_2025 = 1_735_689_600


def machine_findings(parameters: Parameters, late_ms: Sequence[float]) -> list[Finding]:
    """Judge this computer; `late_ms` are timer latencies. Runs the pipeline for some seconds."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return [
        judged(
            "cores",
            cores >= CORES,
            str(cores),
            f"at least {CORES}",
            "use a computer with more cores: link and pipeline must not wait for each other",
        ),
        speed_finding(window_ms(parameters), parameters),
        timer_finding(late_ms),
        judged(
            "date",
            time.time() > YEAR_2025,
            time.strftime("%Y-%m-%d", time.gmtime()),
            "the real one",
            "set the clock (NTP or GPS); only names of records and logs depend on it",
            otherwise="warn",
        ),
    ]


def speed_finding(took_ms: float, parameters: Parameters) -> Finding:
    """Judge the processing time of a window of `POINTS` points."""
    most_ms = SHARE * 1000 * parameters.window_s
    return judged(
        "pipeline speed",
        took_ms <= most_ms,
        f"{took_ms:.0f} ms for {POINTS} points",
        f"at most {most_ms:.0f} ms",
        "stop other programs, set the CPU governor to performance, raise cell_m or lower max_range_m",
    )


def timer_finding(late_ms: Sequence[float]) -> Finding:
    """Judge the wake-up latency of timers, which is also the jitter of the 20 Hz messages."""
    late = float(np.percentile(np.asarray(late_ms, np.float64), 99)) if len(late_ms) else 0.0
    return judged(
        "timer, p99 late",
        late <= TIMER_MS,
        f"{late:.1f} ms",
        f"at most {TIMER_MS:g} ms",
        "stop other programs, or run slz with a higher priority (systemd: Nice=-10)",
        otherwise="warn",
    )


def window_ms(parameters: Parameters, runs: int = 3) -> float:
    """Return the median processing time of a window of synthetic ground, without compilation."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-25, 25, (POINTS, 2)), rng.normal(0.0, 0.02, POINTS)])
    pipeline = Pipeline(parameters)
    took = []
    for run in range(runs + 1):
        start_ns = run * round(parameters.window_s * 1e9)
        stamps = start_ns + np.linspace(0, 0.9e9 * parameters.window_s, POINTS).astype(np.int64)
        window = Window(
            points_enu_m=points,
            stamp_ns=stamps,
            sensor_enu_m=np.array([0.0, 0.0, 20.0]),
            frame=LocalFrame(47.0, 8.0, 500.0),
            start_ns=int(stamps[0]),
            end_ns=int(stamps[-1]),
        )
        begun = time.perf_counter()
        pipeline.process(window)
        took.append(1000 * (time.perf_counter() - begun))
    return statistics.median(took[1:])  # the first may compile
