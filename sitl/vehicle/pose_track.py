"""The vehicle's true motion between ticks: interpolated poses, and what an inertial unit feels."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array1D, Array2D
from sitl.compilation import kernel

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


class Motion(Protocol):
    """Interface of a moving vehicle to an inertial unit."""

    def felt(self, stamps_ns: I64, place_frd_m: F64, gravity_ms2: float) -> tuple[F64, F64]:
        """Return angular rates (rad/s) and specific forces (m/s2), (n, 3) in body axes, at a place."""


@dataclass(slots=True)
class PoseTrack:
    """True poses and velocities of the last ticks, for the sensors."""

    stamps: list[int] = field(default_factory=list)
    positions: list[F64] = field(default_factory=list)
    quats: list[F64] = field(default_factory=list)
    velocities: list[F64] = field(default_factory=list)
    _rate_before: F64 = field(default_factory=lambda: np.zeros(3))
    _rate_at_end: F64 = field(default_factory=lambda: np.zeros(3))

    def add(self, stamp_ns: int, position: F64, quat: F64, velocity: F64 | None = None) -> None:
        """Add a tick; the velocity ENU (m/s) is needed for `felt` only."""
        self.stamps.append(stamp_ns)
        self.positions.append(position)
        self.quats.append(quat)
        self.velocities.append(np.zeros(3) if velocity is None else velocity)

    def keep_last(self) -> None:
        self._rate_before = self._rate_at_end
        for values in (self.stamps, self.positions, self.quats, self.velocities):
            del values[:-1]

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[F64, F64]:
        """Return positions (n, 3) and quaternions (n, 4) at rising times, interpolated between ticks."""
        when, position = stamps_ns.astype(np.float64), np.empty((len(stamps_ns), 3))
        quat = np.empty((len(stamps_ns), 4))
        track = np.array(self.stamps, np.float64), np.array(self.positions, np.float64), self._one_sided()
        interpolate_poses(*track, when, position, quat)
        return position, quat

    def felt(self, stamps_ns: I64, place_frd_m: F64, gravity_ms2: float) -> tuple[F64, F64]:
        """Return angular rates (rad/s) and specific forces (m/s2), (n, 3) in body axes, at a place.

        Both are constant within a tick, so that their integral is exactly the motion from tick to tick, with
        the shock of a touchdown.
        """
        if len(self.stamps) < 2 or not len(stamps_ns):
            return np.zeros((len(stamps_ns), 3)), np.zeros((len(stamps_ns), 3))
        dt_s = np.diff(np.array(self.stamps, np.float64))[:, None] * 1e-9
        rates = self._rates()
        self._rate_at_end = rates[-1]
        turning = np.diff(np.vstack([self._rate_before, rates]), axis=0) / dt_s
        arm = np.broadcast_to(place_frd_m, rates.shape)
        lever = np.cross(turning, arm) + np.cross(rates, np.cross(rates, arm))
        pull = np.diff(np.array(self.velocities), axis=0) / dt_s + np.array([0.0, 0.0, gravity_ms2])
        within = np.clip(np.searchsorted(self.stamps, stamps_ns, side="left") - 1, 0, len(rates) - 1)
        _, quats = self.at(stamps_ns)
        force = _into_body(quats, pull[within][:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0]))
        return rates[within], force + lever[within]

    def _one_sided(self) -> F64:
        """Return the quaternions (n, 4) with signs that do not jump."""
        quats = np.array(self.quats, np.float64)
        for i in range(1, len(quats)):
            if quats[i] @ quats[i - 1] < 0:
                quats[i] = -quats[i]
        return quats

    def _rates(self) -> F64:
        """Return the mean body rates (n - 1, 3) from tick to tick, rad/s."""
        quats = self._one_sided()
        w, v = quats[:-1, :1], -quats[:-1, 1:]
        w2, v2 = quats[1:, :1], quats[1:, 1:]
        scalar = w * w2 - np.sum(v * v2, axis=1, keepdims=True)
        vector = w * v2 + w2 * v + np.cross(v, v2)
        sine = np.sqrt(np.sum(vector**2, axis=1, keepdims=True))
        angle = 2.0 * np.arctan2(sine, scalar)
        axis = np.divide(vector, sine, out=np.zeros_like(vector), where=sine > 1e-12)
        out: F64 = axis * angle / (np.diff(np.array(self.stamps, np.float64))[:, None] * 1e-9)
        return out


@kernel
def interpolate_poses(
    times: Array1D[np.float64],
    positions: Array2D[np.float64],
    quats: Array2D[np.float64],
    when: Array1D[np.float64],
    out_position: Array2D[np.float64],
    out_quat: Array2D[np.float64],
) -> None:
    """Write positions and unit quaternions at rising times; before and after the track those of its ends."""
    last, k = times.size - 1, 0
    for n in range(when.size):
        while k < last and times[k + 1] <= when[n]:
            k += 1
        within = k < last and when[n] > times[k]
        after = k + 1 if within else k
        since, step = (when[n] - times[k], times[after] - times[k]) if within else (0.0, 1.0)
        for i in range(3):
            out_position[n, i] = (positions[after, i] - positions[k, i]) / step * since + positions[k, i]
        for i in range(4):
            out_quat[n, i] = (quats[after, i] - quats[k, i]) / step * since + quats[k, i]
        w, x, y, z = out_quat[n, 0], out_quat[n, 1], out_quat[n, 2], out_quat[n, 3]
        length = math.sqrt((w * w + y * y) + (x * x + z * z))
        out_quat[n, 0], out_quat[n, 1] = w / length, x / length
        out_quat[n, 2], out_quat[n, 3] = y / length, z / length


def _into_body(quats: F64, ned: F64) -> F64:
    """Rotate vectors (n, 3) from north-east-down into body axes with unit quaternions (n, 4)."""
    w, v = quats[:, :1], -quats[:, 1:]
    t = 2.0 * np.cross(v, ned)
    out: F64 = ned + w * t + np.cross(v, t)
    return out
