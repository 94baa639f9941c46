"""GNSS receivers of the simulated vehicle: whether they have a fix, and the error of the used position."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

F64 = NDArray[np.float64]

_NONE: F64 = np.zeros(3)
_NONE.flags.writeable = False


class GnssReceiver:
    """State of the receiver, set by faults.

    Attributes
    ----------
    has_fix
        Whether it has a fix.
    first_is_dead
        Whether the first of two receivers sends nothing any more: the second gives the position.
    error_enu_m
        (3,) error of its position beyond that of a clear sky; zero without a fault.
    velocity_error_enu_ms
        (3,) error of its Doppler velocity: a spoofer's is that of its false path, multipath has none.
    """

    def __init__(self) -> None:
        self.has_fix = True
        self.first_is_dead = False
        self.error_enu_m: F64 = _NONE
        self.velocity_error_enu_ms: F64 = _NONE

    @property
    def is_faulty(self) -> bool:
        """Whether its position or velocity is wrong."""
        if self.error_enu_m is _NONE and self.velocity_error_enu_ms is _NONE:
            return False  # the case of every tick without a fault
        return bool(self.error_enu_m.any() or self.velocity_error_enu_ms.any())

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of the receiver in use; a wrong position does not change it."""
        return int(mavlink.GPS_FIX_TYPE_RTK_FLOAT if self.has_fix else mavlink.GPS_FIX_TYPE_NO_FIX)
