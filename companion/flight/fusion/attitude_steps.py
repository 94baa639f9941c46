"""Whether attitudes come often enough for the vehicle's turns."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Between attitudes the rate is taken as constant. Where the turn from one to the next changes by d, the
# attitude in the middle errs by d / 8: by more than this, returns at 20 m are placed 0.7 m off.
COARSE_RAD = math.radians(2.0)
SHARE = 1 / 8


class AttitudeSteps:
    """Estimate of the error of attitudes between samples.

    Attributes
    ----------
    coarse
        Number of attitudes around which that error exceeds two degrees.
    worst_deg
        Greatest error.
    """

    def __init__(self) -> None:
        self.coarse = 0
        self.worst_deg = 0.0
        self._last: tuple[int, NDArray[np.float64]] | None = None
        self._turn: NDArray[np.float64] | None = None

    def add(self, stamp_ns: int, quat: NDArray[np.float64], longest_ns: int) -> None:
        """Add a unit attitude (4,); across a gap longer than `longest_ns` nothing is interpolated."""
        if self._last is None or not 0 < stamp_ns - self._last[0] <= longest_ns:
            self._last, self._turn = (stamp_ns, quat), None
            return
        turn = _turn(self._last[1], quat)
        if self._turn is not None:
            error_rad = SHARE * float(np.linalg.norm(turn - self._turn))
            self.coarse += error_rad > COARSE_RAD
            self.worst_deg = max(self.worst_deg, math.degrees(error_rad))
        self._last, self._turn = (stamp_ns, quat), turn


def _turn(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation vector (3,), rad, in body axes, from one attitude to the next."""
    w = float(before @ after)
    axis = before[0] * after[1:] - after[0] * before[1:] - np.cross(before[1:], after[1:])
    sine = float(np.linalg.norm(axis))
    scale = 2.0 if sine < 1e-12 else 2 * math.atan2(sine, abs(w)) / sine
    return np.asarray(math.copysign(scale, w) * axis)
