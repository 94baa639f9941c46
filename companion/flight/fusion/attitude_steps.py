"""Check that attitudes come often enough for the vehicle's turns."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Between attitudes the rate is taken as constant. Where it changes by d over an interval T, the attitude in
# the middle errs by d T / 8: by more than this, returns at 20 m are placed 0.7 m off.
COARSE_RAD = math.radians(2.0)
SHARE = 1 / 8
# Such a change within this time is none of a vehicle (10,000 degrees/s^2): the estimate was reset.
OFTEN_NS = 40_000_000


class AttitudeSteps:
    """Estimate of the error of attitudes between samples.

    Attributes
    ----------
    coarse
        Number of intervals within which that error exceeds two degrees.
    worst_deg
        Greatest error.
    """

    def __init__(self) -> None:
        self.coarse = 0
        self.worst_deg = 0.0
        self._last: tuple[int, NDArray[np.float64]] | None = None
        self._rate: NDArray[np.float64] | None = None  # (3,), rad/ns
        self._changed = False  # within the last interval

    def add(self, stamp_ns: int, quat: NDArray[np.float64], longest_ns: int) -> bool:
        """Add a unit attitude (4,); return whether attitudes since the last one would be false.

        They may be, too, in the interval behind such a one: a turn can end within it and leave the mean rate
        alike. Across a gap longer than `longest_ns` nothing is interpolated.
        """
        if self._last is None or not 0 < stamp_ns - self._last[0] <= longest_ns:
            self._last, self._rate = (stamp_ns, quat), None
            return False
        interval_ns = stamp_ns - self._last[0]
        rate = _turn(self._last[1], quat) / interval_ns
        change = 0.0 if self._rate is None else _length(rate - self._rate)
        error_rad = SHARE * change * interval_ns
        self._last, self._rate = (stamp_ns, quat), rate
        self.worst_deg = max(self.worst_deg, math.degrees(error_rad))
        changed = error_rad > COARSE_RAD and interval_ns > OFTEN_NS
        is_coarse, self._changed = changed or self._changed, changed
        self.coarse += is_coarse
        return is_coarse


def _turn(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation vector (3,), rad, in body axes, from one attitude to the next."""
    w = float(before @ after)
    (bw, bx, by, bz), (aw, ax, ay, az) = before.tolist(), after.tolist()
    axis = np.array(
        (
            bw * ax - aw * bx - (by * az - bz * ay),
            bw * ay - aw * by - (bz * ax - bx * az),
            bw * az - aw * bz - (bx * ay - by * ax),
        )
    )
    sine = _length(axis)
    scale = 2.0 if sine < 1e-12 else 2 * math.atan2(sine, abs(w)) / sine
    return np.asarray(math.copysign(scale, w) * axis)


def _length(vector: NDArray[np.float64]) -> float:
    return math.sqrt(vector.dot(vector))
