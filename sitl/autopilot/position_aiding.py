"""GPS aiding of the position estimate: the receiver, dead reckoning without it, and the filter's status."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

F64 = NDArray[np.float64]

TIMEOUT_S, STOPPED_S = 7.3, 15.2
"""Time without GPS after which the filter abandons its horizontal position, and then holds it constant."""
DRIFT_S, DRIFT_MS2 = 10.0, 0.034
"""Dead reckoning integrates an acceleration error: 1.7 m after ten seconds, and no further."""
PULL_IN_S = 1.0
REALIGN_S = 2.0
TEST_RATIO = 0.02

AIDED: int = (
    mavlink.EKF_ATTITUDE
    | mavlink.EKF_VELOCITY_HORIZ
    | mavlink.EKF_VELOCITY_VERT
    | mavlink.EKF_POS_HORIZ_REL
    | mavlink.EKF_POS_HORIZ_ABS
    | mavlink.EKF_POS_VERT_ABS
    | mavlink.EKF_PRED_POS_HORIZ_REL
    | mavlink.EKF_PRED_POS_HORIZ_ABS
)
TIMED_OUT: int = mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_VERT_ABS
UNAIDED: int = TIMED_OUT | mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_CONST_POS_MODE


class PositionAiding:
    """Horizontal error of the estimate without GPS, and the matching reports of EKF and receiver.

    Attributes
    ----------
    gps
        Whether the receiver has a fix.
    absolute
        Whether the filter reports a valid absolute horizontal position.
    offset_enu_m, velocity_error_enu_ms
        (3,) added to the estimate.
    """

    def __init__(self) -> None:
        self.gps = True
        self.absolute = True
        self.offset_enu_m: F64 = np.zeros(3)
        self.velocity_error_enu_ms: F64 = np.zeros(3)
        self._direction: F64 = np.zeros(3)
        self._since_s = 0.0
        self._steady = True
        self._reset_enu_m: F64 | None = None

    def lose_gps(self, bearing_rad: float) -> None:
        """Remove the fix; the estimate drifts towards a bearing, clockwise from north."""
        self.gps = self._steady = False
        self._since_s = 0.0
        self._direction = np.array([math.sin(bearing_rad), math.cos(bearing_rad), 0.0])

    def regain_gps(self) -> None:
        """Restore the fix: the estimate converges, or is reset if the filter had abandoned its position."""
        self.gps = True
        self._since_s = 0.0
        self.velocity_error_enu_ms = np.zeros(3)

    def update(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        if self._steady:
            return
        self._since_s += dt_s
        if self.gps:
            self._aided(dt_s)
        else:
            self._unaided(dt_s)

    def _unaided(self, dt_s: float) -> None:
        self.absolute = self.absolute and self._since_s < TIMEOUT_S
        drifting = self._since_s < DRIFT_S
        speed_ms = DRIFT_MS2 * self._since_s if drifting else 0.0
        self.velocity_error_enu_ms = speed_ms * self._direction
        self.offset_enu_m = self.offset_enu_m + self.velocity_error_enu_ms * dt_s

    def _aided(self, dt_s: float) -> None:
        if self.absolute:
            self.offset_enu_m = self.offset_enu_m * max(0.0, 1.0 - dt_s / PULL_IN_S)
            self._steady = self._since_s > 10 * PULL_IN_S
        elif self._since_s >= REALIGN_S:
            self._reset_enu_m = -self.offset_enu_m
            self.absolute = self._steady = True
        if self._steady:
            self.offset_enu_m = np.zeros(3)

    def take_reset(self) -> F64 | None:
        """Return the jump of a reset since the last call, None without one."""
        jump, self._reset_enu_m = self._reset_enu_m, None
        return jump

    @property
    def stopped(self) -> bool:
        """Whether the filter has stopped aiding and holds its position constant."""
        return not self.absolute and (self.gps or self._since_s >= STOPPED_S)

    @property
    def flags(self) -> int:
        """Flags of EKF_STATUS_REPORT."""
        if self.absolute:
            return AIDED
        return UNAIDED if self.stopped else TIMED_OUT

    @property
    def test_ratio(self) -> float:
        """Horizontal test ratio, called a variance in EKF_STATUS_REPORT: without GPS nothing is tested."""
        return 0.0 if self.stopped else TEST_RATIO

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of the receiver."""
        return int(mavlink.GPS_FIX_TYPE_RTK_FLOAT if self.gps else mavlink.GPS_FIX_TYPE_NO_FIX)
