"""Decoded returns of a LiDAR, in the sensor's frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from math import inf
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class RawReturns:
    """Decoded points on the sensor's clock.

    xyz_m: (n, 3) float32, forward, left, up of the sensor. stamp_ns: (n,) int64. The rest as in `Returns`.
    """

    xyz_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: NDArray[np.uint8]
    ring: NDArray[np.uint8]
    echo: NDArray[np.uint8]
    echoes: NDArray[np.uint8]
    most_pitch_rad: float = field(default=inf, kw_only=True)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def shifted(self, offset_ns: int) -> Returns:
        """Return the returns on a clock that is ahead of the sensor's by `offset_ns`."""
        stamps = self.stamp_ns + offset_ns
        return Returns(
            self.xyz_m,
            stamps,
            self.intensity,
            self.ring,
            self.echo,
            self.echoes,
            most_pitch_rad=self.most_pitch_rad,
        )


@dataclass(frozen=True, slots=True)
class Returns:
    """Batch of returns.

    xyz_sensor_m: (n, 3) float32, forward, left, up of the sensor.
    stamp_ns: (n,) int64, companion clock.
    intensity: (n,) uint8.
    ring: (n,) uint8, laser line, counted from the lowest if the lines are above each other.
    echo: (n,) uint8, number of the return along its ray, 1 is the first.
    echoes: (n,) uint8, number of returns of the ray.
    most_pitch_rad: the batch is valid only while the sensor's x axis is at most this far from level.

    The arrays must be contiguous, and become read-only.
    """

    xyz_sensor_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: NDArray[np.uint8]
    ring: NDArray[np.uint8]
    echo: NDArray[np.uint8]
    echoes: NDArray[np.uint8]
    most_pitch_rad: float = field(default=inf, kw_only=True)

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
        """Return the returns of a sensor with one line, one return per ray, and perhaps no intensity."""
        none, one = np.zeros(len(stamp_ns), np.uint8), np.ones(len(stamp_ns), np.uint8)
        return cls(xyz_sensor_m, stamp_ns, none if intensity is None else intensity, none, one, one)

    def select(self, which: slice | NDArray[np.bool_]) -> Returns:
        """Return a selection of the returns, in their order."""
        arrays = [np.ascontiguousarray(getattr(self, name)[which]) for name in _arrays(self)]
        return Returns(*arrays, most_pitch_rad=self.most_pitch_rad)

    def __len__(self) -> int:
        return len(self.stamp_ns)


R = TypeVar("R", RawReturns, Returns)


def nothing() -> RawReturns:
    """Return an empty batch."""
    none = np.empty(0, np.uint8)
    return RawReturns(np.empty((0, 3), np.float32), np.empty(0, np.int64), none, none, none, none)


def join_raw(parts: Sequence[RawReturns]) -> RawReturns:
    """Return all points of `parts`, at least one, in their order."""
    if len(parts) == 1:
        return parts[0]
    return _joined(parts)


def join(parts: Sequence[Returns]) -> Returns:
    """Return all returns of `parts`, at least one, in their order."""
    if len(parts) == 1:
        return parts[0]
    return _joined(parts)


def _joined(parts: Sequence[R]) -> R:
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _arrays(parts[0])}
    return replace(parts[0], **columns, most_pitch_rad=min(part.most_pitch_rad for part in parts))


def _arrays(returns: RawReturns | Returns) -> list[str]:
    return [f.name for f in fields(returns) if f.default is MISSING]
