"""Returns of a LiDAR, decoded, in the sensor's own frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class RawReturns:
    """Decoded points on the sensor's clock.

    xyz_m : (n, 3) float32, forward, left, up of the sensor. stamp_ns : (n,) int64. The rest as in `Returns`.
    """

    xyz_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: NDArray[np.uint8]
    ring: NDArray[np.uint8]
    echo: NDArray[np.uint8]
    echoes: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def later(self, offset_ns: int) -> Returns:
        """Return the same on a clock that is ahead of the sensor's by `offset_ns`."""
        return Returns(
            self.xyz_m, self.stamp_ns + offset_ns, self.intensity, self.ring, self.echo, self.echoes
        )


@dataclass(frozen=True, slots=True)
class Returns:
    """A batch of returns.

    xyz_sensor_m : (n, 3) float32, forward, left, up of the sensor. stamp_ns : (n,) int64, companion clock.
    intensity : (n,) uint8. ring : (n,) uint8, laser line, from the lowest up where lines lie one above the
    other. echo : (n,) uint8, number of the return along its ray, 1 is the first. echoes : (n,) uint8, how
    many the ray gave. The arrays must be contiguous, and become read-only.
    """

    xyz_sensor_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: NDArray[np.uint8]
    ring: NDArray[np.uint8]
    echo: NDArray[np.uint8]
    echoes: NDArray[np.uint8]

    def __post_init__(self) -> None:
        n = len(self.stamp_ns)
        for name, array, shape, dtype in (
            ("xyz_sensor_m", self.xyz_sensor_m, (n, 3), np.float32),
            ("stamp_ns", self.stamp_ns, (n,), np.int64),
            ("intensity", self.intensity, (n,), np.uint8),
            ("ring", self.ring, (n,), np.uint8),
            ("echo", self.echo, (n,), np.uint8),
            ("echoes", self.echoes, (n,), np.uint8),
        ):
            if array.shape != shape or array.dtype != dtype or not array.flags.c_contiguous:
                raise ValueError(
                    f"{name} must be contiguous {shape} {np.dtype(dtype)}, not {array.shape} {array.dtype}"
                )
            array.setflags(write=False)

    @classmethod
    def plain(
        cls,
        xyz_sensor_m: NDArray[np.float32],
        stamp_ns: NDArray[np.int64],
        intensity: NDArray[np.uint8] | None = None,
    ) -> Self:
        """Return returns of a sensor that has one line and one return a ray, and maybe tells no intensity."""
        none, one = np.zeros(len(stamp_ns), np.uint8), np.ones(len(stamp_ns), np.uint8)
        return cls(xyz_sensor_m, stamp_ns, none if intensity is None else intensity, none, one, one)

    def part(self, which: slice | NDArray[np.bool_]) -> Returns:
        """Return some of the returns, in their order."""
        return Returns(*(np.ascontiguousarray(getattr(self, f.name)[which]) for f in fields(Returns)))

    def __len__(self) -> int:
        return len(self.stamp_ns)


def nothing() -> RawReturns:
    """Return no point at all."""
    none = np.empty(0, np.uint8)
    return RawReturns(np.empty((0, 3), np.float32), np.empty(0, np.int64), none, none, none, none)


def join_raw(parts: Sequence[RawReturns]) -> RawReturns:
    """Return all points of `parts`, at least one, in their order."""
    if len(parts) == 1:
        return parts[0]
    return RawReturns(
        *(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(RawReturns))
    )


def join(parts: Sequence[Returns]) -> Returns:
    """Return all returns of `parts`, at least one, in their order."""
    if len(parts) == 1:
        return parts[0]
    return Returns(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Returns)))
