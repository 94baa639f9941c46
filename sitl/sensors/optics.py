"""Error model of a LiDAR's optics: range and reflectivity limits, noise, false returns, and their truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array2D
from sitl.compilation import kernel
from sitl.sensors.particles import Particles
from sitl.world.hits import DUST, GHOST

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Flags = NDArray[np.bool_]

FAINTEST = 1e-4
"""Brightness below which an echo is lost at any range."""
TAIL_SIGMA_M = 0.05
"""Standard deviation of the range errors of `Noise.tail`.

A recorded OS0 has 0.16 % of its errors on smooth surfaces between 7.5 and 15 cm, which 1.2 % of such returns
give; a VLP-16 has 0.05 %, fewer than the deviation of the simulated one gives without a tail.
(docs/benchmark/second-opinion.md)
"""


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of a real sensor; probabilities are per pulse.

    Tails, errors of intensities and of rows, and divided beams are those of recordings of a VLP-16 and an
    OS0 (docs/benchmark/second-opinion.md); other sensors have the intensities of a VLP-16.
    """

    range_sigma_m: float = 0.02
    angle_sigma_deg: float = 0.15
    dropout: float = 0.005
    ghost: float = 1e-4
    dust: float = 1e-4
    tagged: float = 0.7
    """Share of ghosts and dust that the sensor marks, if it marks any."""
    tail: float = 0.0
    """Share of the returns whose range error has the deviation `TAIL_SIGMA_M`."""
    intensity_sigma: float = 0.1
    """Relative error of the brightness."""
    row_sigma_m: float = 0.0
    """Standard deviation of the constant range error of each laser."""
    divided: bool = True
    """True if an edge divides a beam: returns between two surfaces, second returns, fainter edges."""
    particles: Particles | None = None
    """Plumes of dust, rain or snow beside the even, bright specks of `dust`."""

    @property
    def tail_factor(self) -> float:
        """Deviation of the tail in that of the other returns."""
        return max(1.0, TAIL_SIGMA_M / self.range_sigma_m) if self.range_sigma_m > 0.0 else 1.0

    @classmethod
    def none(cls) -> Noise:
        """Return a sensor without noise (limits of range and of reflectivity stay)."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, tail=0.0, intensity_sigma=0.0, divided=False)


@dataclass(frozen=True, slots=True)
class Reach:
    """Range limits of a sensor: blind below `blind_m`, none beyond `most_m`, two ranges by reflectivity."""

    blind_m: float
    most_m: float
    at_10_percent_m: float
    at_80_percent_m: float

    def limit_m(self, bright: F64) -> F64:
        """Return the greatest ranges of returns by reflectance times the cosine of incidence."""
        exponent = np.log(self.at_80_percent_m / self.at_10_percent_m) / np.log(0.8 / 0.1)
        limit: F64 = self.at_10_percent_m * (np.maximum(bright, 1e-6) / 0.1) ** exponent
        return limit

    def faint(self, bright: F64) -> F64:
        """Return the brightness for `limit_m` of echoes that return less than 10 %.

        Two ranges of a data sheet give the exponent between them, where the receiver's dynamics count. Below,
        the range is that at which the power, bright / range^2, is the one of 10 %.
        """
        exponent = np.log(self.at_80_percent_m / self.at_10_percent_m) / np.log(0.8 / 0.1)
        return np.where(bright < 0.1, 0.1 * (np.maximum(bright, 0.0) / 0.1) ** (0.5 / exponent), bright)


@dataclass(frozen=True, slots=True)
class Echoes:
    """Measurements of pulses.

    range_m: (n,) of the return of a sensor that reports one: the strongest. behind_m: (n,) of the last
    return. other_m: (n,) of the second return beside the last one. Zero is no return; the three are equal
    where there is one echo. behind_bright, other_bright: (n,) reflectance times cosine of incidence. ghost,
    dust: (n,) false returns; marked: (n,) whether the sensor would recognise them.
    """

    range_m: F64
    behind_m: F64
    other_m: F64
    behind_bright: F64
    other_bright: F64
    ghost: Flags
    dust: Flags
    marked: Flags


def tilt(unit: F64, normal: F64, sigma_deg: float) -> F64:
    """Tilt unit vectors (n, 3) at random; sigma is that of the whole angle, shared by two axes.

    The first two columns of `normal`, (n, 4) standard normal numbers, are used.
    """
    if sigma_deg == 0.0:
        return unit
    out = np.empty_like(unit)
    tilt_at_random(unit, normal, float(np.radians(sigma_deg) / np.sqrt(2.0)), out)
    return out


@kernel
def tilt_at_random(
    unit: Array2D[np.float64], normal: Array2D[np.float64], sigma_rad: float, out: Array2D[np.float64]
) -> None:
    """Write unit vectors tilted by sigma about each of two axes."""
    for n in range(unit.shape[0]):
        x, y, z = unit[n, 0], unit[n, 1], unit[n, 2]
        flat = math.sqrt(x * x + y * y)
        across_x, across_y = -y / flat, x / flat  # up x unit
        aside, up = sigma_rad * normal[n, 0], sigma_rad * normal[n, 1]
        tx = x + aside * across_x - up * z * across_y
        ty = y + aside * across_y + up * z * across_x
        tz = z + up * flat
        length = math.sqrt((tx * tx + tz * tz) + ty * ty)
        out[n, 0], out[n, 1], out[n, 2] = tx / length, ty / length, tz / length


@dataclass(frozen=True, slots=True)
class Hits:
    """Sources of the three ranges of `Echoes`, (n,) codes of `sitl.world.hits` each."""

    strongest: I64
    behind: I64
    other: I64

    def __getitem__(self, cut: slice) -> Hits:
        return Hits(*(getattr(self, f.name)[cut] for f in fields(self)))

    def followed_by(self, later: Hits) -> Hits:
        """Return these hits followed by later ones."""
        return Hits(*(np.concatenate([getattr(self, f.name), getattr(later, f.name)]) for f in fields(self)))

    def falsified(self, echoes: Echoes) -> Hits:
        """Return the hits with the false returns among them."""
        if not (echoes.ghost.any() or echoes.dust.any()):
            return self
        strongest, behind, other = (
            np.where(echoes.ghost, GHOST, hit) for hit in (self.strongest, self.behind, self.other)
        )
        return Hits(np.where(echoes.dust, DUST, strongest), behind, np.where(echoes.dust, DUST, other))
