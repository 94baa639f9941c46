"""Line buffer of complex radar images, recorded line by line along the track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.radar.interferometer import Interferometer

F64 = NDArray[np.float64]


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
