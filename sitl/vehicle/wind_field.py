"""True wind at the vehicle: a mean with a logarithmic profile over the ground, and Gauss-Markov gusts."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.compilation import kernel_for_any_types

F64 = NDArray[np.float64]

GUST_TAU_S = 4.0
REFERENCE_M = 10.0  # height of the stated mean, as in weather reports (WMO-No. 8)
ROUGHNESS_M = 0.03  # open grassland (WMO-No. 8, Davenport's class 3)
PROFILE_TOP_M = 100.0  # of the surface layer, in which the profile is valid


@kernel_for_any_types
def wind_profile(height_m: float) -> float:
    """Return the mean wind at a height over the ground by that at `REFERENCE_M`: the logarithmic law."""
    height = min(max(height_m, 0.0), PROFILE_TOP_M)
    return math.log(1.0 + height / ROUGHNESS_M) / math.log(1.0 + REFERENCE_M / ROUGHNESS_M)


@kernel_for_any_types
def _blow(gust: F64, mean: F64, sigma: float, draw: F64, height: float, dt: float) -> F64:
    """Advance the gust (Gauss-Markov); return the wind."""
    share, profile = dt / GUST_TAU_S, wind_profile(height)
    out = np.empty(3)
    for i in range(3):
        gust[i] += -gust[i] * share + sigma * np.sqrt(2 * share) * draw[i]
        out[i] = profile * mean[i] + gust[i] * (0.3 if i == 2 else 1.0)
    return out


class WindField:
    """Wind at one vehicle.

    Parameters
    ----------
    rng
        Source of the gusts, and of the direction if that is not given.
    mean_ms
        Mean speed 10 m over the ground.
    from_deg
        Compass direction from which it blows; None draws one.
    gust_ms
        Standard deviation of the gusts in each horizontal direction, at all heights; 0.3 of it vertically.
        None is a third of the mean.

    Attributes
    ----------
    now_enu_ms
        Velocity of the air at the vehicle (3,) east, north, up.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        mean_ms: float = 3.0,
        from_deg: float | None = None,
        gust_ms: float | None = None,
    ) -> None:
        self._rng = rng
        towards = rng.uniform(0, 2 * np.pi)  # counter-clockwise from east; also drawn for a given direction
        if from_deg is not None:
            towards = math.radians(270.0 - from_deg)
        self._mean = mean_ms * np.array([np.cos(towards), np.sin(towards), 0.0])
        self._gust = np.zeros(3)
        self._gust_ms = mean_ms / 3 if gust_ms is None else gust_ms
        self._draws = np.zeros((0, 3))
        self._next_draw = 0
        self.now_enu_ms = np.zeros(3)

    @property
    def mean_enu_ms(self) -> F64:
        """Mean velocity of the air (3,) 10 m over the ground."""
        return self._mean.copy()

    def advance(self, dt_s: float, height_m: float) -> F64:
        """Advance by `dt_s`; return the velocity of the air (3,) at a height over the ground."""
        if self._next_draw == len(self._draws):
            self._draws, self._next_draw = self._rng.standard_normal((4096, 3)), 0
        draw = self._draws[self._next_draw]
        self._next_draw += 1
        self.now_enu_ms = _blow(self._gust, self._mean, self._gust_ms, draw, height_m, dt_s)
        return self.now_enu_ms
