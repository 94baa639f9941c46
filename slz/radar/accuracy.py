"""Accuracy of an interferometer: coherence, phase error and height error."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slz.radar.interferometer import Interferometer

F64 = NDArray[np.float64]


def coherence(
    radar: Interferometer,
    altitude_m: float,
    look_rad: ArrayLike,
    roughness_m: float = 7.77e-3,
    snr_db: float = 13.0,
) -> F64:
    """Return the coherence of the two images over level ground; 0 beyond the critical baseline.

    Parameters
    ----------
    roughness_m
        Standard deviation of small irregularities, sigma_h.
    """
    look = np.asarray(look_rad, np.float64)
    range_m = altitude_m / np.cos(look)
    across = radar.baseline_m * np.cos(look - radar.tilt_rad)
    half_paths = radar.phase_rad_m * radar.wavelength_m / (2 * np.pi)  # 2 where both transmit
    share = half_paths * np.abs(across) * radar.range_m / (radar.wavelength_m * range_m * np.tan(look))
    volume = 2 * np.pi**2 * (roughness_m * across / (radar.wavelength_m * range_m * np.sin(look))) ** 2
    noise = 1 / (1 + 10 ** (-snr_db / 10))
    # Radar letter, Eq. (4)
    return np.asarray(noise * np.maximum(0.0, 1 - share) * np.exp(-volume))


def phase_error_rad(coherence_: ArrayLike, looks: float) -> F64:
    """Return the standard deviation of the multilook phase: a bound that is reached with many looks."""
    gamma = np.asarray(coherence_, np.float64)
    with np.errstate(divide="ignore"):
        # Radar letter, Eq. (3), second part
        return np.asarray(np.sqrt(np.maximum(0.0, 1 - gamma**2)) / (gamma * np.sqrt(2 * looks)))


def height_error_m(
    radar: Interferometer,
    altitude_m: float,
    look_rad: ArrayLike,
    roughness_m: float = 7.77e-3,
    snr_db: float = 13.0,
) -> F64:
    """Return the standard deviation of heights due to that of the phase; inf without coherence."""
    look = np.asarray(look_rad, np.float64)
    gamma = coherence(radar, altitude_m, look, roughness_m, snr_db)
    scale = np.abs(radar.metres_per_radian(altitude_m / np.cos(look), look))
    return np.asarray(scale * phase_error_rad(gamma, radar.looks))  # Radar letter, Eq. (3)


def whole_height_error_m(phase_m: float, altitude_m: float, range_m: float, baseline_m: float) -> float:
    """Return the total height error: root of the sum of squares of four independent errors."""
    # Radar letter, Eq. (2)
    return float(np.sqrt(phase_m**2 + altitude_m**2 + range_m**2 + baseline_m**2))
