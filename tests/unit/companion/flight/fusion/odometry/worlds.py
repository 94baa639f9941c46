"""Closed-form worlds of planes, seen by a vehicle whose autopilot errs in a known way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.odometry.gyro_track import GyroTrack
from companion.flight.fusion.odometry.lidar_odometry import LidarOdometry
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.imu_samples import ImuSamples
from params import Parameters
from slz import LocalFrame, Scan

Floats = NDArray[np.float64]
HOME = LocalFrame(47.397742, 8.545594, 488.0)
SCAN_NS, STEP_NS = 50_000_000, 25_000_000
HEIGHT_M, NOISE_M = 12.0, 0.02


def ground(rng: np.random.Generator) -> Floats:
    """Points of level ground within 25 m."""
    away, angle = 25.0 * np.sqrt(rng.random(2000)), rng.uniform(0, 2 * np.pi, 2000)
    return np.column_stack([away * np.cos(angle), away * np.sin(angle), np.zeros(2000)])


def near_ground(rng: np.random.Generator) -> Floats:
    """Points of level ground within 12 m, as dense as those of a fast LiDAR."""
    return np.column_stack([rng.uniform(-12, 12, (5000, 2)), np.zeros(5000)])


def wall(rng: np.random.Generator, x: float | None, y: float | None) -> Floats:
    """Points of a wall 6 m high: across east at `x`, or across north at `y`."""
    along, up = rng.uniform(-12, 12, 150), rng.uniform(0, 6, 150)
    if x is not None:
        return np.column_stack([np.full(150, x), along, up])
    return np.column_stack([along, np.full(150, y), up])


def plain(rng: np.random.Generator) -> Floats:
    """Level ground alone."""
    return ground(rng)


def beside_wall(rng: np.random.Generator) -> Floats:
    """A wall from west to east on level ground."""
    return np.concatenate([ground(rng), wall(rng, None, 12.0)])


def courtyard(rng: np.random.Generator) -> Floats:
    """Four walls around level ground."""
    walls = [wall(rng, x, None) for x in (-12.0, 12.0)] + [wall(rng, None, y) for y in (-12.0, 12.0)]
    return np.concatenate([ground(rng), *walls])


def roofs(rng: np.random.Generator) -> Floats:
    """Four flat roofs on level ground, seen from above: no walls."""
    points = near_ground(rng)
    on = (np.abs(np.abs(points[:, 0]) - 6.0) < 2.5) & (np.abs(np.abs(points[:, 1]) - 6.0) < 2.5)
    return np.where(on[:, np.newaxis], points + np.array([0.0, 0.0, 3.0]), points)


def terrace(rng: np.random.Generator) -> Floats:
    """Level ground, 3 m higher north of a straight edge."""
    points = near_ground(rng)
    return np.where(points[:, 1:2] > 3.0, points + np.array([0.0, 0.0, 3.0]), points)


def slope(rng: np.random.Generator) -> Floats:
    """Ground that rises 20 degrees to the north."""
    points = near_ground(rng)
    return points + np.outer(points[:, 1] * np.tan(np.radians(20)), (0.0, 0.0, 1.0))


@dataclass
class Odometer:
    """A vehicle that hovers, swaying a little, over a world.

    error_enu_m: of the autopilot's position by time. yaw_error_rad: of its heading, clockwise.
    crowd: share of the returns that come from people who walk about. sway_m: amplitude of the hover.
    """

    world: Callable[[np.random.Generator], Floats]
    error_enu_m: Callable[[float], Floats] = field(default=lambda _t: np.zeros(3))
    yaw_error_rad: Callable[[float], float] = field(default=lambda _t: 0.0)
    crowd: float = 0.0
    seed: int = 1
    sway_m: float = 0.5

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.history = PoseHistory(Parameters(), HOME)
        self.gyro = GyroTrack(Mount(Parameters()))
        self.gps_lost = False
        self.odometry = LidarOdometry(self.history, self.gyro, lambda: self.gps_lost)
        self.now_ns = 0
        self.offsets: list[Floats] = []  # of the pose on the map from the true one, by scan

    def true_enu_m(self, t: float) -> Floats:
        return np.array([self.sway_m * np.sin(0.3 * t), self.sway_m * np.cos(0.4 * t), HEIGHT_M])

    def velocity_enu_ms(self, t: float) -> Floats:
        return self.sway_m * np.array([0.3 * np.cos(0.3 * t), -0.4 * np.sin(0.4 * t), 0.0])

    def run(self, seconds: float) -> Odometer:
        for _ in range(round(seconds * 1e9 / SCAN_NS)):
            self.fly(SCAN_NS)
            self.odometry.add(self.scan())
            pose = self.history.latest(self.now_ns)
            assert pose is not None
            self.offsets.append(pose.position_enu_m - self.true_enu_m(self.now_ns * 1e-9))
        return self

    def scan(self) -> Scan:
        """The scan of this moment, as the autopilot's poses place it."""
        t = self.now_ns * 1e-9
        points = self.world(self.rng)
        people = self.rng.random(len(points)) < self.crowd
        walk = self.rng.uniform((-10, -10, 0), (10, 10, 2), points.shape)
        points = np.where(people[:, np.newaxis], walk, points) + self.rng.normal(0, NOISE_M, points.shape)
        return Scan(
            points_enu_m=self._turned(points - self.true_enu_m(t)) + self.true_enu_m(t) + self.error_enu_m(t),
            stamp_ns=np.linspace(self.now_ns - SCAN_NS + 1, self.now_ns, len(points)).astype(np.int64),
            sensor_enu_m=self.true_enu_m(t) + self.error_enu_m(t),
            frame=HOME,
        )

    def _turned(self, points: Floats) -> Floats:
        """Points around the vehicle, turned clockwise by the error of its heading."""
        angle = self.yaw_error_rad(self.now_ns * 1e-9)
        return np.asarray(points @ Rotation.from_rotvec([0, 0, -angle]).as_matrix().T)

    def fly(self, span_ns: int) -> None:
        """Move on; the autopilot's poses arrive, and no scan."""
        for _ in range(span_ns // STEP_NS):
            self.now_ns += STEP_NS
            t = self.now_ns * 1e-9
            lat, lon, alt = HOME.lla(self.true_enu_m(t) + self.error_enu_m(t))
            east, north, _ = self.velocity_enu_ms(t)
            half = self.yaw_error_rad(t) / 2
            self.history.add_attitude(self.now_ns, (np.cos(half), 0.0, 0.0, np.sin(half)), (0.0, 0.0, 0.0))
            self.gyro.add_attitude(self.now_ns, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            still, gravity = np.zeros((1, 3)), np.array([[0.0, 0.0, 9.81]])
            self.gyro.add_samples(ImuSamples(np.array([self.now_ns]), still, gravity))
            self.history.add_position(self.now_ns, float(lat), float(lon), float(alt), (north, east, 0.0))
