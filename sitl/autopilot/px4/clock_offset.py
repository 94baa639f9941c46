"""Clock of a link's peer by TIMESYNC, and the stamps of its messages (lib/timesync/Timesync.cpp)."""

from __future__ import annotations

CONVERGED = 500  # CONVERGENCE_WINDOW
MAX_ROUND_TRIP_US, MAX_DEVIATION_US, MAX_DEVIATIONS = 10_000, 100_000, 10
FIRST_GAIN, LAST_GAIN = 0.05, 0.003


class ClockOffset:
    """Offset of the local clock from the peer's, us; its skew is not estimated."""

    def __init__(self) -> None:
        self._samples = self._deviations = 0
        self._offset_us = 0.0

    def add(self, now_us: int, remote_us: int, asked_us: int) -> None:
        """Use an answer: the peer's time between a question asked and now."""
        if now_us - asked_us > MAX_ROUND_TRIP_US:
            return
        measured_us = (asked_us + now_us) / 2 - remote_us
        if self._samples and abs(measured_us - self._offset_us) > MAX_DEVIATION_US:
            self._deviations += 1
            if self._deviations > MAX_DEVIATIONS:
                self._samples = self._deviations = 0
            return
        share = min(1.0, self._samples / CONVERGED)
        gain = 1.0 if not self._samples else FIRST_GAIN + share * (LAST_GAIN - FIRST_GAIN)
        self._offset_us += gain * (measured_us - self._offset_us)
        self._samples += 1
        self._deviations = 0

    def local_us(self, stamp_us: int, now_us: int) -> int:
        """Return a peer's stamp in local time; before the offset has converged, the time of arrival."""
        return round(stamp_us + self._offset_us) if self._samples >= CONVERGED else now_us
