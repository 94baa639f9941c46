"""GPS times of stored clouds as times of day, resolved with the log of the same flight.

A LAS header states whether times count from the beginning of the GPS week or, less 1e9 s, from 1980. Some
writers set that bit wrong, let the week's count run past its end or restart it, or write seconds since 1970
or whole GPS time. Only one of these meanings puts the times into the flight.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.cloud_source import Clock
from companion.desk.replay.recorder_clock import time_of_day

GPS_EPOCH_S = 315_964_800  # 1980-01-06 since 1970
# Leap seconds: GPS time minus UTC from a time of day on (s since 1970; IERS Bulletin C).
LEAPS_S = (
    (1_136_073_600, 14),
    (1_230_768_000, 15),
    (1_341_100_800, 16),
    (1_435_708_800, 17),
    (1_483_228_800, 18),
)
WEEK_S = 604_800
STANDARD_LESS_S = 1_000_000_000  # offset that standard GPS time of LAS has subtracted
MOST_S = 9_000_000_000  # since 1970: the year 2255
MARGIN_S = 60  # largest difference between the clocks of log and sensor
NAMES = {
    "standard": "standard GPS time",
    "week": "seconds of the GPS week",
    "gps": "seconds of GPS since 1980",
    "unix": "seconds since 1970",
}


@dataclass(frozen=True, slots=True)
class ResolvedTimes:
    """Resolved times of points.

    kind: their meaning, one of `NAMES`. stamp_ns: (n,) int64 since 1970, zero where not in the flight.
    fits: (n,) bool, whether a time is within the flight.
    """

    kind: str
    stamp_ns: NDArray[np.int64]
    fits: NDArray[np.bool_]


def resolve_times(gps_s: NDArray[np.float64], clock: Clock, span_ns: tuple[int, int]) -> ResolvedTimes:
    """Return the times in the meaning that puts most of them into the flight.

    Parameters
    ----------
    gps_s
        (n,) times as stored.
    clock
        Meaning by the header; preferred where another one fits no better.
    span_ns
        First and last time of the log, since 1970. The week is chosen for each point separately.
    """
    middle_s = sum(span_ns) // 2_000_000_000
    first_s, last_s = (edge * 1e-9 - middle_s for edge in span_ns)
    best: ResolvedTimes | None = None
    for kind, after_s in _meanings(gps_s, clock, middle_s):
        with np.errstate(invalid="ignore"):
            fits = (after_s >= first_s - MARGIN_S) & (after_s <= last_s + MARGIN_S)
        if best is None or np.count_nonzero(fits) > np.count_nonzero(best.fits):
            after_ns = np.rint(np.where(fits, after_s, 0.0) * 1e9).astype(np.int64)
            best = ResolvedTimes(kind, np.where(fits, after_ns + middle_s * 1_000_000_000, 0), fits)
    assert best is not None  # noqa: S101 - `_meanings` is never empty
    return best


def first_by_header(gps_s: NDArray[np.float64], clock: Clock, span_ns: tuple[int, int]) -> str:
    """Return the first time in the header's meaning, for an error; at least one must be finite."""
    first_s = float(np.nanmin(np.where(np.isfinite(gps_s), gps_s, np.nan)))
    if clock == "week":
        return f"{first_s:.0f} s of a GPS week"
    span = span_by_header(gps_s, clock, span_ns)
    return f"{first_s:g} s" if span is None else time_of_day(span[0])


def span_by_header(
    gps_s: NDArray[np.float64], clock: Clock, span_ns: tuple[int, int]
) -> tuple[int, int] | None:
    """Return first and last time since 1970 (ns) in the header's meaning, without NaN and zeros.

    None for times of the week, and for absurd ones.
    """
    if clock == "week":
        return None
    after_s = STANDARD_LESS_S + GPS_EPOCH_S - _leap_s(span_ns[0] // 1_000_000_000)
    sound = gps_s[np.isfinite(gps_s) & (gps_s != 0) & (np.abs(gps_s + after_s) < MOST_S)]
    if not len(sound):
        return None
    return round((float(sound.min()) + after_s) * 1e9), round((float(sound.max()) + after_s) * 1e9)


def _leap_s(at_s: int) -> int:
    return max((leap for since, leap in LEAPS_S if since <= at_s), default=LEAPS_S[0][1])


def _meanings(
    gps_s: NDArray[np.float64], clock: Clock, middle_s: int
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield meanings, the header's first, and the times in them relative to the middle of the flight (s)."""
    since_1980_s = middle_s - GPS_EPOCH_S + _leap_s(middle_s)
    begins_s = {"standard": since_1980_s - STANDARD_LESS_S, "gps": since_1980_s, "unix": middle_s}
    for kind in sorted(NAMES, key=lambda kind: kind != clock):
        if kind == "week":
            with np.errstate(invalid="ignore"):
                after_s = np.where((gps_s >= 0) & (gps_s < 2 * WEEK_S), gps_s - since_1980_s % WEEK_S, np.nan)
            yield kind, after_s - np.round(after_s / WEEK_S) * WEEK_S
        else:
            yield kind, gps_s - begins_s[kind]
