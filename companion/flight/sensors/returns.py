"""Decoded returns of a LiDAR, and its rays without a return, in the sensor's frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from math import inf, nan
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

LOST_PER_S = 20_000  # lost rays that a driver passes on, at most
Intensity = NDArray[np.uint8] | NDArray[np.float32]


def _no_directions() -> NDArray[np.float32]:
    return np.empty((0, 3), np.float32)


def _no_stamps() -> NDArray[np.int64]:
    return np.empty(0, np.int64)


def thinning(rays_per_s: float) -> int:
    """Return k, such that every k-th lost ray of a sensor is at most `LOST_PER_S`.

    It is odd, and so visits all lines of a sensor that has a power of two of them.
    """
    return max(1, math.ceil(rays_per_s / LOST_PER_S)) | 1


@dataclass(frozen=True, slots=True)
class RawReturns:
    """Decoded points on the sensor's clock.

    xyz_m: (n, 3) float32, forward, left, up of the sensor. stamp_ns: (n,) int64. The rest as in `Returns`.
    """

    xyz_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: Intensity
    ring: NDArray[np.uint8]
    echo: NDArray[np.uint8]
    echoes: NDArray[np.uint8]
    lost: NDArray[np.float32] = field(default_factory=_no_directions, kw_only=True)
    lost_ns: NDArray[np.int64] = field(default_factory=_no_stamps, kw_only=True)
    lost_weight: float = field(default=1.0, kw_only=True)
    white: float = field(default=nan, kw_only=True)
    most_pitch_rad: float = field(default=inf, kw_only=True)
    has_thin_rays: bool = field(default=True, kw_only=True)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def shifted(self, offset_ns: int) -> Returns:
        """Return the returns on a clock that is ahead of the sensor's by `offset_ns`."""
        return Returns(
            self.xyz_m,
            self.stamp_ns + offset_ns,
            self.intensity,
            self.ring,
            self.echo,
            self.echoes,
            lost=self.lost,
            lost_ns=self.lost_ns + offset_ns,
            lost_weight=self.lost_weight,
            white=self.white,
            most_pitch_rad=self.most_pitch_rad,
            has_thin_rays=self.has_thin_rays,
        )


@dataclass(frozen=True, slots=True)
class Returns:
    """Batch of returns.

    xyz_sensor_m: (n, 3) float32, forward, left, up of the sensor.
    stamp_ns: (n,) int64, companion clock.
    intensity: (n,) uint8, or float32 where other than 0 to 255; NaN where the sensor gives none.
    ring: (n,) uint8, laser line, counted from the lowest if the lines are above each other.
    echo: (n,) uint8, number of the return along its ray, 1 is the first; 0 where unknown.
    echoes: (n,) uint8, number of returns of the ray, 1 also for a sensor that reports one only; 0 where
    unknown.
    lost: (m, 3) float32, unit vectors in the sensor's frame along rays without a return.
    lost_ns: (m,) int64, stamps of these rays.
    lost_weight: number of rays without a return for which each ray in `lost` stands.
    white: intensity of a white diffuse target at any range, NaN where the sensor's scale is unknown.
    most_pitch_rad: the batch is valid only while the sensor's x axis is at most this far from level.
    has_thin_rays: a ray that passes a place shows that nothing is there. Not so for the beam of a radar, nor
    for the pixel of a flash LiDAR, whose median removes what is thin.

    The arrays must be contiguous, and become read-only.
    """

    xyz_sensor_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: Intensity
    ring: NDArray[np.uint8]
    echo: NDArray[np.uint8]
    echoes: NDArray[np.uint8]
    lost: NDArray[np.float32] = field(default_factory=_no_directions, kw_only=True)
    lost_ns: NDArray[np.int64] = field(default_factory=_no_stamps, kw_only=True)
    lost_weight: float = field(default=1.0, kw_only=True)
    white: float = field(default=nan, kw_only=True)
    most_pitch_rad: float = field(default=inf, kw_only=True)
    has_thin_rays: bool = field(default=True, kw_only=True)

    def __post_init__(self) -> None:
        n, lost = len(self.stamp_ns), len(self.lost_ns)
        measured = np.float32 if self.intensity.dtype == np.float32 else np.uint8
        for name, array, shape, dtype in (
            ("xyz_sensor_m", self.xyz_sensor_m, (n, 3), np.float32),
            ("stamp_ns", self.stamp_ns, (n,), np.int64),
            ("intensity", self.intensity, (n,), measured),
            ("ring", self.ring, (n,), np.uint8),
            ("echo", self.echo, (n,), np.uint8),
            ("echoes", self.echoes, (n,), np.uint8),
            ("lost", self.lost, (lost, 3), np.float32),
            ("lost_ns", self.lost_ns, (lost,), np.int64),
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
    ) -> Self:
        """Return the returns of a sensor with one line that gives neither intensity nor return numbers."""
        none = np.zeros(len(stamp_ns), np.uint8)
        return cls(xyz_sensor_m, stamp_ns, np.full(len(stamp_ns), np.nan, np.float32), none, none, none)

    @property
    def has_attributes(self) -> bool:
        """True if the sensor gives intensities or return numbers."""
        return bool(self.echoes.any() or not np.isnan(self.intensity).all())

    def select(self, which: slice | NDArray[np.bool_]) -> Returns:
        """Return a selection of the returns, in their order, with all lost rays."""
        columns: dict[str, Any] = {
            name: np.ascontiguousarray(getattr(self, name)[which]) for name in _columns(self)
        }
        return replace(self, **columns)

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
    names = (*_columns(parts[0]), "lost", "lost_ns")
    arrays: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return replace(
        parts[0],
        **arrays,
        lost_weight=max(part.lost_weight for part in parts),
        white=parts[0].white if all(part.white == parts[0].white for part in parts) else nan,
        most_pitch_rad=min(part.most_pitch_rad for part in parts),
        has_thin_rays=all(part.has_thin_rays for part in parts),
    )


def _columns(returns: RawReturns | Returns) -> list[str]:
    """Return the names of the arrays with an element per return."""
    return [f.name for f in fields(returns) if not f.kw_only]
