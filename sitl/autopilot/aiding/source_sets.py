"""Source sets of ArduPilot's EKF3: which sensor gives position, velocity and heading (AP_NavEKF_Source)."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

F64 = NDArray[np.float64]

_NONE: F64 = np.zeros(3)
_NONE.flags.writeable = False
HEIGHT_GAIN_PER_S, VELOCITY_GAIN_PER_S2 = 1.0, 0.5
"""Gains of the filter: the height is 72 % of a step away after one second, 98 % after two."""
HELD_PER_S = 1.4  # by the vertical velocity of GPS
CONVERGED_M, CONVERGED_MS = 1e-3, 1e-3
MOST_LAG_NS = 500_000_000
CONVERGENCE = 100
"""Messages after which the offset is set to the least lag among them, to follow the drift of a clock."""
SETS = 3
DEFAULTS: dict[str, float] = {
    f"EK3_SRC{number}_{axis}": value if number == 1 or axis == "POSZ" else 0
    for number in range(1, SETS + 1)
    for axis, value in (("POSXY", 3), ("VELXY", 3), ("POSZ", 1), ("VELZ", 3), ("YAW", 1))
}
"""Parameters and their values: GPS, barometer and compass in the first set, a barometer in the others."""


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
        """True if its position or velocity is wrong."""
        if self.error_enu_m is _NONE and self.velocity_error_enu_ms is _NONE:
            return False  # the case of every tick without a fault
        return bool(self.error_enu_m.any() or self.velocity_error_enu_ms.any())

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of the receiver in use; a wrong position does not change it."""
        return int(mavlink.GPS_FIX_TYPE_RTK_FLOAT if self.has_fix else mavlink.GPS_FIX_TYPE_NO_FIX)


class HeightAiding:
    """Height of the estimate over the true one, in the wake of its barometer.

    Attributes
    ----------
    barometer_error_m
        Error of the measured height beyond that of `EstimateErrors`, set by faults.
    offset_up_m, velocity_error_up_ms
        Added to the estimate.
    """

    def __init__(self) -> None:
        self.barometer_error_m = 0.0
        self.offset_up_m = self.velocity_error_up_ms = 0.0

    def update(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        apart_m = self.barometer_error_m - self.offset_up_m
        if apart_m == self.velocity_error_up_ms == 0.0:
            return  # the case of every tick without a fault
        velocity_ms = self.velocity_error_up_ms
        self.offset_up_m += (velocity_ms + HEIGHT_GAIN_PER_S * apart_m) * dt_s
        self.velocity_error_up_ms += (VELOCITY_GAIN_PER_S2 * apart_m - HELD_PER_S * velocity_ms) * dt_s
        if abs(apart_m) < CONVERGED_M and abs(velocity_ms) < CONVERGED_MS:
            self.offset_up_m, self.velocity_error_up_ms = self.barometer_error_m, 0.0


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


class Source(IntEnum):
    """Values of EK3_SRCn_POSXY, _VELXY and _YAW that are modelled; any other is none."""

    NONE = 0
    COMPASS = 1
    GPS = 3
    EXTERNAL = 6


_BY_NUMBER = {int(source): source for source in Source}


class SourceSets:
    """Active source set, as MAV_CMD_SET_EKF_SOURCE_SET selects it; the first after a start.

    The height stays with the barometer, whatever EK3_SRCn_POSZ says.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        self._parameters = parameters
        self.restart()

    def select(self, number: float) -> bool:
        """Make a set the active one; return False for a number other than 1 to 3."""
        if int(number) not in range(1, SETS + 1):
            return False
        self.active = int(number)
        self._names = {axis: f"EK3_SRC{self.active}_{axis}" for axis in ("POSXY", "VELXY", "YAW")}
        return True

    def restart(self) -> None:
        """Make the first set the active one."""
        self.select(1)

    @property
    def position(self) -> Source:
        """Source of the horizontal position."""
        return self._source("POSXY")

    @property
    def velocity(self) -> Source:
        """Source of the horizontal velocity."""
        return self._source("VELXY")

    @property
    def heading(self) -> Source:
        """Source of the heading."""
        return self._source("YAW")

    @property
    def has_external_position(self) -> bool:
        """True if any set takes its horizontal position from external navigation."""
        values = (self._parameters[f"EK3_SRC{number}_POSXY"] for number in range(1, SETS + 1))
        return any(int(value) == Source.EXTERNAL for value in values)

    def _source(self, axis: str) -> Source:
        return _BY_NUMBER.get(int(self._parameters[self._names[axis]]), Source.NONE)
