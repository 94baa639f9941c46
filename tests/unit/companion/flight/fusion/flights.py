"""Flights with a known pose at every instant, and the pose histories of an autopilot on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.sensors.returns import Returns
from params import Parameters
from slz import LocalFrame

Floats = NDArray[np.float64]
HOME = LocalFrame(47.397742, 8.545594, 488.0)
ENU_FROM_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])
MS = 1_000_000


@dataclass(frozen=True)
class Flight:
    """Constant acceleration and constant body rates, which both interpolations follow exactly."""

    start_enu_m: tuple[float, float, float] = (3.0, -4.0, 30.0)
    velocity_enu_ms: tuple[float, float, float] = (4.0, 2.0, -0.5)
    acceleration_enu_ms2: tuple[float, float, float] = (0.3, -0.8, 0.2)
    first_ned: tuple[float, float, float] = (0.1, -0.2, 1.2)  # rotation vector, body into north-east-down
    rates_frd: tuple[float, float, float] = (0.3, -0.4, 0.9)

    def position_enu_m(self, t_s: Floats) -> Floats:
        t = np.asarray(t_s)[..., None]
        return np.asarray(
            np.array(self.start_enu_m)
            + t * np.array(self.velocity_enu_ms)
            + 0.5 * t**2 * np.array(self.acceleration_enu_ms2)
        )

    def velocity_at(self, t_s: float) -> Floats:
        return np.array(self.velocity_enu_ms) + t_s * np.array(self.acceleration_enu_ms2)

    def ned_from_frd(self, t_s: float) -> Rotation:
        return Rotation.from_rotvec(self.first_ned) * Rotation.from_rotvec(t_s * np.array(self.rates_frd))

    def enu_from_frd(self, t_s: float) -> Floats:
        return np.asarray(ENU_FROM_NED @ self.ned_from_frd(t_s).as_matrix())

    def report_attitude(self, history: PoseHistory, stamp_ns: int, sign: int = 1) -> None:
        x, y, z, w = sign * self.ned_from_frd(stamp_ns * 1e-9).as_quat()
        history.add_attitude(stamp_ns, (w, x, y, z), self.rates_frd)

    def report_position(self, history: PoseHistory, stamp_ns: int) -> None:
        lat, lon, alt = HOME.lla(self.position_enu_m(np.float64(stamp_ns * 1e-9)))
        east, north, up = self.velocity_at(stamp_ns * 1e-9)
        history.add_position(stamp_ns, float(lat), float(lon), float(alt), (north, east, -up))

    def history(
        self, parameters: Parameters, until_ns: int = 2_000 * MS, step_ns: int = 20 * MS
    ) -> PoseHistory:
        """Return attitudes of alternating sign, and positions a little later, as two streams come."""
        history = PoseHistory(parameters, HOME)
        for i, stamp_ns in enumerate(range(0, until_ns + 1, step_ns)):
            self.report_attitude(history, stamp_ns, sign=-1 if i % 3 == 1 else 1)
            self.report_position(history, stamp_ns + 3 * MS)
        return history


def returns_of(xyz: Floats, stamps: NDArray[np.int64]) -> Returns:
    return Returns.plain(np.ascontiguousarray(xyz, np.float32), np.ascontiguousarray(stamps, np.int64))


def sensor_points(flight: Flight, parameters: Parameters, targets_enu_m: Floats, t_s: Floats) -> Floats:
    """Return what the LiDAR measures of known points at known times: the plain chain, backwards."""
    p = parameters
    flu = Rotation.from_euler("ZYX", [p.lidar_yaw_deg, p.lidar_pitch_deg, p.lidar_roll_deg], degrees=True)
    lever = np.array([p.lidar_x_m, p.lidar_y_m, p.lidar_z_m])
    out = []
    for target, t in zip(targets_enu_m, t_s, strict=True):
        body_frd = flight.enu_from_frd(t).T @ (target - flight.position_enu_m(t)) - lever
        out.append(flu.inv().apply(FRD_FROM_FLU @ body_frd))
    return np.array(out)
