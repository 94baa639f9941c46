"""Verdict on the gauges' readings: constant or growing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import theilslopes

from tests.soak.gauges import Reading

SETTLED = 0.25  # of the time: maps fill, caches and pools reach their size
GROWTH = 0.01  # of the resident memory, over all that comes after
SLOWER = 1.10  # of the latency at 99 %, last quarter to the one after the warm-up


def judge(readings: Sequence[Reading]) -> dict[str, Any]:
    """Return the figures, and under `failed` what did not stay.

    Memory is judged by the Theil-Sen slope of all readings after the first quarter; counts by their most in
    the last quarter against their most in the quarter after the first.
    """
    at_h = np.array([r.at_h for r in readings])
    hours = float(at_h[-1])
    late = [r for r in readings if r.at_h >= SETTLED * hours]
    second = [r for r in late if r.at_h < 2 * SETTLED * hours]
    last = [r for r in late if r.at_h >= (1 - SETTLED) * hours]
    rss = [r.rss_mib for r in late]
    slope, _, low, high = theilslopes(rss, [r.at_h for r in late])
    growth = float(slope) * hours * (1 - SETTLED) / float(np.median(rss))
    p99_ms = [float(np.nanmedian([r.latency_p99_ms for r in part])) for part in (second, last)]
    told: dict[str, Any] = {
        "hours": round(hours, 2),
        "flights": readings[-1].flights,
        "reports": sum(r.reports for r in readings),
        "rss_mib": [rss[0], rss[-1], max(rss)],
        "rss_mib_per_h": [round(float(v), 3) for v in (low, slope, high)],
        "rss_growth": round(growth, 4),
        "latency_p99_ms": [round(v, 1) for v in p99_ms],
    }
    failed = []
    if growth > GROWTH:
        failed.append("memory")
    for name in ("descriptors", "threads", "tasks"):
        most = [max(getattr(r, name) for r in part) for part in (second, last)]
        told[name] = most
        if most[1] > most[0]:
            failed.append(name)
    if not p99_ms[1] <= SLOWER * p99_ms[0]:
        failed.append("latency")
    return told | {"failed": failed}
