"""Mount of the LiDAR on the vehicle: lever arm and boresight.

Sensor frame of the Mid-360, as in its point cloud and its user manual: right-handed, origin at the optical
centre, x forward (away from the connector), y left, z up along the axis of rotation; azimuth counts from x
towards y, elevation from the xy plane towards z, and the field of view is -7 deg to +52 deg of elevation all
around.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array2D
from sitl.compilation import kernel

F64 = NDArray[np.float64]

FRD_FROM_FLU: F64 = np.diag([1.0, -1.0, -1.0])
LANDING_PITCH_DEG = 112.5


@dataclass(frozen=True, slots=True)
class Mount:
    """Lever arm and boresight of the sensor: ``p_body_frd = lever + T_body_from_lidar p_sensor``.

    The angles rotate sensor axes into body forward-left-up axes by R = Rz(yaw) Ry(pitch) Rx(roll), all
    right-handed about x forward, y left, z up (a positive pitch turns the nose down); body FLU becomes FRD by
    changing the signs of y and z. With all angles zero the sensor is upright and faces forward.

    The default looks down. The middle of the field of view, elevation +22.5 deg at azimuth 0, must become the
    nadir. A pitch of p lowers a direction of elevation e in the xz plane to e - p, so 22.5 - p = -90 and
    **pitch = 112.5 deg**. The sensor's z axis then points forward and 22.5 deg below the horizon, its x axis
    down and 22.5 deg backward. Along track the sensor sees the ground from 29.5 deg behind the nadir
    (elevation -7) to 29.5 deg ahead of it (elevation +52).

    No pitch lets z point forward and *up*: the nadir would be at elevation -22.5 deg or lower, outside the
    field of view.

    Parameters
    ----------
    lever_frd_m
        Optical centre from the vehicle's reference point, body forward-right-down.
    roll_deg, pitch_deg, yaw_deg
        Boresight angles.
    """

    lever_frd_m: tuple[float, float, float] = (0.10, 0.0, 0.05)
    roll_deg: float = 0.0
    pitch_deg: float = LANDING_PITCH_DEG
    yaw_deg: float = 0.0

    def rotation_frd_from_sensor(self) -> F64:
        """Return the (3, 3) rotation from sensor vectors to body FRD vectors."""
        return _rotation(self.roll_deg, self.pitch_deg, self.yaw_deg)

    def to_enu(self, vectors_sensor: F64, quat_wxyz: F64) -> F64:
        """Rotate sensor vectors (n, 3) into ENU with one attitude each, (n, 4) body FRD -> NED."""
        return _to_enu(quat_wxyz, vectors_sensor @ self.rotation_frd_from_sensor().T)

    def up_enu(self, quat_wxyz: F64) -> F64:
        """Return the sensor's z axis in ENU for each attitude, (n, 3)."""
        z_twice = np.array([[0.0, 0.0, 1.0]] * 2) @ self.rotation_frd_from_sensor().T
        return _to_enu(quat_wxyz, z_twice[:1])

    def lever_enu_m(self, quat_wxyz: F64) -> F64:
        """Return the lever arm in ENU for each attitude, (n, 3)."""
        return _to_enu(quat_wxyz, np.array([self.lever_frd_m], np.float64))


@lru_cache(maxsize=64)
def _rotation(roll_deg: float, pitch_deg: float, yaw_deg: float) -> F64:
    (cr, sr), (cp, sp), (cy, sy) = (
        (np.cos(a), np.sin(a)) for a in np.radians([roll_deg, pitch_deg, yaw_deg])
    )
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    rotation: F64 = FRD_FROM_FLU @ rz @ ry @ rx
    rotation.setflags(write=False)
    return rotation


def _to_enu(quat_wxyz: F64, body: F64) -> F64:
    """Rotate vectors in body axes, one for each attitude or one for all, into ENU."""
    out = np.empty((len(quat_wxyz), 3))
    rotate_to_enu(np.ascontiguousarray(quat_wxyz, np.float64), body, out)
    return out


@kernel
def rotate_to_enu(quats: Array2D[np.float64], body: Array2D[np.float64], out: Array2D[np.float64]) -> None:
    """Rotate FRD vectors, (n, 3) or (1, 3), with unit quaternions: v + 2w (q x v) + 2 q x (q x v)."""
    each = 0 if body.shape[0] == 1 else 1
    for n in range(quats.shape[0]):
        w, x, y, z = quats[n, 0], quats[n, 1], quats[n, 2], quats[n, 3]
        vx, vy, vz = body[each * n, 0], body[each * n, 1], body[each * n, 2]
        tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
        out[n, 1] = vx + w * tx + y * tz - z * ty
        out[n, 0] = vy + w * ty + z * tx - x * tz
        out[n, 2] = -(vz + w * tz + x * ty - y * tx)
