"""Range and intensity of every pixel from its waveform (Flash paper, sections 4.2-4.3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from slz.flash.camera import FlashCamera, FlashFrame
from slz.kernels.instruments.waveform import GOOD, MISSING, likely_peaks, polynomial_peaks

DEGREE = 6
LEAST_SIGMAS = 4.0  # a maximum below half as many standard deviations of the noise is no return

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RangeImage:
    """Ranges of one frame; arrays (rows, cols).

    range_m : float64, NaN without a valid range. intensity : float64, counts over the baseline.
    sigma_m : float64, standard error of the range due to noise, NaN where unknown.
    state : uint8, MISSING, GOOD, SATURATED or ODD of `waveform`; only GOOD pixels have a range.
    """

    range_m: F64
    intensity: F64
    sigma_m: F64
    state: NDArray[np.uint8]


def polynomial_ranges(frame: FlashFrame, camera: FlashCamera) -> RangeImage:
    """Return ranges at the maximum of a 6th-degree polynomial, as in the source (Flash paper, section 4.2).

    Raises
    ------
    ValueError
        The frame does not fit this camera.
    """
    frame.require(camera)
    ticks, height, state = _empty(camera)
    polynomial_peaks(
        np.ascontiguousarray(frame.samples), frame.counter, camera.gate_counter,
        polynomial_map(camera.n_samples - 1), camera.marker_counts, camera.baseline_counts,
        camera.saturated_counts, LEAST_SIGMAS * camera.noise_counts / 2, ticks, height, state,
    )  # fmt: skip
    return _image(camera, ticks, height, np.full_like(ticks, np.nan), state)


def likely_ranges(frame: FlashFrame, camera: FlashCamera) -> RangeImage:
    """Return ranges of the most likely Gaussian pulse, with standard errors; clipped samples are left out.

    Raises
    ------
    ValueError
        The frame does not fit this camera.
    """
    frame.require(camera)
    ticks, height, state = _empty(camera)
    error = np.empty_like(ticks)
    likely_peaks(
        np.ascontiguousarray(frame.samples), frame.counter, camera.gate_counter,
        camera.pulse_sigma_samples, camera.noise_counts, camera.marker_counts, camera.baseline_counts,
        camera.saturated_counts, LEAST_SIGMAS * camera.noise_counts / 2, ticks, height, error, state,
    )  # fmt: skip
    return _image(camera, ticks, height, error * camera.sample_m, state)


@cache
def polynomial_map(count: int, degree: int = DEGREE) -> F64:
    """Return the least-squares map (degree + 1, count) from samples to coefficients of powers of -1 ... 1."""
    u = np.linspace(-1.0, 1.0, count)
    fit: F64 = np.ascontiguousarray(np.linalg.pinv(np.vander(u, degree + 1, increasing=True)))
    fit.setflags(write=True)
    return fit


def range_bound_m(camera: FlashCamera, noise_share: float) -> float:
    """Return the Cramér-Rao bound of the range of one waveform (m), with unknown pulse height.

    Parameters
    ----------
    noise_share
        Standard deviation of the noise over the maximum of the pulse.
    """
    t = np.arange(camera.n_samples - 1) - (camera.n_samples - 2) / 2
    pulse = np.exp(-0.5 * (t / camera.pulse_sigma_samples) ** 2)
    slope = pulse * t / camera.pulse_sigma_samples**2
    left = float(slope @ slope - (slope @ pulse) ** 2 / (pulse @ pulse))
    return float(noise_share / np.sqrt(left) * camera.sample_m)


def _empty(camera: FlashCamera) -> tuple[F64, F64, NDArray[np.uint8]]:
    shape = camera.rows, camera.cols
    return np.empty(shape), np.empty(shape), np.empty(shape, np.uint8)


def _image(
    camera: FlashCamera, ticks: F64, height: F64, sigma_m: F64, state: NDArray[np.uint8]
) -> RangeImage:
    range_m = ticks * camera.sample_m
    state[(state == GOOD) & ~((range_m >= camera.nearest_m) & (range_m <= camera.farthest_m))] = MISSING
    range_m[state != GOOD] = np.nan
    return RangeImage(range_m, height, sigma_m, state)
