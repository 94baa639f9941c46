"""External poses as a companion sends them, for tests of their use."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.vehicle.rigid_body import to_euler
from tests.unit.sitl.bench_flight import Bench

F64 = NDArray[np.float64]
LOCAL_FRD, BODY_FRD = mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD
EXTERNAL = {
    "VISO_TYPE": 1.0,
    "EK3_SRC2_POSXY": 6.0,
    "EK3_SRC2_VELXY": 6.0,
    "EK3_SRC2_YAW": 6.0,
}
UNKNOWN = [math.nan] + [0.0] * 20


def odometry(
    position_enu_m: F64,
    stamp_us: int,
    *,
    yaw_rad: float = 0.0,
    frames: tuple[int, int] = (LOCAL_FRD, BODY_FRD),
    quality: int = 90,
    resets: int = 0,
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Any:
    """Return an ODOMETRY; velocity is forward, right, down."""
    east, north, up = (float(v) for v in position_enu_m)
    quat = [math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)]
    return mavlink.MAVLink_odometry_message(
        stamp_us, *frames, north, east, -up, quat, *velocity, 0.0, 0.0, 0.0, UNKNOWN, UNKNOWN, resets,
        mavlink.MAV_ESTIMATOR_TYPE_LIDAR, quality,
    )  # fmt: skip


@dataclass
class Lidar:
    """A companion that sends ten poses a second, each some time after its measurement.

    turn_rad: error of its heading, clockwise; if `is_turned`, its frame's, of position and heading alike.
    """

    bench: Bench
    late_s: float = 0.0
    error_enu_m: F64 = field(default_factory=lambda: np.zeros(3))
    turn_rad: float = 0.0
    quality: int = 90
    resets: int = 0
    is_on: bool = True
    is_turned: bool = False
    frames: tuple[int, int] = (LOCAL_FRD, BODY_FRD)
    past: list[Any] = field(default_factory=list)

    def __call__(self) -> None:
        self.past.append((self.bench.now_ns, self.bench.truth))
        old = round(self.late_s / 0.1) + 1
        if not self.is_on or len(self.past) < old:
            return
        stamp_ns, truth = self.past[-old]
        yaw = to_euler(truth.quat_wxyz)[2] + self.turn_rad
        ahead, north, east = np.zeros(3), float(truth.vel_enu_ms[1]), float(truth.vel_enu_ms[0])
        ahead[0] = north * math.cos(yaw) + east * math.sin(yaw)
        ahead[1] = east * math.cos(yaw) - north * math.sin(yaw)
        place = truth.pos_enu_m + self.error_enu_m
        if self.is_turned:
            c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
            place = np.array([c * place[0] + s * place[1], c * place[1] - s * place[0], place[2]])
        self.bench.tell(
            odometry(
                place,
                stamp_ns // 1000,
                yaw_rad=yaw,
                quality=self.quality,
                resets=self.resets,
                frames=self.frames,
                velocity=tuple(ahead),
            )
        )


def error_m(bench: Bench) -> F64:
    assert bench.autopilot.estimate is not None
    return np.asarray((bench.autopilot.estimate.pos_enu_m - bench.truth.pos_enu_m)[:2])


def run(bench: Bench, lidar: Lidar, seconds: float) -> None:
    bench.run(seconds, lidar, every_s=0.1)


def heading_error_deg(bench: Bench) -> float:
    assert bench.autopilot.estimate is not None
    headings = (to_euler(state.quat_wxyz)[2] for state in (bench.autopilot.estimate, bench.truth))
    return math.degrees(math.remainder(next(headings) - next(headings), 2 * math.pi))
