"""Second sensor beside the LiDAR: a radar with the axes of the vehicle, forward and right."""

from __future__ import annotations

from collections.abc import Callable

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.sensors.lidar_url import Lidar, open_lidar
from companion.runtime.errors import UsageError
from params import Parameters
from slz import Scan

MOUNT = {
    "lidar_x_m": 0.0,
    "lidar_y_m": 0.0,
    "lidar_z_m": 0.1,
    "lidar_roll_deg": 0.0,
    "lidar_pitch_deg": 0.0,
    "lidar_yaw_deg": 0.0,
    "lidar_min_m": 1.0,
    "lidar_max_m": 300.0,
    "dust_reach_m": 0.0,
    "vehicle_m": 0.0,
}
"""Parameters of the LiDAR that differ for the radar: dust hides nothing from it."""


def radar_parameters(parameters: Parameters) -> Parameters:
    """Return the parameters with the radar's mount and range gate in place of the LiDAR's."""
    return parameters.model_copy(update=MOUNT)


def open_beside(
    url: str, parameters: Parameters, history: PoseHistory, on_scan: Callable[[Scan], None]
) -> Lidar:
    """Return the driver of a radar beside the LiDAR; its scans are georeferenced with the same poses.

    Raises
    ------
    UsageError
        The URL is wrong or names something else than a radar.
    """
    if url.partition(":")[0] != "radar":
        raise UsageError(f"--radar {url!r}: write radar:HOST:PORT (radar:0.0.0.0:7611)")
    own = radar_parameters(parameters)
    return open_lidar(url, own, ScanAssembler(own, history, on_scan).add)
