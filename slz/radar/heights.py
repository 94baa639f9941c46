"""Height points of one observation from its interferogram, with standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from slz.kernels.instruments.phase_unwrapping import unwrap_by_quality
from slz.radar.interferogram import Interferogram, RadarLines
from slz.radar.interferometer import Interferometer

F64 = NDArray[np.float64]
LEAST_COHERENCE = 0.8
"""Less means water, shadow, noise, or several heights in a cell: level ground has 0.9."""
DARK = (3, 5)
"""Lines and bins of the smallest area that counts as dark, and of the margin discarded around it."""
LEAST_REGION = 0.02
"""Share of the largest region, below which a region's number of turns is too uncertain to use it."""
FLOOR_M = 0.01


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


@dataclass(frozen=True, slots=True)
class Heights:
    """Points of one observation, arrays of one length.

    points_m : (n, 3) in the map frame. sigma_m : standard deviation of the height. turn_m : change of the
    height with a whole turn of the phase. ahead : (2,) east and north of the track's direction. line,
    range_m, look_rad : line of each point, and its range and look angle (from nadir) at that line.
    """

    points_m: F64
    sigma_m: F64
    turn_m: F64
    ahead: F64
    line: NDArray[np.int64]
    range_m: F64
    look_rad: F64


def heights(
    image: Interferogram,
    lines: RadarLines,
    radar: Interferometer,
    least_coherence: float = LEAST_COHERENCE,
) -> Heights:
    """Unwrap the phase and convert it to points.

    Points without coherence and small disconnected regions are left out. The number of whole turns of each
    region is chosen so that the median of its phase is nearest to that of the given level.
    """
    phase, region = unwrap_by_quality(
        image.phase_rad, _away_from_dark(image.coherence, least_coherence), least_coherence
    )
    counts = np.bincount(region.ravel())
    counts[0] = 0
    if not counts.any():
        nothing = np.empty(0)
        none = np.empty(0, np.int64)
        return Heights(np.empty((0, 3)), nothing, nothing, _ahead(lines), none, nothing, nothing)
    used = np.zeros(region.shape, bool)
    for number in np.flatnonzero(counts >= LEAST_REGION * counts.max()):
        own = region == number
        phase[own] -= 2 * np.pi * np.rint(np.median(phase[own]) / (2 * np.pi))
        used |= own
    line, column = np.nonzero(used)
    r, roll = lines.ranges_m[column], lines.roll_rad[line]
    altitude = lines.altitude_m[line]
    total = image.flat_rad[used] + phase[used]
    look = radar.look_rad(r, total, roll)
    up = altitude - r * np.cos(look)  # Radar letter, Eq. (1)
    scale = np.abs(radar.metres_per_radian(r, look, roll))
    sigma = np.hypot(scale * phase_error_rad(image.coherence[used], radar.looks), FLOOR_M)
    ahead = _ahead(lines)
    right = np.array([ahead[1], -ahead[0]])
    across = r * np.sin(look)
    place = lines.position_m[line, :2] + across[:, np.newaxis] * right
    points = np.column_stack([place, up + lines.level_m])
    sound = np.isfinite(points).all(axis=1) & np.isfinite(sigma)
    turn = 2 * np.pi * scale[sound]
    return Heights(points[sound], sigma[sound], turn, ahead, line[sound], r[sound], look[sound])


def _away_from_dark(coherence: F64, least: float) -> F64:
    """Return the coherence, 0 next to larger dark areas: cells of the water there hold part of the shore."""
    dark = ndimage.binary_opening(coherence < least, np.ones(DARK, bool))
    return np.where(ndimage.binary_dilation(dark, np.ones(DARK, bool)), 0.0, coherence)


def _ahead(lines: RadarLines) -> F64:
    return np.array([np.sin(lines.heading_rad), np.cos(lines.heading_rad)])
