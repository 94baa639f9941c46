"""Estimate of the LiDAR odometry: the pose relative to the map, its covariance and its observed axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class OdometryEstimate:
    """Pose of the vehicle relative to the map.

    stamp_ns : companion clock, of the newest return of the scan.
    position_enu_m, velocity_enu_ms : (3,) in the map frame.
    quat_wxyz : (4,), rotation of body forward-right-down into north-east-down.
    pose_covariance : (6, 6), east, north, up (m2), then the rotation vector about these axes (rad2). An axis
        that is not observed keeps the autopilot's estimate, and its variance grows.
    velocity_covariance : (3, 3), m2/s2.
    observed : (6,) bool, whether scan and map determine each axis, in the order of the covariance.
    resets : number of times the map began anew; the poses before and after one are of different maps.
    """

    stamp_ns: int
    position_enu_m: Floats
    velocity_enu_ms: Floats
    quat_wxyz: Floats
    pose_covariance: Floats
    velocity_covariance: Floats
    observed: NDArray[np.bool_]
    resets: int

    @property
    def is_healthy(self) -> bool:
        """Whether position and tilt are observed: with the autopilot's heading, enough to land by."""
        return bool(self.observed[:5].all())
