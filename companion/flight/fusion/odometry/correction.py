"""Correction of the autopilot's pose to that relative to the map: a small rotation and a shift."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.geometry.pose import Pose
from slz import Scan

Floats = NDArray[np.float64]
_NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def _zeros() -> Floats:
    return np.zeros(3)


@dataclass(frozen=True, slots=True)
class Correction:
    """Rigid motion of the autopilot's map coordinates near the vehicle: a rotation about it, then a shift.

    An autopilot's heading and position are wrong for different reasons: a wrong heading does not turn its
    track. So the pivot goes with the vehicle, and the shift stays.

    turn_rad : (3,), rotation vector about east, north and up. pivot_enu_m, shift_enu_m : (3,).
    rate_enu_ms : (3,), how fast the shift changes, and the velocity is wrong.
    slide_up_ms : how fast the shift changes while the velocity is right, up to the last stamp of a scan.
    """

    turn_rad: Floats = field(default_factory=_zeros)
    pivot_enu_m: Floats = field(default_factory=_zeros)
    shift_enu_m: Floats = field(default_factory=_zeros)
    rate_enu_ms: Floats = field(default_factory=_zeros)
    slide_up_ms: float = 0.0

    @property
    def is_none(self) -> bool:
        """True if nothing is corrected."""
        return not (self.turn_rad.any() or self.shift_enu_m.any() or self.rate_enu_ms.any())

    @property
    def rotation(self) -> Floats:
        """Rotation (3, 3)."""
        return np.asarray(Rotation.from_rotvec(self.turn_rad).as_matrix())

    def points(self, enu_m: Floats) -> Floats:
        """Return points (..., 3) of the autopilot's estimate where the map has them."""
        return (enu_m - self.pivot_enu_m) @ self.rotation.T + self.pivot_enu_m + self.shift_enu_m

    def of_map(self, enu_m: Floats) -> Floats:
        """Return points (..., 3) of the map where the autopilot's estimate has them."""
        return (enu_m - self.pivot_enu_m - self.shift_enu_m) @ self.rotation + self.pivot_enu_m

    def after_jump(self, jump_enu_m: Floats) -> Self:
        """Return the correction under which a jump (3,) of the estimate moves nothing on the map."""
        return replace(self, shift_enu_m=self.shift_enu_m - self.rotation @ jump_enu_m)

    def pose(self, pose: Pose) -> Pose:
        """Return the pose relative to the map."""
        if self.is_none:
            return pose
        in_ned = Rotation.from_matrix(_NED_FROM_ENU @ self.rotation @ _NED_FROM_ENU)
        body = Rotation.from_quat(pose.quat_wxyz[[1, 2, 3, 0]])
        return replace(
            pose,
            position_enu_m=self.points(pose.position_enu_m),
            velocity_enu_ms=self.rotation @ pose.velocity_enu_ms + self.rate_enu_ms,
            quat_wxyz=np.asarray((in_ned * body).as_quat())[[3, 0, 1, 2]],
        )

    def scan(self, scan: Scan) -> Scan:
        """Return the scan where the map has it."""
        if self.is_none:
            return scan
        lost = scan.attributes
        if lost is not None and len(lost.lost_enu_m):
            lost = replace(
                lost,
                lost_enu_m=self._moved(lost.lost_enu_m),
                lost_origin_enu_m=self._moved(lost.lost_origin_enu_m),
            )
        return replace(
            scan,
            points_enu_m=self._moved(self.levelled(scan)),
            sensor_enu_m=self._moved(scan.sensor_enu_m),
            open_enu_m=None if scan.open_enu_m is None else self._moved(scan.open_enu_m),
            attributes=lost,
        )

    def levelled(self, scan: Scan) -> Floats:
        """Return the points (n, 3) of a scan where the estimate of its last stamp has them."""
        if not self.slide_up_ms:
            return scan.points_enu_m
        early_s = (scan.stamp_ns[-1] - scan.stamp_ns) * 1e-9
        return scan.points_enu_m - np.outer(early_s, (0.0, 0.0, self.slide_up_ms))

    def _moved(self, enu_m: Floats) -> Floats:
        moved = np.ascontiguousarray(self.points(enu_m))
        moved.setflags(write=False)
        return moved
