"""Wind on water: slopes of the facets, and waves that move over it.

Mean square slope of a clean surface in wind U at 10 m: 0.003 + 0.00512 U (C. Cox and W. Munk, J. Opt. Soc.
Am. 44, 1954). Below 0.7 m/s the wind raises no ripples (K. K. Kahma and M. A. Donelan, J. Fluid Mech. 192,
1988): a sheltered pond keeps a slope of 1.3 degrees.

Waves over a fetch F: significant height 0.0016 U sqrt(F / g), peak frequency 3.5 (g / U) (g F / U^2)^-0.33
(JONSWAP, K. Hasselmann et al., 1973). They are a sum of sines about the wind's direction, which move as
waves on deep water do, omega^2 = g k.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
GRAVITY = 9.81
RIPPLE_WIND_MS = 0.7
CALM_SQUARE_SLOPE = 0.0005
_SINES = 8


@dataclass(frozen=True, slots=True)
class WaterState:
    """State of all standing water of a world.

    Attributes
    ----------
    wind_ms
        Wind at 10 m.
    fetch_m
        Length of water that the wind blows over.
    towards_rad
        Direction of the waves, counter-clockwise from east.
    turbid
        Diffuse reflectance of what floats in deep water; 0.01 to 0.03 near 900 nm for muddy water (K. Ruddick
        et al., Limnology and Oceanography 51, 2006), none for clear.
    """

    wind_ms: float = 2.0
    fetch_m: float = 60.0
    towards_rad: float = 0.6
    turbid: float = 0.0

    @property
    def square_slope(self) -> float:
        """Mean square slope of the facets, both directions together."""
        return CALM_SQUARE_SLOPE if self.wind_ms < RIPPLE_WIND_MS else 0.003 + 0.00512 * self.wind_ms

    @property
    def height_rms_m(self) -> float:
        """Standard deviation of the height: a quarter of the significant wave height."""
        if self.wind_ms < RIPPLE_WIND_MS:
            return 0.0
        return 0.25 * 0.0016 * self.wind_ms * math.sqrt(self.fetch_m / GRAVITY)

    @property
    def facets(self) -> float:
        """Number of independent glints that a beam sees: few in calm, so that returns come or fail."""
        return 0.5 + 0.35 * self.wind_ms

    def height_m(self, x: F64, y: F64, time_s: F64) -> F64:
        """Return the height of the waves over the level at places and times."""
        if self.height_rms_m == 0.0:
            return np.zeros_like(x)
        u = self.wind_ms
        peak_hz = 3.5 * GRAVITY / u * (GRAVITY * self.fetch_m / u**2) ** -0.33
        # Frequencies about the peak, and directions within 50 degrees of the wind; both fixed, uneven.
        share = (np.arange(_SINES) + 0.5) / _SINES
        omega = 2.0 * math.pi * peak_hz * (0.8 + 1.1 * share**1.5)
        heading = self.towards_rad + np.radians(50.0) * np.sin(2.399963 * np.arange(_SINES) * 3.0)
        k = omega**2 / GRAVITY
        weight = (omega / omega[0]) ** -2.5
        amplitude = self.height_rms_m * math.sqrt(2.0) * weight / math.sqrt(float(np.sum(weight**2)))
        height = np.zeros_like(x)
        for n in range(_SINES):
            along = np.cos(heading[n]) * x + np.sin(heading[n]) * y
            height += amplitude[n] * np.sin(k[n] * along - omega[n] * time_s + 2.399963 * n)
        return height
