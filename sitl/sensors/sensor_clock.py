"""Free-running clock of a sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

I64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Clock:
    """Sensor clock: ``offset_ns`` at simulated time 0, fast by ``drift_ppb``."""

    offset_ns: int = 7_300_000_000
    drift_ppb: int = 12_000

    def sensor_ns(self, time_ns: int) -> int:
        return self.offset_ns + self.elapsed_ns(time_ns)

    def elapsed_ns(self, time_ns: int) -> int:
        """Return the advance of this clock at a simulated time."""
        return time_ns + time_ns * self.drift_ppb // 1_000_000_000

    def simulated_ns(self, elapsed_ns: I64) -> I64:
        """Return simulated times at which this clock has advanced by elapsed_ns (rounded up)."""
        return elapsed_ns - elapsed_ns * self.drift_ppb // (1_000_000_000 + self.drift_ppb)
