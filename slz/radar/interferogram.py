"""Interferogram of one observation with its coherence, flat Earth removed (Radar letter, section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.radar.interferometer import Interferometer

F64 = NDArray[np.float64]
C64 = NDArray[np.complex64]
WINDOW = (3, 5)
"""Lines and bins over which coherence is estimated."""
LEAST_BAND = 0.2
"""Least share of the bandwidth that the filter keeps."""
LOBES = 3.0
"""Half length of a filter, in units of its resolution."""


@dataclass(frozen=True, slots=True)
class RadarLines:
    """One observation: two complex images and the poses of their lines.

    samples : (lines, looks, 2, bins) complex64, of the first and the second antenna, at ranges first_m + k
    step_m (slant, m). position_m : (lines, 3) float64, first antenna in the map frame. heading_rad : course
    over ground, clockwise from north; the radar looks to the right of it. roll_rad : (lines,) roll that
    raises the side looked to. level_m : height of the ground around, to half an ambiguity (about 0.4 m).
    """

    samples: NDArray[np.complex64]
    first_m: float
    step_m: float
    position_m: F64
    heading_rad: float
    roll_rad: F64
    level_m: float = 0.0

    def __post_init__(self) -> None:
        shape = self.samples.shape
        if len(shape) != 4 or shape[2] != 2 or self.samples.dtype != np.complex64:
            raise ValueError(
                "radar lines: samples must be (lines, looks, 2, bins) complex64, "
                f"not {shape} {self.samples.dtype}"
            )
        if shape[0] < 2 or shape[1] < 1 or shape[3] < 8:
            raise ValueError(f"radar lines: {shape} are too few: give 2 lines and 8 bins at least")
        if self.position_m.shape != (shape[0], 3) or self.roll_rad.shape != (shape[0],):
            raise ValueError(
                f"radar lines: {shape[0]} lines need as many positions and rolls, "
                f"not {self.position_m.shape} and {self.roll_rad.shape}"
            )
        if not (self.first_m > 0 and self.step_m > 0):
            raise ValueError(f"radar lines: ranges begin at {self.first_m} m, step {self.step_m} m")
        track = (self.position_m, self.roll_rad, np.array([self.heading_rad, self.level_m]))
        if not all(np.isfinite(part).all() for part in track):
            raise ValueError("radar lines: position, heading, roll or level is not finite")
        if (self.altitude_m <= 0).any():
            raise ValueError(
                f"radar lines: the track is {self.altitude_m.min():.1f} m over the ground at level_m "
                f"{self.level_m:g}: it must be above it"
            )

    @property
    def ranges_m(self) -> F64:
        """Slant ranges of the bins."""
        return np.asarray(self.first_m + self.step_m * np.arange(self.samples.shape[3]))

    @property
    def altitude_m(self) -> F64:
        """Height of each line over the ground's level."""
        return np.asarray(self.position_m[:, 2] - self.level_m)

    def require(self, radar: Interferometer) -> None:
        """Raise ValueError if the samples do not fit this radar."""
        if self.samples.shape[1] != radar.looks:
            raise ValueError(
                f"radar lines: {self.samples.shape[1]} looks, but the interferometer has {radar.looks}"
            )
        if self.step_m > radar.range_m * (1 + 1e-9):
            raise ValueError(
                f"radar lines: bins of {self.step_m} m are wider than the resolution {radar.range_m} m"
            )


@dataclass(frozen=True, slots=True)
class Interferogram:
    """Multilook interferogram; arrays (lines, bins).

    phase_rad : wrapped, after removal of the flat-Earth phase. flat_rad : flat-Earth phase. coherence : 0
    to 1, corrected for the bias of few looks. power : of the first image.
    """

    phase_rad: F64
    flat_rad: F64
    coherence: F64
    power: F64


