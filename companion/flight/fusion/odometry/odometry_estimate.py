"""Estimate of the LiDAR odometry: the pose relative to the map, its covariance and its observed axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STEP_NS = 500_000_000
MOST = 4096  # half an hour; the older half is then thinned to every other one
# Errors that scan and plane share, unknown to the filter: of each generation of the map.
SHARED_M = np.array([0.03, 0.03, 0.05])


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
        """True if position and tilt are observed: with the autopilot's heading, enough to land by."""
        return bool(self.observed[:5].all())


class MapUncertainty:
    """Variance of the map's position, east, north, up, by the time at which its parts were placed.

    The filter compares a scan with the map around it. That map was placed by earlier poses, these by the map
    around them, and so on back to the first scan: the variances of this chain add up. Over ground that
    stays in view nothing is added.
    """

    def __init__(self) -> None:
        self._at_ns: list[int] = []
        self._variance_m2: list[Floats] = []

    def variance_m2(self, placed_ns: int) -> Floats:
        """Return the variance (3,), m2, of what was placed at a time; 0 before the first."""
        if not self._at_ns:
            return np.zeros(3)
        index = int(np.searchsorted(self._at_ns, placed_ns, "right")) - 1
        return self._variance_m2[max(index, 0)]

    def add(self, at_ns: int, variance_m2: Floats) -> None:
        """Note the variance (3,) of a pose by which parts of the map are placed now."""
        if self._at_ns and at_ns - self._at_ns[-1] < STEP_NS:
            return
        self._at_ns.append(at_ns)
        self._variance_m2.append(variance_m2)
        if len(self._at_ns) > MOST:
            half = MOST // 2
            self._at_ns[:half] = self._at_ns[:half:2]
            self._variance_m2[:half] = self._variance_m2[:half:2]

    def clear(self) -> None:
        """Forget the map."""
        self._at_ns.clear()
        self._variance_m2.clear()
