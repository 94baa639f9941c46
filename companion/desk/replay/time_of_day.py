"""Formatting of times since 1970."""

from __future__ import annotations

import time

EARLIEST_NS = 10**18  # September 2001; smaller times have another epoch


def time_of_day(at_ns: int) -> str:
    """Return a time of day (UTC), or seconds for times of another epoch."""
    if at_ns < EARLIEST_NS:
        return f"{at_ns * 1e-9:.3f} s"
    return time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(at_ns // 1_000_000_000))
