"""Direct georeferencing of LiDAR returns."""

from __future__ import annotations

import numpy as np

from companion.flight.fusion.placement import place
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.returns import Returns
from params import Parameters
from slz import Scan


class Georeferencer:
    """Georeferences each return with the pose interpolated at its own stamp, which removes motion distortion.

    Parameters
    ----------
    parameters
        `lidar_x_m` to `lidar_yaw_deg` (see `Mount`), and the range gate `lidar_min_m` to `lidar_max_m`.

    Attributes
    ----------
    out_of_range, without_pose, pitched
        Returns dropped so far; `pitched`: the sensor's pitch exceeded the limit of the returns.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._mount = Mount(parameters)
        self._least_m = parameters.lidar_min_m
        self._most_m = parameters.lidar_max_m
        self.out_of_range = 0
        self.without_pose = 0
        self.pitched = 0

    def georeference(self, returns: Returns, history: PoseHistory) -> Scan | None:
        """Return the scan in the history's map frame, None if no return could be placed."""
        if history.frame is None:
            self.without_pose += len(returns)
            return None
        if self._is_pitched(returns, history):
            self.pitched += len(returns)
            return None
        points = np.empty((len(returns), 3))
        stamps = np.empty(len(returns), dtype=np.int64)
        n, out_of_range, without_pose = place(
            returns.xyz_sensor_m,
            returns.stamp_ns,
            *history.samples(),
            self._mount.rotation_frd_from_sensor,
            self._mount.lever_frd_m,
            self._least_m,
            self._most_m,
            points,
            stamps,
        )
        self.out_of_range += out_of_range
        self.without_pose += without_pose
        if n == 0:
            return None
        points, stamps = points[:n], stamps[:n]
        if (stamps[1:] < stamps[:-1]).any():  # packets arrived out of order
            order = np.argsort(stamps, kind="stable")
            points, stamps = points[order], stamps[order]
        pose = history.interpolate(stamps[-1:])
        sensor = pose.position_enu_m[0] + pose.rotation_enu_from_frd[0] @ self._mount.lever_frd_m
        for array in (points, stamps, sensor):
            array.setflags(write=False)
        return Scan(points_enu_m=points, stamp_ns=stamps, sensor_enu_m=sensor, frame=history.frame)

    def _is_pitched(self, returns: Returns, history: PoseHistory) -> bool:
        """Return whether the sensor's x axis exceeded the returns' pitch limit, or its pitch is unknown."""
        if returns.most_pitch_rad == np.inf:
            return False
        rotation = history.interpolate(np.unique(returns.stamp_ns)).rotation_enu_from_frd
        ahead = rotation @ self._mount.rotation_frd_from_sensor[:, 0]
        return not (np.abs(ahead[:, 2]) <= np.sin(returns.most_pitch_rad)).all()  # True for NaN: no pose
