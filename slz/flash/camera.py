"""Flash LiDAR camera: optics, clock and counts, and its frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LIGHT_M_NS = 0.299792458
FWHM_PER_SIGMA = 2.3548200450309493


@dataclass(frozen=True, slots=True)
class FlashCamera:
    """Focal plane behind a lens, each pixel with a ring buffer of samples.

    The defaults are those of Flash paper, sections 2 to 4.2: 128 x 128 pixels behind a lens of 250 mm (pixels
    of 100 um give 2.93 degrees), samples every 2.4 ns, pulses of 10 ns FWHM. Counts are those of the
    simulated instrument.

    Attributes
    ----------
    fov_deg
        Field of view across the columns.
    baseline_counts, noise_counts
        Mean and standard deviation of a sample without light.
    saturated_counts
        Samples from this value on are clipped.
    marker_counts
        A sample below is the end marker of the ring buffer.
    gate_counter
        Counter of a pixel that was never triggered.
    nearest_m, farthest_m
        Expected ranges; others are dropped.
    """

    rows: int = 128
    cols: int = 128
    fov_deg: float = 2.93
    n_samples: int = 20
    sample_ns: float = 2.4
    pulse_fwhm_ns: float = 10.0
    baseline_counts: float = 300.0
    noise_counts: float = 60.0
    saturated_counts: int = 4095
    marker_counts: int = 8
    gate_counter: int = 4_000
    nearest_m: float = 5.0
    farthest_m: float = 1_400.0

    def __post_init__(self) -> None:
        for name, low in (("rows", 2), ("cols", 2), ("n_samples", 10)):
            if getattr(self, name) < low:
                raise ValueError(f"flash camera: {name} is {getattr(self, name)}, it must be {low} or more")
        for name in ("fov_deg", "sample_ns", "pulse_fwhm_ns", "noise_counts"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"flash camera: {name} is {getattr(self, name)}, it must be positive")
        if not self.marker_counts < self.baseline_counts < self.saturated_counts:
            raise ValueError(
                "flash camera: marker_counts, baseline_counts and saturated_counts must rise, not "
                f"{self.marker_counts}, {self.baseline_counts:g}, {self.saturated_counts}"
            )

    @property
    def sample_m(self) -> float:
        """Range resolution of one sample: half the way of light in it (m)."""
        return LIGHT_M_NS * self.sample_ns / 2

    @property
    def pulse_sigma_samples(self) -> float:
        """Standard deviation of the Gaussian pulse, in samples."""
        return self.pulse_fwhm_ns / FWHM_PER_SIGMA / self.sample_ns

    @property
    def pixel_rad(self) -> float:
        """Angle between neighbouring pixels in the middle of the image."""
        return 2 * float(np.tan(np.radians(self.fov_deg) / 2)) / self.cols

    def directions(self) -> NDArray[np.float64]:
        """Return unit vectors (rows, cols, 3) of the pixels: forward, left, up of the sensor.

        Column 0 is leftmost and row 0 uppermost, seen from behind the camera; x is the optical axis.
        """
        left = -(np.arange(self.cols) - (self.cols - 1) / 2) * self.pixel_rad
        up = -(np.arange(self.rows) - (self.rows - 1) / 2) * self.pixel_rad
        vectors = np.empty((self.rows, self.cols, 3))
        vectors[..., 0], vectors[..., 1], vectors[..., 2] = 1.0, left, up[:, np.newaxis]
        return np.asarray(vectors / np.linalg.norm(vectors, axis=2, keepdims=True))


@dataclass(frozen=True, slots=True)
class FlashFrame:
    """Raw frame of one flash.

    samples : (rows, cols, n_samples) uint16, ring buffers in memory order. counter : (rows, cols) uint32,
    clock ticks from the flash to each pixel's last sample. stamp_ns : time of the flash.
    """

    samples: NDArray[np.uint16]
    counter: NDArray[np.uint32]
    stamp_ns: int = 0

    def __post_init__(self) -> None:
        shape = self.counter.shape
        if self.samples.ndim != 3 or self.samples.dtype != np.uint16 or self.samples.shape[:2] != shape:
            raise ValueError(
                f"flash frame: samples must be (rows, cols, n) uint16 beside a counter {shape}, "
                f"not {_form(self.samples)}"
            )
        if self.counter.dtype != np.uint32:
            raise ValueError(f"flash frame: the counter must be uint32, not {self.counter.dtype}")

    def require(self, camera: FlashCamera) -> None:
        """Raise ValueError if the frame does not fit this camera."""
        wanted = (camera.rows, camera.cols, camera.n_samples)
        if self.samples.shape != wanted:
            raise ValueError(
                f"flash frame: {self.samples.shape} samples, but the camera has {wanted}: "
                "give the camera's own rows, cols and n_samples"
            )


def _form(array: NDArray[Any]) -> str:
    return f"{array.shape} {array.dtype}"
