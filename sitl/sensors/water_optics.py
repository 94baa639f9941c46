"""Light of a LiDAR on water: reflection at the surface, and return from the bottom.

Brightness is what `Reach.detected` compares: the reflectance of a diffuse target times its cosine of
incidence that would return the same power.

Surface: only facets whose normal points at the sensor return light. The radar equation of a rough surface
with Gaussian slopes, sigma0 = R(0) / s2 sec^4 t exp(-tan^2 t / s2) (D. E. Barrick, IEEE Trans. AP 16, 1968;
for LiDAR J. L. Bufton, F. E. Hoge and R. N. Swift, Applied Optics 22, 1983), is sigma0 / (4 cos t) in
brightness, since a diffuse surface of reflectance r has sigma0 = 4 r cos^2 t. s2 is the mean square slope of
both directions together.

Bottom: the light passes the surface twice, 1 - R each way, is absorbed along depth / cos t_w twice, is
reflected diffusely, and spreads by n^2 in solid angle on leaving the water (C. D. Mobley, Light and Water,
1994, ch. 4).

Index of refraction 1.328 near 900 nm; absorption 6.8 per metre at 900 nm and 4.9 at 865 nm (G. M. Hale and
M. R. Querry, Applied Optics 12, 1973; L. Kou, D. Labrie and P. Chylek, Applied Optics 32, 1993), 7 at 905 nm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
INDEX = 1.328
GROUP_INDEX = 1.33
"""Light travels in water at 1 / 1.33 of its speed in air, so a range measured in it is 1.33 times longer."""
ABSORPTION_PER_M = {905: 7.0, 865: 4.9}
"""By wavelength in nm."""
FILM_SQUARE_SLOPE = 0.03
"""Of a water film on the grains of asphalt: our choice, a glossy patch 10 degrees wide about the nadir."""


def fresnel(cosine: F64, index: float = INDEX) -> F64:
    """Return the reflectance of a smooth surface for unpolarised light from air.

    Parameters
    ----------
    cosine
        Of the angle of incidence.
    index
        Index of refraction behind the surface.
    """
    inside = cosine_inside(cosine, index)
    across = ((cosine - index * inside) / (cosine + index * inside)) ** 2
    along = ((index * cosine - inside) / (index * cosine + inside)) ** 2
    return np.asarray((across + along) / 2)


def cosine_inside(cosine: F64, index: float = INDEX) -> F64:
    """Return the cosine of the refracted ray by Snell's law."""
    return np.sqrt(1.0 - (1.0 - np.asarray(cosine) ** 2) / index**2)


def surface_brightness(cosine: F64, square_slope: float) -> F64:
    """Return the mean brightness of a water surface.

    Parameters
    ----------
    cosine
        Of the angle of incidence on the level surface.
    square_slope
        Mean square slope of the facets.
    """
    c = np.maximum(cosine, 1e-3)
    tan2 = 1.0 / c**2 - 1.0
    upright = fresnel(np.ones(1))[0]
    return np.asarray(upright / (4.0 * square_slope * c**5) * np.exp(-tan2 / square_slope))


def bottom_brightness(cosine: F64, depth_m: F64, reflectance: F64, absorption_per_m: float) -> F64:
    """Return the brightness of a level bottom below the water.

    Parameters
    ----------
    cosine
        Of the angle of incidence on the water.
    depth_m
        Depth, inf for none visible.
    reflectance
        Diffuse reflectance of the bottom.
    """
    inside = cosine_inside(cosine)
    passed = (1.0 - fresnel(cosine)) ** 2 / INDEX**2
    return np.asarray(passed * reflectance * inside * np.exp(-2.0 * absorption_per_m * depth_m / inside))


def bottom_range(surface_m: F64, cosine: F64, depth_m: F64) -> F64:
    """Return the range measured to the bottom: the way in water counts 1.33 times."""
    return np.asarray(surface_m + GROUP_INDEX * depth_m / cosine_inside(cosine))
