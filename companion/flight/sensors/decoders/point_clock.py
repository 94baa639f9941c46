"""Unit and epoch of per-point times in recorded clouds, inferred from many clouds.

Drivers write a point's time in seconds, milliseconds, microseconds or nanoseconds, or as a share of the
sweep, since 1970 or since the cloud's stamp, and state neither. The span of the times of one cloud,
compared with the period of the clouds, determines the unit, since a sweep never lasts a thousand periods.
Times of unknown meaning are not used.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.generic]
UNITS_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
# Smallest and largest span of a cloud, in periods of the clouds: thinned recordings, several sweeps in one
# cloud. Their ratio is far below 1000, so that two units never fit and an implausible span fits none.
LEAST_SHARE, MOST_SHARE = 1 / 30, 4.0
PERIOD_NS = 100_000_000.0  # assumed where the stamps do not show the period
MOST_GAP_NS = 10_000_000_000  # between two stamps of one clock: a longer one is a false stamp, or a clock set
QUANTILES = (
    0.02,
    0.1,
    0.5,
    0.9,
    0.98,
)  # the middle three are robust to garbage in a few per cent of the points
BETWEEN = 0.8  # share of the span between the second and the fourth
WHOLE = (0.9, 1.05)  # range of the span of times that are shares of the sweep
SLACK = 0.02
STEADY = 0.2  # relative deviation from the period up to which clouds count as regular
LATE_NS = 1e9  # largest difference between the host's stamp and the sensor's times since 1970
REACH = 1.5  # largest distance from the stamp to the middle of a cloud, in spans or periods
APART = 2.0  # largest distance from the middle of a cloud to a point, in spans
# So many points within so small a share of the usual span have times of another unit, or none.
CROWD, CROWDED = 10, 1 / 300


@dataclass(frozen=True, slots=True)
class Sample:
    """Times of one cloud. stamp_ns: of its message. quantiles: `QUANTILES` of its times, in their unit."""

    stamp_ns: int
    quantiles: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class PointClock:
    """Meaning of the points' times of a recording.

    field: field that holds them. unit: its name, "sweep" for shares of it. unit_ns: its length. absolute:
    since 1970, not since the cloud's stamp. reach_ns: largest distance of the middle of a cloud from its
    stamp. apart_ns: largest distance of a point from the middle of its cloud.
    """

    field: str
    unit: str
    unit_ns: float
    absolute: bool
    reach_ns: float
    apart_ns: float

    def __str__(self) -> str:
        return f"{self.field}: {self.unit} since {'1970' if self.absolute else 'the stamp'}"

    def stamps(self, values: Values, stamp_ns: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
        """Return times (ns since 1970) of the points of a cloud, and the mask of plausible ones, each (n,).

        None where most times of the cloud do not fit the rest of the recording.
        """
        after_ns = _after_ns(values, self.unit_ns, stamp_ns if self.absolute else 0)
        finite = np.isfinite(after_ns)
        if not finite.any():
            return None
        middle_ns = float(np.median(after_ns[finite]))
        with np.errstate(invalid="ignore"):
            sound = finite & (np.abs(after_ns - middle_ns) <= self.apart_ns)
        low_ns, high_ns = np.quantile(after_ns[finite], (0.1, 0.9))
        crowded = len(values) >= CROWD and high_ns - low_ns < CROWDED * self.apart_ns / APART
        if crowded or abs(middle_ns) > self.reach_ns or 2 * np.count_nonzero(sound) < len(values):
            return None
        return stamp_ns + np.rint(np.where(sound, after_ns, middle_ns)).astype(np.int64), sound


def sample(values: Values, stamp_ns: int) -> Sample | None:
    """Return the time quantiles of a cloud, from which the unit is inferred; None without a finite time."""
    times = values.astype(np.float64)
    times = times[np.isfinite(times)]
    if not len(times):
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # garbage may reach the limits of floats
        quantiles = np.quantile(times, QUANTILES)
    return Sample(stamp_ns, tuple(map(float, quantiles)))


def infer_clock(field: str, samples: Sequence[Sample], stamps_ns: Iterable[int]) -> PointClock | str:
    """Return the clock of the times in a field, or the reason it cannot be known.

    Parameters
    ----------
    samples
        Of several clouds, at least one.
    stamps_ns
        Of all clouds examined; they give the period of the clouds.
    """
    quantiles = np.array([one.quantiles for one in samples])
    spans = (quantiles[:, 3] - quantiles[:, 1]) / BETWEEN
    spans = spans[spans > 0]
    if 2 * len(spans) <= len(samples) or not np.isfinite(spans).all():
        return f"all points of a cloud have one time in {field}"
    gaps_ns = np.diff(sorted(set(stamps_ns))).astype(np.float64)
    gaps_ns = gaps_ns[gaps_ns <= MOST_GAP_NS]
    found = _unit(float(np.median(spans)), quantiles, gaps_ns)
    if found is None:
        return f"the unit of {field} cannot be told by its span"
    unit, unit_ns = found
    span_ns = float(np.quantile(spans, 0.9)) * unit_ns
    reach_ns = REACH * max(span_ns, _period_ns(gaps_ns))
    for absolute, reach in ((False, reach_ns), (True, reach_ns + LATE_NS)):
        middles_ns = [
            abs(_after_ns(np.array([one.quantiles[2]]), unit_ns, one.stamp_ns if absolute else 0)[0])
            for one in samples
        ]
        if float(np.median(middles_ns)) <= reach:
            return PointClock(field, unit, unit_ns, absolute, reach, APART * span_ns)
    return f"{field} counts neither from 1970 nor from the stamps of the clouds"


def _unit(
    span: float, quantiles: NDArray[np.float64], gaps_ns: NDArray[np.float64]
) -> tuple[str, float] | None:
    """Return name and length (ns) of the unit that fits the clouds' span; None if there is none."""
    period_ns = _period_ns(gaps_ns)
    low, high = float(np.median(quantiles[:, 0])), float(np.median(quantiles[:, 4]))
    shares = WHOLE[0] <= span <= WHOLE[1] and low >= -1 - SLACK and high <= 1 + SLACK
    if shares and abs(period_ns - UNITS_NS["s"]) > 0.1 * UNITS_NS["s"]:
        if not len(gaps_ns):
            return None
        middle_ns = float(np.median(gaps_ns))
        steady = np.abs(gaps_ns - middle_ns) <= STEADY * middle_ns
        return ("sweep", middle_ns) if 2 * np.count_nonzero(steady) > len(gaps_ns) else None
    fitting = ((n, ns) for n, ns in UNITS_NS.items() if LEAST_SHARE <= span * ns / period_ns <= MOST_SHARE)
    return next(fitting, None)


def _period_ns(gaps_ns: NDArray[np.float64]) -> float:
    """Return the period of the clouds: a high quantile of the gaps, as several sensors may share a topic."""
    return float(np.quantile(gaps_ns, 0.9, method="higher")) if len(gaps_ns) else PERIOD_NS


def _after_ns(values: Values, unit_ns: float, since_ns: int) -> NDArray[np.float64]:
    """Return times relative to `since_ns` (ns), subtracted in their own unit to keep precision."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray((values.astype(np.float64) - since_ns / unit_ns) * unit_ns)
