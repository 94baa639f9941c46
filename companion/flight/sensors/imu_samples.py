"""Samples of a LiDAR's own inertial measurement unit, in the axes of its points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STANDARD_GRAVITY_MS2 = 9.80665
MOST_RADS = 70.0  # twice what the built-in gyroscopes can measure
MOST_MS2 = 64 * STANDARD_GRAVITY_MS2


def _origin() -> Floats:
    return np.zeros(3)


@dataclass(frozen=True, slots=True)
class ImuSamples:
    """Batch of inertial samples.

    stamp_ns: (n,) int64, companion clock; a decoder returns them on the sensor's clock.
    rate_rads: (n, 3) float64, rad/s about the axes of the LiDAR's points: forward, left, up.
    specific_force_ms2: (n, 3) float64, m/s2 along the same axes, at the unit's own position: 9.81 upward at
    rest.
    lever_m: (3,) float64, position of the unit in the frame of the points.

    The arrays become read-only.
    """

    stamp_ns: NDArray[np.int64]
    rate_rads: Floats
    specific_force_ms2: Floats
    lever_m: Floats = field(default_factory=_origin)

    def __post_init__(self) -> None:
        n = len(self.stamp_ns)
        for name, array, shape, dtype in (
            ("stamp_ns", self.stamp_ns, (n,), np.int64),
            ("rate_rads", self.rate_rads, (n, 3), np.float64),
            ("specific_force_ms2", self.specific_force_ms2, (n, 3), np.float64),
            ("lever_m", self.lever_m, (3,), np.float64),
        ):
            if array.shape != shape or array.dtype != dtype:
                raise ValueError(f"{name} must be {shape} {np.dtype(dtype)}, not {array.shape} {array.dtype}")
            array.setflags(write=False)

    @property
    def is_plausible(self) -> bool:
        """True if all values are finite and within twice the range of such a unit."""
        return bool(
            (np.abs(self.rate_rads) <= MOST_RADS).all()
            and (np.abs(self.specific_force_ms2) <= MOST_MS2).all()
        )

    def shifted(self, offset_ns: int) -> ImuSamples:
        """Return the samples on a clock that is ahead by `offset_ns`."""
        return replace(self, stamp_ns=self.stamp_ns + offset_ns)

    def __len__(self) -> int:
        return len(self.stamp_ns)
