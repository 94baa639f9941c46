"""Flat world and a vehicle that hovers over it, for tests of sensors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Ground, Kind
from sitl.world.world import World

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
PoseAt = Callable[[I64], tuple[F64, F64]]


def flat_world(kind: Kind = Kind.GRASS) -> World:
    """Return 200 m by 200 m of level ground at height 0."""
    ground = Ground(-100.0, -100.0, 4.0, np.zeros((51, 51)), np.full((50, 50), kind, np.uint8))
    return World(ground)


def hover(x: float = 0.0, y: float = 0.0, z: float = 10.0, heading_deg: float = 0.0) -> PoseAt:
    """Return the pose of a level vehicle that does not move."""
    half = np.radians(heading_deg) / 2

    def pose_at(stamps: I64) -> tuple[F64, F64]:
        n = len(stamps)
        quat = np.tile([np.cos(half), 0.0, 0.0, np.sin(half)], (n, 1))
        return np.tile([x, y, z], (n, 1)), quat

    return pose_at
