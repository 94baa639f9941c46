"""Opening of the odometry, where the parameters ask for it; its kernels are loaded only then."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from companion.flight.fusion.odometry.gyro_track import GyroTrack
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from params import Parameters

if TYPE_CHECKING:
    from companion.flight.fusion.odometry.lidar_odometry import LidarOdometry


def open_odometry(
    parameters: Parameters, history: PoseHistory, gps_lost: Callable[[], bool] = lambda: False
) -> LidarOdometry | None:
    """Return the odometry that corrects a history, None where it is off."""
    if parameters.odometry == "off":
        return None
    from companion.flight.fusion.odometry.lidar_odometry import LidarOdometry

    return LidarOdometry(history, GyroTrack(Mount(parameters)), gps_lost)
