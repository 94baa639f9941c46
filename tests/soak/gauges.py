"""Resource gauges of a process, read periodically."""

from __future__ import annotations

import asyncio
import gc
import json
import os
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from companion.flight.app import Companion

PAGE_MIB = os.sysconf("SC_PAGE_SIZE") / 2**20


@dataclass(frozen=True, slots=True)
class Reading:
    """One look: hours since the first, resident memory, what is open and running, latency since the last.

    `latency_p50_ms` and `latency_p99_ms` are NaN where no report came.
    """

    at_h: float
    rss_mib: float
    descriptors: int
    threads: int
    tasks: int
    reports: int
    latency_p50_ms: float
    latency_p99_ms: float
    cpu_s: float
    load: float
    flights: int


class Gauges:
    """Reads this process and the companion in it, and writes a line of JSON for each look.

    Parameters
    ----------
    path
        Begun anew.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("w", encoding="utf-8")
        self._since_s: float | None = None
        self._reports = 0
        self.readings: list[Reading] = []

    def read(self, companion: Companion, now_s: float, flights: int = 0) -> Reading:
        """Look, at a time of the clock under test."""
        gc.collect()  # what a cycle still holds is no leak
        if self._since_s is None:
            self._since_s = now_s
        worker = companion.mapping.worker
        new = min(worker.reports - self._reports, len(worker.computing_ms))
        latencies = worker.computing_ms.array(new) if new else np.array([np.nan])
        self._reports = worker.reports
        p50_ms, p99_ms = np.percentile(latencies, (50, 99))
        reading = Reading(
            at_h=round((now_s - self._since_s) / 3600, 4),
            rss_mib=round(_resident_pages() * PAGE_MIB, 1),
            descriptors=len(os.listdir("/proc/self/fd")),
            threads=threading.active_count(),
            tasks=len(asyncio.all_tasks()),
            reports=new,
            latency_p50_ms=round(float(p50_ms), 1),
            latency_p99_ms=round(float(p99_ms), 1),
            cpu_s=round(time.process_time(), 1),
            load=round(os.getloadavg()[0], 2),
            flights=flights,
        )
        self.readings.append(reading)
        self._file.write(json.dumps(asdict(reading)) + "\n")
        self._file.flush()
        return reading

    def close(self) -> None:
        self._file.close()


def _resident_pages() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1])
