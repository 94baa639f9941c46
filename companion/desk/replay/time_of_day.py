"""Formatting of times since 1970."""

from __future__ import annotations

import time

EARLIEST_NS = 10**18  # September 2001; smaller times have another epoch


def time_of_day(at_ns: int) -> str:
    """Return a time of day (UTC), or seconds for times of another epoch."""
    if at_ns < EARLIEST_NS:
        return f"{at_ns * 1e-9:.3f} s"
    return time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(at_ns // 1_000_000_000))


HOUR_S, DAY_S, WEEK_S = 3600, 86_400, 604_800
# Usual differences of clocks, the most telling first: size, name, and most multiples.
USUAL = (
    (1024 * WEEK_S, "1024 weeks (a receiver whose count of weeks overflowed)", 3),
    (315_964_800, "the epoch of GPS (1980 for 1970)", 1),
    (1_000_000_000, "1e9 s (that standard GPS time of LAS leaves out)", 1),
    (WEEK_S, "weeks", 5000),
    (DAY_S, "days", 20_000),
    (HOUR_S, "hours (a time zone)", 14),
    (HOUR_S // 4, "quarters of an hour (a time zone)", 56),
)
LEAPS_S = (18, -18, 37, -37, 17, -17, 19, -19)  # GPS and TAI time minus UTC, today's first
SLACK_S = 0.5


def fitting_offset(points_ns: tuple[int, int], log_ns: tuple[int, int]) -> str:
    """Return which offset would put points, measured from and to a time, into a log's span.

    Usual differences of clocks are named: weeks, days, time zones, epochs, leap seconds.
    """
    low_s, high_s = sorted((log - point) * 1e-9 for log, point in zip(log_ns, points_ns, strict=True))
    low_s, high_s = low_s - SLACK_S, high_s + SLACK_S
    middle_s = (low_s + high_s) / 2
    for leap_s in (0, *LEAPS_S):
        for size_s, name, most in USUAL:
            times = round((middle_s - leap_s) / size_s)
            if 0 < abs(times) <= most and low_s <= times * size_s + leap_s <= high_s:
                count = f"{times:+d} x" if most == 1 or size_s == USUAL[0][0] else f"{times:+d}"
                leaps = f" and {leap_s:+d} s (leap seconds)" if leap_s else ""
                return f"an offset of {count} {name}{leaps} would fit"
        if leap_s and low_s <= leap_s <= high_s and high_s - low_s < abs(leap_s) + 2 * SLACK_S:
            return f"an offset of {leap_s:+d} s (leap seconds) would fit"
    return f"an offset of {middle_s:+.1f} s would fit"
