"""Synthetic frames: Gaussian pulses, white noise, randomly rotated ring buffers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.flash.camera import FlashCamera, FlashFrame

F64 = NDArray[np.float64]
LAST = 700  # counter of every pixel


def noisy_camera(share: float, height: float = 1500.0, **more: object) -> FlashCamera:
    """Return a camera whose noise is a share of pulses of this height, and that clips far above them."""
    settings: dict[str, object] = {
        "baseline_counts": 8000.0,
        "noise_counts": max(share, 1e-4) * height,
        "saturated_counts": 60_000,
    }
    return FlashCamera(**(settings | more))  # type: ignore[arg-type]


def frame_of(
    camera: FlashCamera, peak: F64, height: F64 | float, share: float, seed: int = 1
) -> tuple[FlashFrame, F64]:
    """Return a frame of pulses at `peak` (samples from the oldest) and the true ranges (m)."""
    rng = np.random.default_rng(seed)
    n = camera.n_samples
    high = np.broadcast_to(height, peak.shape)[..., np.newaxis]
    y = high * np.exp(-0.5 * ((np.arange(n) - peak[..., np.newaxis]) / camera.pulse_sigma_samples) ** 2)
    y = camera.baseline_counts + y + share * high * rng.standard_normal(y.shape)
    y = np.clip(np.rint(y), 20, camera.saturated_counts)
    y[..., -1] = 0
    turn = rng.integers(0, n, peak.shape)
    ring = np.take_along_axis(y, (np.arange(n) - turn[..., np.newaxis]) % n, axis=2).astype(np.uint16)
    counter = np.full(peak.shape, LAST, np.uint32)
    return FlashFrame(ring, counter), (LAST - (n - 1) + peak) * camera.sample_m


def some_peaks(camera: FlashCamera, seed: int = 2, spread: float = 0.5) -> F64:
    """Return places of the peaks, uniform within a sample of the middle of the buffer."""
    rng = np.random.default_rng(seed)
    middle = (camera.n_samples - 2) / 2
    return np.asarray(middle + rng.uniform(-spread, spread, (camera.rows, camera.cols)))
