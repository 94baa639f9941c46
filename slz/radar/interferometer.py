"""Geometry of a side-looking interferometer with a fixed baseline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
LIGHT_M_S = 299_792_458.0


@dataclass(frozen=True, slots=True)
class Interferometer:
    """Two antennas on one vehicle, looking sideways and down.

    Attributes
    ----------
    frequency_hz
        Of the carrier.
    baseline_m, tilt_deg
        From the first antenna to the second; the tilt is measured upwards from horizontal, on the side looked
        to.
    range_m, azimuth_m
        Resolution in slant range and along the track.
    looks
        Independent looks of each line.
    both_transmit
        True: each antenna transmits and receives, so that the phase difference is 4 pi / lambda times the
        difference of ranges, as in Radar letter, Eq. (1), Radar letter, Eq. (3) and Radar letter, Eq. (4).
        False: only the first transmits, as the letter's text says, and the phase difference is half of that.
    """

    frequency_hz: float = 35e9
    baseline_m: float = 0.5
    tilt_deg: float = 90.0
    range_m: float = 0.5
    azimuth_m: float = 0.8
    looks: int = 4
    both_transmit: bool = True

    def __post_init__(self) -> None:
        for name in ("frequency_hz", "baseline_m", "range_m", "azimuth_m"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"interferometer: {name} is {value}, it must be positive")
        if not np.isfinite(self.tilt_deg):
            raise ValueError(f"interferometer: tilt_deg is {self.tilt_deg}, it must be a number")
        if self.looks < 1:
            raise ValueError(f"interferometer: looks is {self.looks}, there must be one at least")

    @property
    def wavelength_m(self) -> float:
        """Wavelength of the carrier."""
        return LIGHT_M_S / self.frequency_hz

    @property
    def phase_rad_m(self) -> float:
        """Phase difference for one metre of range difference."""
        return (4 if self.both_transmit else 2) * np.pi / self.wavelength_m

    @property
    def tilt_rad(self) -> float:
        """Tilt of the baseline."""
        return float(np.radians(self.tilt_deg))

    def phase_rad(self, range_m: F64, look_rad: F64, roll_rad: float | F64 = 0.0) -> F64:
        """Return the phase difference of a point, first antenna minus second, unwrapped.

        Parameters
        ----------
        range_m
            From the first antenna.
        look_rad
            Angle of the ray from nadir, towards the side looked to.
        roll_rad
            Roll that raises the side looked to.
        """
        b = self.baseline_m
        across = np.sin(look_rad - self.tilt_rad - roll_rad)
        # As a quotient, because the difference of two ranges of 100 m would lose digits.
        far = np.sqrt(range_m**2 + b**2 - 2 * range_m * b * across)
        return np.asarray(self.phase_rad_m * (2 * range_m * b * across - b**2) / (range_m + far))

    def look_rad(self, range_m: F64, phase_rad: F64, roll_rad: float | F64 = 0.0) -> F64:
        """Return the look angle for a range and a phase difference; NaN where no ray has them.

        Of two possible rays the one nearer to a look angle of 45 degrees is returned.
        """
        b = self.baseline_m
        # Quotient S of Radar letter, Eq. (1)
        sine = (range_m**2 + b**2 - (range_m - phase_rad / self.phase_rad_m) ** 2) / (2 * range_m * b)
        with np.errstate(invalid="ignore"):
            turn = np.arcsin(sine)
        tilt = self.tilt_rad + roll_rad
        near, other = turn + tilt, np.pi - turn + tilt
        middle = np.pi / 4
        pick = np.abs(_wrapped(near - middle)) <= np.abs(_wrapped(other - middle))
        return np.asarray(middle + np.where(pick, _wrapped(near - middle), _wrapped(other - middle)))

    def height_m(
        self, altitude_m: float | F64, range_m: F64, phase_rad: F64, roll_rad: float | F64 = 0.0
    ) -> F64:
        """Return the height of a scatterer from its range and phase difference.

        With S the quotient of the equation, which is sin(look - tilt), cos(look) is cos(tilt) sqrt(1 - S^2)
        minus sin(tilt) S. The last sign of the equation as printed belongs to a tilt measured downwards,
        while Radar letter, Eq. (3) and Radar letter, Eq. (4) measure it upwards. Here it is measured upwards
        throughout.
        """
        # Radar letter, Eq. (1)
        return np.asarray(altitude_m - range_m * np.cos(self.look_rad(range_m, phase_rad, roll_rad)))

    def metres_per_radian(self, range_m: F64, look_rad: F64, roll_rad: float | F64 = 0.0) -> F64:
        """Return the derivative of height with respect to the phase difference."""
        across = np.cos(look_rad - self.tilt_rad - roll_rad)
        # Radar letter, Eq. (3), first part
        return np.asarray(range_m * np.sin(look_rad) / (self.phase_rad_m * self.baseline_m * across))


def _wrapped(angle: F64) -> F64:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
