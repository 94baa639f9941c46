"""From the sensor's frame into the map: every return with the pose of its own instant.

Mount: with sensor and body axes both written forward-left-up, R = Rz(yaw) Ry(pitch) Rx(roll) turns sensor
axes into body axes. Positive pitch lowers the sensor's forward axis. The default pitch of 112.5 degrees puts
elevation 22.5 degrees, the middle of a Mid-360's field of view, straight down: 22.5 - 112.5 = -90; the
sensor's z axis then points forward and 22.5 degrees down.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.fusion.pose_history import PoseHistory
from companion.sensors.returns import Returns
from params import Parameters
from slz import Scan
from slz.kernels.jit import kernel

Floats = NDArray[np.float64]


def rotation_frd_from_sensor(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Floats:
    """Return the (3, 3) rotation of sensor forward-left-up into body forward-right-down."""
    r, p, y = (math.radians(angle) for angle in (roll_deg, pitch_deg, yaw_deg))
    rx = np.array([[1, 0, 0], [0, math.cos(r), -math.sin(r)], [0, math.sin(r), math.cos(r)]])
    ry = np.array([[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]])
    rz = np.array([[math.cos(y), -math.sin(y), 0], [math.sin(y), math.cos(y), 0], [0, 0, 1]])
    return np.asarray(np.diag([1.0, -1.0, -1.0]) @ rz @ ry @ rx)


@kernel("void(float32[:, :], float64[:, :], float64[:, :], float64[:, :], float64[:], float64[:, :])")
def place(
    xyz: NDArray[np.float32],
    mount: Floats,
    position: Floats,
    quat: Floats,
    lever: Floats,
    out: Floats,
) -> None:
    """Place sensor points in the map: out = position + ENU(quat (mount xyz + lever))."""
    for i in range(xyz.shape[0]):
        bx = mount[0, 0] * xyz[i, 0] + mount[0, 1] * xyz[i, 1] + mount[0, 2] * xyz[i, 2] + lever[0]
        by = mount[1, 0] * xyz[i, 0] + mount[1, 1] * xyz[i, 1] + mount[1, 2] * xyz[i, 2] + lever[1]
        bz = mount[2, 0] * xyz[i, 0] + mount[2, 1] * xyz[i, 1] + mount[2, 2] * xyz[i, 2] + lever[2]
        w, x, y, z = quat[i, 0], quat[i, 1], quat[i, 2], quat[i, 3]
        tx, ty, tz = 2 * (y * bz - z * by), 2 * (z * bx - x * bz), 2 * (x * by - y * bx)
        north = bx + w * tx + y * tz - z * ty
        east = by + w * ty + z * tx - x * tz
        down = bz + w * tz + x * ty - y * tx
        out[i, 0] = position[i, 0] + east
        out[i, 1] = position[i, 1] + north
        out[i, 2] = position[i, 2] - down


class Georeferencer:
    """Places returns; counts what is out of range or has no pose."""

    def __init__(self, parameters: Parameters) -> None:
        p = parameters
        self._mount = rotation_frd_from_sensor(p.lidar_roll_deg, p.lidar_pitch_deg, p.lidar_yaw_deg)
        self._lever = np.array([p.lidar_x_m, p.lidar_y_m, p.lidar_z_m])
        self._range_m = p.lidar_min_m, p.lidar_max_m
        self.out_of_range = 0
        self.without_pose = 0

    def georeference(self, returns: Returns, history: PoseHistory) -> Scan | None:
        """Return the scan in the map frame, or None while there is no frame or nothing is left."""
        if history.frame is None or not len(returns):
            return None
        distance2 = np.einsum("ij,ij->i", returns.xyz_sensor_m, returns.xyz_sensor_m)
        low, high = self._range_m
        in_range = (distance2 >= low * low) & (distance2 <= high * high)
        positions, quats, valid = history.interpolate(returns.stamp_ns)
        keep = in_range & valid
        self.out_of_range += int((~in_range).sum())
        self.without_pose += int((in_range & ~valid).sum())
        if not keep.any():
            return None
        points = np.empty((int(keep.sum()), 3))
        place(returns.xyz_sensor_m[keep], self._mount, positions[keep], quats[keep], self._lever, points)
        points.setflags(write=False)
        return Scan(points, returns.stamp_ns[keep], positions[keep][-1], history.frame)