def interferogram(lines: RadarLines, radar: Interferometer, common_band: bool = True) -> Interferogram:
    """Return the multilook interferogram of two images, flat Earth removed.

    Parameters
    ----------
    common_band
        Filter both images to their common band of the ground's spectrum first. Seen from the second
        antenna, the ground's spectrum is shifted by the share of the bandwidth by which Radar letter, Eq. (4)
        reduces the coherence. Without that band the coherence is that of the noise alone, at a proportionally
        coarser resolution (Gatelli et al., IEEE TGRS 32(4), 1994). The letter does not filter.

    Raises
    ------
    ValueError
        The lines do not fit this radar, or none of their ranges reaches the ground.
    """
    lines.require(radar)
    r = lines.ranges_m
    altitude = lines.altitude_m[:, np.newaxis]
    lit = r > altitude
    if not lit.any():
        raise ValueError(
            f"radar: ranges to {r[-1]:.1f} m do not reach the ground {altitude.min():.1f} m below"
        )
    look = np.arccos(np.minimum(altitude / r, 1.0))
    flat = radar.phase_rad(r, look, lines.roll_rad[:, np.newaxis])
    middle = flat.mean(axis=0)
    first, second = _aligned(lines, radar, middle)
    turn = np.exp(-0.5j * flat).astype(np.complex64)[:, np.newaxis]
    first, second = first * turn, second * turn.conj()
    if common_band:
        band = _filter(r, lines.step_m, radar, look.mean(axis=0))
        first, second = _mixed(first, band), _mixed(second, band)
    product = (first * second.conj()).sum(axis=1).astype(np.complex128)  # Radar letter, Eq. (7)
    powers = [(np.abs(image) ** 2).sum(axis=1).astype(np.float64) for image in (first, second)]
    coherence = _coherence(product, powers[0], powers[1], radar.looks)
    coherence[~lit] = 0.0
    return Interferogram(np.angle(product), flat, coherence, powers[0] / radar.looks)  # Radar letter, Eq. (8)


def _aligned(lines: RadarLines, radar: Interferometer, flat_rad: F64) -> tuple[C64, C64]:
    """Return both images, the second resampled to the ranges of the same ground in the first."""
    r = lines.ranges_m
    shift = flat_rad * radar.wavelength_m / (4 * np.pi)
    onto = np.sinc((r[:, np.newaxis] - (r - shift)[np.newaxis]) / lines.step_m)
    return lines.samples[:, :, 0], _mixed(lines.samples[:, :, 1], onto)


def _mixed(image: C64, matrix: F64) -> C64:
    """Return an image times a real matrix over its bins, in single precision."""
    bins = image.shape[-1]
    flat, m = image.reshape(-1, bins), matrix.astype(np.float32)
    out = np.empty((len(flat), matrix.shape[1]), np.complex64)
    out.real, out.imag = flat.real @ m, flat.imag @ m
    return out.reshape(*image.shape[:-1], -1)


def _filter(r: F64, step_m: float, radar: Interferometer, look_rad: F64) -> F64:
    """Return the matrix (bins, bins) of a low-pass filter to the band common to both images at each range."""
    across = np.abs(radar.baseline_m * np.cos(look_rad - radar.tilt_rad))
    paths = radar.phase_rad_m / (2 * np.pi)
    with np.errstate(divide="ignore"):
        lost = paths * across * radar.range_m / (r * np.tan(np.maximum(look_rad, 1e-3)))
    width = radar.range_m / np.maximum(1 - lost, LEAST_BAND)
    away = (r[:, np.newaxis] - r[np.newaxis]) / width[np.newaxis]
    shape = np.sinc(away) * np.where(np.abs(away) < LOBES, 0.5 + 0.5 * np.cos(np.pi * away / LOBES), 0.0)
    return np.asarray(shape * step_m / width)


def _coherence(product: NDArray[np.complex128], first: F64, second: F64, looks: int) -> F64:
    """Return the windowed coherence, unbiased: for pure noise its mean is 0, not the root of 1 / looks."""
    mean = [ndimage.uniform_filter(part, WINDOW) for part in (product.real, product.imag, first, second)]
    with np.errstate(invalid="ignore", divide="ignore"):
        square = (mean[0] ** 2 + mean[1] ** 2) / (mean[2] * mean[3])
    n = looks * WINDOW[0] * max(1.0, WINDOW[1] / 2)
    return np.asarray(np.sqrt(np.clip((n * np.nan_to_num(square) - 1) / (n - 1), 0.0, 1.0)))
