"""Pose for tests of the outputs, with a rotation from SciPy, independent of the tested code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True)
class Pose:
    stamp_ns: int
    position_enu_m: NDArray[np.float64]
    rotation_enu_from_frd: NDArray[np.float64]


def pose(
    position_enu_m: Sequence[float], roll: float = 0, pitch: float = 0, yaw: float = 0, stamp_ns: int = 10**10
) -> Pose:
    """Return a pose with angles in radians, as an autopilot means them."""
    ned_from_frd = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    return Pose(stamp_ns, np.array(position_enu_m, dtype=float), ENU_FROM_NED @ ned_from_frd)
