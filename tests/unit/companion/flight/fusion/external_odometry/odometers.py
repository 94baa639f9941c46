"""A vehicle with an autopilot that errs, and an odometry in a frame of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.external_odometry import ExternalOdometry
from companion.flight.fusion.external_odometry.external_pose import ExternalPose
from companion.flight.fusion.external_odometry.odometry_topic import ChildFrame
from companion.flight.fusion.pose_history import PoseHistory
from params import Parameters
from slz import LocalFrame, Scan

Floats = NDArray[np.float64]
HOME = LocalFrame(47.397742, 8.545594, 488.0)
STEP_NS, POSE_NS, SCAN_NS = 50_000_000, 100_000_000, 100_000_000
FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])
NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
# Frame of the odometry in the world: turned about up, tilted as its first pose was, and elsewhere.
FRAME = Rotation.from_euler("zyx", [130.0, 8.0, -5.0], degrees=True)
ORIGIN_M = np.array([12.0, -7.0, 3.0])


def square(t: float) -> Floats:
    """Flight around a circle of 8 m at 3 m/s, 20 m high."""
    angle = 3.0 * t / 8.0
    return np.array([8.0 * np.cos(angle) - 8.0, 8.0 * np.sin(angle), 20.0])


def nothing(_t: float) -> Floats:
    return np.zeros(3)


@dataclass
class Odometer:
    """A flight, step by step.

    path: true position by time. error_enu_m: of the autopilot's position. yaw_error_rad: of its heading,
    about up. told: edits a pose of the odometry before it is sent; None sends none.
    """

    path: Callable[[float], Floats] = square
    error_enu_m: Callable[[float], Floats] = nothing
    yaw_error_rad: Callable[[float], float] = lambda _t: 0.0
    told: Callable[[float, ExternalPose], ExternalPose | None] = lambda _t, pose: pose
    child: ChildFrame = field(default_factory=ChildFrame.of_vehicle)
    noise_m: float = 0.01
    gps_lost: bool = False
    delay_ns: int = 60_000_000
    pose_ns: int = POSE_NS
    seed: int = 1

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.history = PoseHistory(Parameters(), HOME)
        self.odometry = ExternalOdometry(self.history, self.child, lambda: self.gps_lost)
        self.now_ns = 1_000_000_000
        self.off: list[Floats] = []  # of the pose on the map from the true one, by scan
        self._sent: list[tuple[int, ExternalPose]] = []

    def run(self, seconds: float) -> Odometer:
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.now_ns += STEP_NS
            self._autopilot()
            if self.now_ns % self.pose_ns == 0:
                pose = self.told(self.t, self.pose())
                if pose is not None:
                    self._sent.append((self.now_ns + self.delay_ns, pose))
            while self._sent and self._sent[0][0] <= self.now_ns:
                self.odometry.add_pose(self._sent.pop(0)[1])
            if self.now_ns % SCAN_NS == 0:
                self.odometry.add(self.scan())
                self.off.append(self.placed_m() - self.path(self.t))
        return self

    @property
    def t(self) -> float:
        return self.now_ns * 1e-9 - 1.0

    def attitude(self, t: float) -> Floats:
        """Return the true rotation of forward-right-down into the map: it turns, and leans a little."""
        flu = Rotation.from_euler("zyx", [0.4 * t, 0.05 * np.sin(t), 0.05 * np.cos(t)])
        return np.asarray(flu.as_matrix() @ FRD_FROM_FLU)

    def pose(self) -> ExternalPose:
        """Return the pose that the odometry tells now."""
        frd = self.attitude(self.t)
        rotation = frd @ self.child.rotation_child_from_frd.T
        child_m = self.path(self.t) - rotation @ self.child.vehicle_m
        noise = self.rng.normal(0, self.noise_m, 3)
        frame = FRAME.as_matrix()
        covariance = np.diag([0.05**2] * 3 + [0.01**2] * 3)
        return ExternalPose(
            self.now_ns, frame.T @ (child_m + noise - ORIGIN_M), frame.T @ rotation, covariance, True,
            "odom", "base_link", "a",
        )  # fmt: skip

    def placed_m(self) -> Floats:
        """Return where the vehicle is on the map."""
        pose = self.history.latest(self.now_ns)
        assert pose is not None
        return pose.position_enu_m

    def scan(self) -> Scan:
        stamps = np.linspace(self.now_ns - SCAN_NS + 1, self.now_ns, 3).astype(np.int64)
        return Scan(np.zeros((3, 3)), stamps, self.path(self.t), HOME)

    def _autopilot(self) -> None:
        t, step_s = self.t, 1e-3
        drift_ms = (self.error_enu_m(t + step_s) - self.error_enu_m(t - step_s)) / (2 * step_s)
        drift_ms *= np.linalg.norm(drift_ms) < 5.0  # else it is a step
        moves_ms = (self.path(t + step_s) - self.path(t - step_s)) / (2 * step_s)
        east, north, up = moves_ms + drift_ms
        lat, lon, alt = (float(v) for v in HOME.lla(self.path(t) + self.error_enu_m(t)))
        turned = Rotation.from_euler("z", self.yaw_error_rad(t)).as_matrix() @ self.attitude(t)
        x, y, z, w = Rotation.from_matrix(NED_FROM_ENU @ turned).as_quat()
        self.history.add_attitude(self.now_ns, (w, x, y, z), (0.0, 0.0, 0.0))
        self.history.add_position(self.now_ns, lat, lon, alt, (north, east, -up))
