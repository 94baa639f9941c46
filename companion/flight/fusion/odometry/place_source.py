"""Interface of an odometry: the source of the vehicle's place on the map."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from companion.flight.fusion.odometry.gyro_track import GyroTrack
from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from params import Parameters
from slz import Scan

if TYPE_CHECKING:
    from companion.flight.fusion.odometry.lidar_odometry import LidarOdometry


class PlaceSource(Protocol):
    """Odometry that sets the history's correction.

    Attributes
    ----------
    name
        Name in texts to the pilot.
    estimate
        Newest pose on the map, None without one.
    """

    name: str
    estimate: OdometryEstimate | None

    def add(self, scan: Scan) -> None:
        """Take a scan as the autopilot's poses place it, and set the correction for it."""

    def tells_place(self, now_ns: int) -> bool:
        """Return whether position and tilt are known now."""

    def is_tracking(self, now_ns: int) -> bool:
        """Return whether the place is known now, or was within three seconds."""

    @property
    def gps_drift_m(self) -> float:
        """Distance by which the autopilot's position went off the map within the last ten seconds, m."""

    def statistics(self) -> dict[str, int]:
        """Return the counts."""


def open_odometry(
    parameters: Parameters, history: PoseHistory, gps_lost: Callable[[], bool] = lambda: False
) -> LidarOdometry | None:
    """Return the odometry that corrects a history, None where it is off."""
    if parameters.odometry == "off":
        return None
    from companion.flight.fusion.odometry.lidar_odometry import LidarOdometry

    return LidarOdometry(history, GyroTrack(Mount(parameters)), gps_lost)
