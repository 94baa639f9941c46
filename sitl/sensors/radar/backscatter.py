"""Radar cross section of a square metre of ground, by surface and angle of incidence.

Grass and snow: the empirical model of Radar Eq. (5), sigma0 = A (g + C)^B exp(-D / (1 + 0.1 sigma_h /
lambda)), with g the grazing angle. Its constants at 35 GHz are those of the Georgia Tech group (N. C. Currie,
C. E. Brown, eds., Principles and Applications of Millimeter-Wave Radar, Artech House 1987, ch. 5; the same
table in M. A. Richards et al., Principles of Modern Radar, SciTech 2010, ch. 5). At 35 GHz, D = 0.

Sand, soil, stone and buildings: the semi-empirical model of Radar Eq. (6) after Oh, Sarabandi and Ulaby (IEEE
TGRS 30(2), 1992), with the letter's exponents for millimetre waves. The letter prints "cos^x(theta) p [...]";
here, as in Oh's paper, the root of p divides. Permittivities at 35 GHz: dry sand 2.8 - 0.05j, soil with some
water 6 - 2j, concrete 5 - 0.5j (F. T. Ulaby, R. K. Moore, A. K. Fung, Microwave Remote Sensing III, 1986,
app. E). Still water reflects the waves away: -45 dB.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Kind

F64 = NDArray[np.float64]
WATER_SIGMA0 = 10 ** (-4.5)


@dataclass(frozen=True, slots=True)
class Empirical:
    """Empirical model with the constants of Radar Eq. (5)."""

    a: float
    b: float
    c: float
    d: float

    def sigma0(self, incidence_rad: F64, roughness_m: float, wavelength_m: float) -> F64:
        """Return the cross section of a square metre."""
        grazing = np.maximum(np.pi / 2 - incidence_rad, 0.0)
        damping = np.exp(-self.d / (1 + 0.1 * roughness_m / wavelength_m))
        return np.asarray(self.a * (grazing + self.c) ** self.b * damping)


@dataclass(frozen=True, slots=True)
class SemiEmpirical:
    """Semi-empirical model with the permittivity for Radar Eq. (6), VV."""

    permittivity: complex

    def sigma0(self, incidence_rad: F64, roughness_m: float, wavelength_m: float) -> F64:
        """Return the cross section of a square metre, both polarizations vertical."""
        k_s = 2 * np.pi / wavelength_m * roughness_m
        root = np.sqrt(self.permittivity)
        upright = abs((1 - root) / (1 + root)) ** 2
        theta = np.clip(incidence_rad, 0.0, np.pi / 2)
        p = (1 - (2 * theta / np.pi) ** (1 / (3 * upright)) * np.exp(-0.4 * k_s)) ** 2
        g = 2.2 * (1 - np.exp(-0.2 * k_s))
        x = 3.5 + np.arctan(10 * (1.64 - k_s)) / np.pi
        vv, hh = _fresnel(theta, self.permittivity)
        return np.asarray(g * np.cos(theta) ** x / np.sqrt(np.maximum(p, 1e-4)) * (vv + hh))


def _fresnel(theta: F64, permittivity: complex) -> tuple[F64, F64]:
    """Return the reflected power at oblique incidence, vertically and horizontally polarized."""
    c, s = np.cos(theta), np.sin(theta)
    bent = np.sqrt(permittivity - s**2)
    hh = np.abs((c - bent) / (c + bent)) ** 2
    vv = np.abs((permittivity * c - bent) / (permittivity * c + bent)) ** 2
    return np.asarray(vv), np.asarray(hh)


GRASS = Empirical(0.125, 1.5, 0.012, 0.0)
DRY_SNOW = Empirical(2.45, 1.7, 0.0016, 0.0)
SAND = SemiEmpirical(2.8 - 0.05j)
SOIL = SemiEmpirical(6.0 - 2.0j)
BUILT = SemiEmpirical(5.0 - 0.5j)
ROUGHNESS_M = 7.77e-3
"""Standard deviation of small irregularities, Radar 2."""

_OF_KIND: dict[Kind, Empirical | SemiEmpirical] = {
    Kind.GRASS: GRASS,
    Kind.FOLIAGE: GRASS,
    Kind.SNOW: DRY_SNOW,
    Kind.SAND: SAND,
    Kind.SOIL: SOIL,
}


def sigma0(
    kind: NDArray[np.uint8], incidence_rad: F64, wavelength_m: float, roughness_m: float = ROUGHNESS_M
) -> F64:
    """Return the cross section of a square metre of each surface at an angle of incidence from its normal."""
    out = np.zeros(kind.shape)
    for k in np.unique(kind):
        own = kind == k
        if k == Kind.WATER:
            out[own] = WATER_SIGMA0
        elif k != Kind.NOTHING:
            model = _OF_KIND.get(Kind(int(k)), BUILT)
            out[own] = model.sigma0(incidence_rad[own], roughness_m, wavelength_m)
    return out
