"""Topic of an external odometry, as on the command line, and the axes of its child frame."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from companion.flight.fusion.external_odometry.external_pose import ExternalPose
from companion.flight.geometry.sensor_mount import FRD_FROM_FLU, Mount
from companion.runtime.errors import UsageError
from params import Parameters

Floats = NDArray[np.float64]

EXAMPLE = "/TOPIC of nav_msgs/Odometry, or /TOPIC?lidar if its poses are the LiDAR's (docs/ros2.md)"
LIDAR = "lidar"
_TOPIC = re.compile(r"(/[A-Za-z_]\w*)+", re.ASCII)


@dataclass(frozen=True, slots=True)
class OdometryTopic:
    """Topic. of_lidar: its poses are those of the LiDAR's axes, not of the vehicle's."""

    name: str
    of_lidar: bool = False

    def __str__(self) -> str:
        return f"{self.name}?{LIDAR}" if self.of_lidar else self.name

    def child_frame(self, parameters: Parameters) -> ChildFrame:
        """Return the axes of its poses on the vehicle."""
        return ChildFrame.of_lidar(Mount(parameters)) if self.of_lidar else ChildFrame.of_vehicle()


def parse_odometry_topic(text: str) -> OdometryTopic:
    """Return what `/TOPIC[?lidar]` says.

    Raises
    ------
    UsageError
        It is malformed.
    """
    name, mark, query = text.partition("?")
    if not _TOPIC.fullmatch(name) or (mark and query != LIDAR):
        raise UsageError(f"--ros2-odometry {text!r} is no topic: write {EXAMPLE}")
    return OdometryTopic(name, bool(mark))


@dataclass(frozen=True, slots=True)
class ChildFrame:
    """Child frame of an odometry on the vehicle.

    rotation_child_from_frd : (3, 3), body forward-right-down into child axes. vehicle_m : (3,), the vehicle's
    origin in child axes.
    """

    rotation_child_from_frd: Floats
    vehicle_m: Floats

    @classmethod
    def of_vehicle(cls) -> Self:
        """Return base_link of REP 105: forward, left, up."""
        return cls(np.ascontiguousarray(FRD_FROM_FLU.T), np.zeros(3))

    @classmethod
    def of_lidar(cls, mount: Mount) -> Self:
        """Return the axes of the LiDAR as it is mounted."""
        rotation = np.ascontiguousarray(mount.rotation_frd_from_sensor.T)
        return cls(rotation, -rotation @ mount.lever_frd_m)

    def vehicle(self, pose: ExternalPose) -> tuple[Floats, Floats, Floats]:
        """Return position (3,), rotation from forward-right-down (3, 3) and covariance (6, 6) of the vehicle.

        All are in the frame of the odometry.
        """
        lever = pose.rotation @ self.vehicle_m
        jacobian = np.eye(6)
        jacobian[:3, 3:] = [
            [0.0, lever[2], -lever[1]],
            [-lever[2], 0.0, lever[0]],
            [lever[1], -lever[0], 0.0],
        ]
        return (
            pose.position_m + lever,
            pose.rotation @ self.rotation_child_from_frd,
            jacobian @ pose.covariance @ jacobian.T,
        )
