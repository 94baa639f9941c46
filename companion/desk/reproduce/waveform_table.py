"""Ranging errors of noisy Gaussian pulses, with the ranging used in flight (Flash paper, Table 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.frame_processing import process_frame
from slz.flash.ranging import range_bound_m

F64 = NDArray[np.float64]
LEVELS = (0.05, 0.1, 0.2, 0.3)
SOURCE_CM = ((2.2, 1.5), (3.3, 2.6), (6.9, 4.8), (9.9, 8.1))
COUNTS = 1500.0
LAST = 700
MEAN_OF_NORMAL, STD_OF_NORMAL = (2 / np.pi) ** 0.5, (1 - 2 / np.pi) ** 0.5

Cell = tuple[float, float]
"""Mean and standard deviation of the absolute error, cm."""


@dataclass(frozen=True, slots=True)
class Level:
    """Errors at one level of noise, cm: the source's, and those of slz.

    waveform: pixel by pixel, polynomial and likelihood. image: after the 9-point median. bound: an unbiased
    estimator at the Cramér-Rao bound of one waveform. pooled: of nine waveforms together.
    """

    share: float
    source: Cell
    waveform: tuple[Cell, Cell]
    image: tuple[Cell, Cell]
    bound: Cell
    pooled: Cell


def levels(seed: int = 1) -> list[Level]:
    """Return the errors over a frame of 128 x 128 waveforms for each level of the source."""
    return [_level(share, source, seed) for share, source in zip(LEVELS, SOURCE_CM, strict=True)]


def _level(share: float, source: Cell, seed: int) -> Level:
    """Measure a plane tilted by one sample across the image, so that pulses have every phase of the clock."""
    camera = FlashCamera(baseline_counts=8000.0, noise_counts=share * COUNTS, saturated_counts=60_000)
    middle = (camera.n_samples - 2) / 2
    peak = np.broadcast_to(middle + np.linspace(-0.5, 0.5, camera.cols), (camera.rows, camera.cols))
    frame, true_m = _frame(camera, peak, share, seed)
    waveform, image = [], []
    for estimator in ("polynomial", "likely"):
        found = process_frame(frame, camera, estimator)
        waveform.append(_cell(found.measured.range_m - true_m))
        image.append(_cell(found.filtered_m - true_m))
    bound = 100 * range_bound_m(camera, share)
    return Level(
        share,
        source,
        (waveform[0], waveform[1]),
        (image[0], image[1]),
        (bound * MEAN_OF_NORMAL, bound * STD_OF_NORMAL),
        (bound / 3 * MEAN_OF_NORMAL, bound / 3 * STD_OF_NORMAL),
    )


def _frame(camera: FlashCamera, peak: F64, share: float, seed: int) -> tuple[FlashFrame, F64]:
    rng = np.random.default_rng(seed)
    n = camera.n_samples
    pulse = np.exp(-0.5 * ((np.arange(n) - peak[..., np.newaxis]) / camera.pulse_sigma_samples) ** 2)
    y = camera.baseline_counts + COUNTS * (pulse + share * rng.standard_normal(pulse.shape))
    y = np.clip(np.rint(y), 20, camera.saturated_counts)
    y[..., -1] = 0
    ring = np.roll(y, 7, axis=2).astype(np.uint16)
    counter = np.full(peak.shape, LAST, np.uint32)
    return FlashFrame(ring, counter), (LAST - (n - 1) + peak) * camera.sample_m


def _cell(error_m: F64) -> Cell:
    size = 100 * np.abs(error_m[np.isfinite(error_m)])
    return float(size.mean()), float(size.std())
