"""Conversion of a companion's time stamps to the autopilot's clock by the least transport lag."""

from __future__ import annotations

MOST_LAG_NS = 500_000_000
CONVERGENCE = 100
"""Messages after which the offset is set to the least lag among them, to follow the drift of a clock."""


class JitterCorrection:
    """Estimator of the offset between two clocks, as ArduPilot's (AP_RTC/JitterCorrection).

    The message with the least lag is taken as one without any, so a constant transport delay is not seen.
    """

    def __init__(self) -> None:
        self._offset_ns: int | None = None
        self._least_ns = 0
        self._count = 0

    def local_ns(self, stamp_ns: int, arrival_ns: int) -> int:
        """Return the local time of a remote stamp, from 0.5 s before its arrival up to it."""
        lag_ns = arrival_ns - stamp_ns
        if self._offset_ns is None or lag_ns < self._offset_ns:
            self._offset_ns = lag_ns
        local_ns = stamp_ns + self._offset_ns
        if local_ns + MOST_LAG_NS < arrival_ns:
            local_ns = arrival_ns - MOST_LAG_NS
            self._offset_ns = local_ns - stamp_ns
        self._least_ns = lag_ns if self._count == 0 else min(self._least_ns, lag_ns)
        self._count += 1
        if self._count == CONVERGENCE:
            self._offset_ns, self._count = self._least_ns, 0
        return local_ns
