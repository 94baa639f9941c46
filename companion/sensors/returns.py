"""Returns of a LiDAR, decoded, in the sensor's own frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Returns:
    """A batch of returns.

    xyz_sensor_m : (n, 3) float32, forward, left, up of the sensor. stamp_ns : (n,) int64, companion clock.
    intensity : (n,) uint8.
    """

    xyz_sensor_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: NDArray[np.uint8]

    def __post_init__(self) -> None:
        n = len(self.stamp_ns)
        for name, array, shape, dtype in (
            ("xyz_sensor_m", self.xyz_sensor_m, (n, 3), np.float32),
            ("stamp_ns", self.stamp_ns, (n,), np.int64),
            ("intensity", self.intensity, (n,), np.uint8),
        ):
            if array.shape != shape or array.dtype != dtype:
                raise ValueError(f"{name} must be {shape} {np.dtype(dtype)}, not {array.shape} {array.dtype}")

    def __len__(self) -> int:
        return len(self.stamp_ns)
