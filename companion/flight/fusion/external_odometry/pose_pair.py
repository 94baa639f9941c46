"""Pose of the vehicle at one time, by the autopilot and by an odometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PosePair:
    """Two poses of the vehicle's forward-right-down axes.

    at_ns : companion clock. auto_m, auto : (3,) and (3, 3), the autopilot's in its map coordinates. told_m,
    told : those of the odometry in its own frame. covariance : (6, 6) of the latter. is_stated : whether the
    odometry states it.
    """

    at_ns: int
    auto_m: Floats
    auto: Floats
    told_m: Floats
    told: Floats
    covariance: Floats
    is_stated: bool
