"""Direct georeferencing of LiDAR returns, and of rays without a return."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.flight.fusion.placement import place
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.returns import Returns
from params import Parameters
from slz import PointAttributes, Scan
from slz.window import LOST_M

LEAST_DEPRESSION_DEG = 5.0  # of a lost ray below the horizon
_MOST_UP_M = -LOST_M * float(np.sin(np.radians(LEAST_DEPRESSION_DEG)))
Floats = NDArray[np.float64]


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
        """Return the scan in the history's map frame by the autopilot's poses, None if nothing has a pose."""
        if history.frame is None:
            self.without_pose += len(returns)
            return None
        if self._is_pitched(returns, history):
            self.pitched += len(returns)
            return None
        points = np.empty((len(returns), 3))
        stamps, number = np.empty((2, len(returns)), dtype=np.int64)
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
            number,
        )
        self.out_of_range += out_of_range
        self.without_pose += without_pose
        if n == 0:
            return None
        points, stamps, number = points[:n], stamps[:n], number[:n]
        if (stamps[1:] < stamps[:-1]).any():  # packets arrived out of order
            order = np.argsort(stamps, kind="stable")
            points, stamps, number = points[order], stamps[order], number[order]
        pose = history.interpolate(stamps[-1:])
        sensor = pose.position_enu_m[0] + pose.rotation_enu_from_frd[0] @ self._mount.lever_frd_m
        ends, origins = self._place_lost(returns, history)
        for array in (points, stamps, sensor, ends):
            array.setflags(write=False)
        return Scan(
            points_enu_m=points,
            stamp_ns=stamps,
            sensor_enu_m=sensor,
            frame=history.frame,
            attributes=_attributes(returns, number, ends, origins),
            open_enu_m=ends,
            open_weight=returns.lost_weight,
            has_thin_rays=returns.has_thin_rays,
        )

    def _place_lost(self, returns: Returns, history: PoseHistory) -> tuple[Floats, Floats]:
        """Return ends (m, 3) and origins (m, 3) of the lost rays."""
        if not len(returns.lost_ns):
            return np.empty((0, 3)), np.empty((0, 3))
        ends, number = self._place_rays(returns.lost * np.float32(LOST_M), returns.lost_ns, history)
        stamps = returns.lost_ns[number]
        origins, _ = self._place_rays(np.zeros((len(stamps), 3), np.float32), stamps, history)
        return ends, origins

    def _place_rays(
        self, xyz_m: NDArray[np.float32], stamp_ns: NDArray[np.int64], history: PoseHistory
    ) -> tuple[Floats, NDArray[np.int64]]:
        """Return points in the map frame, and their indices: those without a pose are left out."""
        points, (stamps, number) = np.empty((len(stamp_ns), 3)), np.empty((2, len(stamp_ns)), np.int64)
        n, _, _ = place(
            xyz_m,
            stamp_ns,
            *history.samples(),
            self._mount.rotation_frd_from_sensor,
            self._mount.lever_frd_m,
            0.0,
            np.inf,
            points,
            stamps,
            number,
        )
        return points[:n], number[:n]

    def _is_pitched(self, returns: Returns, history: PoseHistory) -> bool:
        """Return whether the sensor's x axis exceeded the returns' pitch limit, or its pitch is unknown."""
        if returns.most_pitch_rad == np.inf:
            return False
        rotation = history.interpolate(np.unique(returns.stamp_ns)).rotation_enu_from_frd
        ahead = rotation @ self._mount.rotation_frd_from_sensor[:, 0]
        return not (np.abs(ahead[:, 2]) <= np.sin(returns.most_pitch_rad)).all()  # True for NaN: no pose


def _attributes(
    returns: Returns, number: NDArray[np.int64], ends: Floats, origins: Floats
) -> PointAttributes | None:
    """Return the attributes of the placed returns and the lost rays below the horizon, None for none."""
    down = ends[:, 2] - origins[:, 2] <= _MOST_UP_M
    if not down.any() and not returns.has_attributes:
        return None
    intensity = np.asarray(returns.intensity / np.float32(returns.white), np.float32)
    echo, echoes = returns.echo, returns.echoes
    if len(number) < len(returns) or (number[1:] < number[:-1]).any():
        intensity, echo, echoes = intensity[number], echo[number], echoes[number]
    weights = np.full(int(np.count_nonzero(down)), returns.lost_weight, np.float32)
    return PointAttributes.of(intensity, echo, echoes, ends[down], origins[down], weights)
