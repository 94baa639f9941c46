"""Returns of a LiDAR in its own axes, on the companion's clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

_DTYPES = {
    "xyz_sensor_m": np.float32,
    "stamp_ns": np.int64,
    "intensity": np.uint8,
    "line": np.uint8,
    "tag": np.uint8,
    "return_number": np.uint8,
}


@dataclass(frozen=True, slots=True)
class Returns:
    """What a LiDAR driver hands on.

    xyz_sensor_m : (n, 3) float32, sensor axes (x forward, y left, z up for Livox), m.
    stamp_ns : (n,) int64, companion clock, the moment of each pulse.
    intensity, line, tag, return_number : (n,) uint8; the first return of a pulse is number 1.

    Raises
    ------
    ValueError
        An array has the wrong shape or dtype.
    """

    xyz_sensor_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: NDArray[np.uint8]
    line: NDArray[np.uint8]
    tag: NDArray[np.uint8]
    return_number: NDArray[np.uint8]

    def __post_init__(self) -> None:
        n = len(self.stamp_ns)
        for name, dtype in _DTYPES.items():
            array = getattr(self, name)
            shape = (n, 3) if name == "xyz_sensor_m" else (n,)
            if array.shape != shape or array.dtype != dtype or not array.flags.c_contiguous:
                raise ValueError(
                    f"{name} must be contiguous {shape} {np.dtype(dtype)}, not {array.shape} {array.dtype}"
                )
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """Return all returns of `parts` in their order.

        Raises
        ------
        ValueError
            There are no parts.
        """
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))
