"""Unit and epoch of the times that points of recorded clouds carry, judged over many clouds.

Drivers write a point's time in seconds, milliseconds, microseconds or nanoseconds, or as a share of the
sweep, since 1970 or since the cloud's stamp, and name neither. The span of the times of one cloud, against
the time from cloud to cloud, tells the unit: a sweep never lasts a thousand times as long. What stays unknown
is not used.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.generic]
UNITS_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
# Least and greatest span of a cloud, in periods of the clouds: thinned recordings, and several sweeps in one
# cloud. Their quotient is far below 1000, so that no two units fit and a strange span fits none.
LEAST_SHARE, MOST_SHARE = 1 / 30, 4.0
PERIOD_NS = 100_000_000.0  # of a sensor where the stamps do not tell it
QUANTILES = (
    0.02,
    0.1,
    0.5,
    0.9,
    0.98,
)  # garbage in a few per cent of the points does not move the middle three
BETWEEN = 0.8  # of the span lies between the second and the fourth
WHOLE = (0.9, 1.05)  # span of times that are shares of the sweep
SLACK = 0.02
STEADY = 0.2  # part of a period by which regular clouds differ
LATE_NS = 1e9  # a stamp of the host is at most so far from the sensor's times since 1970
REACH = 1.5  # spans or periods from the stamp to the middle of a cloud
APART = 2.0  # spans from the middle of a cloud to any of its points


@dataclass(frozen=True, slots=True)
class Sample:
    """Times of one cloud. stamp_ns: of its message. quantiles: `QUANTILES` of its times, in their unit."""

    stamp_ns: int
    quantiles: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class PointClock:
    """What the times of points of a recording mean.

    field: where they are. unit: its name, "sweep" for shares of it. unit_ns: its length. absolute: since
    1970, not since the cloud's stamp. reach_ns: farthest that the middle of a cloud is from its stamp.
    apart_ns: farthest that a point is from the middle of its cloud.
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
        """Return times (ns since 1970) of the points of a cloud, and which of them are sound, each (n,).

        None where the times of most points are not what they are in the rest of the recording.
        """
        after_ns = _after_ns(values, self.unit_ns, stamp_ns if self.absolute else 0)
        finite = np.isfinite(after_ns)
        if not finite.any():
            return None
        middle_ns = float(np.median(after_ns[finite]))
        with np.errstate(invalid="ignore"):
            sound = finite & (np.abs(after_ns - middle_ns) <= self.apart_ns)
        if abs(middle_ns) > self.reach_ns or 2 * np.count_nonzero(sound) < len(values):
            return None
        return stamp_ns + np.rint(np.where(sound, after_ns, middle_ns)).astype(np.int64), sound


def sample(values: Values, stamp_ns: int) -> Sample | None:
    """Return what tells the unit of the times of a cloud; None where none of them is finite."""
    times = values.astype(np.float64)
    times = times[np.isfinite(times)]
    if not len(times):
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # garbage may be as far as numbers go
        quantiles = np.quantile(times, QUANTILES)
    return Sample(stamp_ns, tuple(map(float, quantiles)))


def judge(field: str, samples: Sequence[Sample], stamps_ns: Iterable[int]) -> PointClock | str:
    """Return what the times in a field mean, or why that cannot be known.

    Parameters
    ----------
    samples
        Of several clouds, at least one.
    stamps_ns
        Of all clouds looked at, which tell the time from cloud to cloud.
    """
    quantiles = np.array([one.quantiles for one in samples])
    spans = (quantiles[:, 3] - quantiles[:, 1]) / BETWEEN
    spans = spans[spans > 0]
    if 2 * len(spans) <= len(samples) or not np.isfinite(spans).all():
        return f"all points of a cloud have one time in {field}"
    gaps_ns = np.diff(sorted(set(stamps_ns))).astype(np.float64)
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
    """Return name and length (ns) of the unit in which clouds have a span."""
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
    """Return the time from cloud to cloud: a long one, as several sensors may share a topic."""
    return float(np.quantile(gaps_ns, 0.9, method="higher")) if len(gaps_ns) else PERIOD_NS


def _after_ns(values: Values, unit_ns: float, since_ns: int) -> NDArray[np.float64]:
    """Return times after a time of day, subtracted in their own unit so as to lose no digit."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray((values.astype(np.float64) - since_ns / unit_ns) * unit_ns)
