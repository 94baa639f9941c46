"""Airborne particles before a LiDAR: dust of the rotors in plumes, rain and snow.

Returns are weak, nearer than `reach_m`, denser near the sensor, and denser in patches of the air that drift.
One pulse may share a flake or a drop with the one before it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sitl.sensors.optics import Echoes

F64 = NDArray[np.float64]
LEAST_M = 0.3
WAVES = 8  # of the density of a patchy air
DRIFT_MS = 1.5


@dataclass(frozen=True, slots=True)
class Particles:
    """Particles in the air around the sensor.

    Attributes
    ----------
    share
        Share of the pulses that end in one, at the mean density.
    reach_m, exponent
        Farthest return; ranges are distributed as `reach_m` x (uniform number)^exponent.
    patchy, patch_m
        Standard deviation of the logarithm of the density, and size of its patches; 0 is even.
    twins
        Share of the particles from which the next pulse returns too.
    bright
        Lowest and highest brightness, of a white target's.
    """

    share: float
    reach_m: float = 8.0
    exponent: float = 2.0
    patchy: float = 0.0
    patch_m: float = 1.0
    twins: float = 0.0
    bright: tuple[float, float] = (0.01, 0.1)

    def add(
        self, echoes: Echoes, bright: F64, index: NDArray[np.int64], direction: F64, time_s: F64, seed: int
    ) -> tuple[Echoes, F64]:
        """Return the echoes and brightnesses with those of the particles, which hide what is behind them.

        Parameters
        ----------
        index, direction, time_s
            (n,) numbers of the pulses, (n, 3) unit vectors ENU (zero: not fired), and when they were fired.
        """
        own, range_m = self._returns(index, direction, time_s, seed)
        if self.twins > 0:
            before, before_m = self._returns(index - 1, direction, time_s, seed)
            twin = before & (_uniform(index, 3, seed) < self.twins)
            range_m = np.where(twin, before_m, range_m)
            own = own | twin
        own &= direction.any(axis=1) & ((echoes.range_m == 0) | (range_m < echoes.range_m))
        low, high = self.bright
        weak = low + (high - low) * _uniform(index, 2, seed)
        measured = [
            np.where(own, range_m, values) for values in (echoes.range_m, echoes.behind_m, echoes.other_m)
        ]
        added = replace(
            echoes, range_m=measured[0], behind_m=measured[1], other_m=measured[2], dust=echoes.dust | own,
            ghost=echoes.ghost & ~own, marked=echoes.marked & ~own,
        )  # fmt: skip
        return added, np.where(own, weak, bright)

    def _returns(
        self, index: NDArray[np.int64], direction: F64, time_s: F64, seed: int
    ) -> tuple[NDArray[np.bool_], F64]:
        range_m = LEAST_M + (self.reach_m - LEAST_M) * _uniform(index, 1, seed) ** self.exponent
        density = self._density(direction * range_m[:, None], time_s, seed)
        return _uniform(index, 0, seed) < self.share * density, range_m

    def _density(self, place_m: F64, time_s: F64, seed: int) -> F64:
        """Return the density at places relative to the sensor: the exponential of a sum of waves, mean 1."""
        if self.patchy == 0:
            return np.ones(len(place_m))
        rng = np.random.default_rng(seed)
        waves = rng.normal(size=(WAVES, 3)) * (np.pi / 2 / self.patch_m)
        phase, drift = rng.uniform(0, 2 * np.pi, WAVES), rng.normal(size=3) * DRIFT_MS
        angles = (place_m + time_s[:, None] * drift) @ waves.T + phase
        level = np.sqrt(2 / WAVES) * np.cos(angles).sum(axis=1)
        density: F64 = np.exp(self.patchy * level - self.patchy**2 / 2)
        return density


def _uniform(index: NDArray[np.int64], salt: int, seed: int) -> F64:
    """Return random numbers (n,) that depend on the pulse's number only (SplitMix64)."""
    with np.errstate(over="ignore"):
        x = (
            index.astype(np.uint64) * np.uint64(4)
            + np.uint64(salt)
            + np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15)
        )
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        x ^= x >> np.uint64(31)
    uniform: F64 = (x >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return uniform


AIR = {
    "clear": None,
    "dust": Particles(0.01, patchy=1.0),
    "dense_dust": Particles(0.05, patchy=1.0),
    "rain": Particles(0.02, reach_m=20.0, exponent=1.5, bright=(0.01, 0.3)),
    "snow": Particles(
        0.1, reach_m=25.0, exponent=1.5, patchy=0.5, patch_m=4.0, twins=0.1, bright=(0.02, 0.4)
    ),
}
"""Air by name: dust of rotors in plumes, rain, and snow, whose flakes return farther and more than once."""
