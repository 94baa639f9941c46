"""Statistics of a periodic message: rate, jitter, and age of its pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from companion.runtime.ring_buffer import RingBuffer

MOST = 20_000  # samples kept, a quarter of an hour at 20 Hz


class Cadence:
    """Intervals between the messages of a stream.

    Parameters
    ----------
    hz
        Nominal rate; None for messages sent on demand.
    """

    def __init__(self, hz: float | None) -> None:
        self._period_ms = None if hz is None else 1e3 / hz
        self._last_ns: int | None = None
        self._intervals_ms = RingBuffer(MOST)
        self._ages_ms = RingBuffer(MOST)
        self.count = 0

    def record(self, now_ns: int, pose_age_ns: int | None = None) -> None:
        """Record the time of a message and the age of the newest pose sample behind it."""
        if self._last_ns is not None:
            self._intervals_ms.append((now_ns - self._last_ns) * 1e-6)
        if pose_age_ns is not None:
            self._ages_ms.append(pose_age_ns * 1e-6)
        self._last_ns = now_ns
        self.count += 1

    def pause(self) -> None:
        """Record a pause: the time until the next message does not count as an interval."""
        self._last_ns = None

    def summary(self) -> dict[str, Any]:
        """Return count, rate, and quantiles of jitter and pose age, as far as known."""
        out: dict[str, Any] = {"count": self.count}
        intervals = self._intervals_ms.array()
        if intervals.any():  # all are 0 if everything was sent at one instant
            out["hz"] = round(1e3 / float(intervals.mean()), 2)
            if self._period_ms is not None:
                out["jitter_ms"] = _quantiles(np.abs(intervals - self._period_ms))
        if self._ages_ms:
            out["pose_age_ms"] = _quantiles(self._ages_ms.array())
        return out


def _quantiles(values: Any) -> dict[str, float]:
    p50, p99, most = np.percentile(values, [50, 99, 100])
    return {"p50": round(float(p50), 2), "p99": round(float(p99), 2), "max": round(float(most), 2)}
