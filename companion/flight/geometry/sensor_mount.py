"""Extrinsic calibration of the LiDAR: boresight and lever arm on the vehicle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters

Floats = NDArray[np.float64]

FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])


def rotation_frd_from_sensor(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Floats:
    """Return the rotation (3, 3) of sensor forward-left-up axes into body forward-right-down.

    R = Rz(yaw) Ry(pitch) Rx(roll), right-handed rotations about forward, left and up, maps sensor into body
    forward-left-up axes: positive roll lowers the right side, positive pitch lowers the sensor's x axis,
    positive yaw turns it left.

    With pitch alone, the direction of elevation e in the sensor's x-z plane, (cos e, 0, sin e), maps to
    (cos(pitch - e), 0, -sin(pitch - e)), which is straight down for pitch = 90 deg + e. The middle of a
    Mid-360's field of view (-7 to +52 deg) is e = 22.5 deg, so pitch = 112.5 deg points it straight down.
    The sensor's z axis, e = 90 deg, then points forward and 22.5 deg below the horizon; being 67.5 deg away
    from that middle, it cannot point above the horizon.
    """
    roll, pitch, yaw = (math.radians(a) for a in (roll_deg, pitch_deg, yaw_deg))
    about_x = [[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]
    about_y = [[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]]
    about_z = [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    return np.ascontiguousarray(FRD_FROM_FLU @ np.array(about_z) @ np.array(about_y) @ np.array(about_x))


class Mount:
    """Boresight and lever arm of the LiDAR.

    Attributes
    ----------
    rotation_frd_from_sensor
        (3, 3), sensor forward-left-up into body forward-right-down.
    lever_frd_m
        (3,), sensor's origin in body axes, m.
    """

    def __init__(self, parameters: Parameters) -> None:
        p = parameters
        self.rotation_frd_from_sensor = rotation_frd_from_sensor(
            p.lidar_roll_deg, p.lidar_pitch_deg, p.lidar_yaw_deg
        )
        self.lever_frd_m = np.array([p.lidar_x_m, p.lidar_y_m, p.lidar_z_m])
