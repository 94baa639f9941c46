"""Interpolation of the vehicle's true pose between ticks."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(slots=True)
class PoseTrack:
    """True poses of the last ticks, for the LiDAR."""

    stamps: list[int] = field(default_factory=list)
    positions: list[F64] = field(default_factory=list)
    quats: list[F64] = field(default_factory=list)

    def add(self, stamp_ns: int, position: F64, quat: F64) -> None:
        self.stamps.append(stamp_ns)
        self.positions.append(position)
        self.quats.append(quat)

    def keep_last(self) -> None:
        del self.stamps[:-1], self.positions[:-1], self.quats[:-1]

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[F64, F64]:
        """Return positions (n, 3) and quaternions (n, 4), interpolated between ticks."""
        times = np.array(self.stamps, np.float64)
        when = stamps_ns.astype(np.float64)
        positions, quats = np.array(self.positions), np.array(self.quats)
        for i in range(1, len(quats)):
            if quats[i] @ quats[i - 1] < 0:
                quats[i] = -quats[i]
        position = np.column_stack([np.interp(when, times, positions[:, i]) for i in range(3)])
        quat = np.column_stack([np.interp(when, times, quats[:, i]) for i in range(4)])
        return position, quat / np.sqrt(np.einsum("ij,ij->i", quat, quat))[:, None]
