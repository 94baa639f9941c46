"""LiDAR odometry and the autopilot's filter in one loop: what is stated is believed, and steers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.odometry.gyro_track import GyroTrack
from companion.flight.fusion.odometry.lidar_odometry import LidarOdometry
from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.axes import rotation_enu_from_frd
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.outputs.external_position.odometry_message import (
    clock_message,
    earliest_ns,
    odometry_message,
)
from params import Parameters
from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.autopilot.position_aiding import AIDED
from slz import LocalFrame, Scan
from tests.unit.companion.flight.fusion.odometry.worlds import (
    NOISE_M,
    beside_wall,
    courtyard,
    near_ground,
    plain,
    roofs,
    wall,
)
from tests.unit.sitl.autopilot.aiding.external_poses import EXTERNAL
from tests.unit.sitl.bench_flight import ORIGIN, Bench

Floats = NDArray[np.float64]
World = Callable[[np.random.Generator], Floats]
FRAME = LocalFrame(*ORIGIN)
VEHICLE = VehicleState(sysid=1, autopilot=ARDUPILOT)
AIDING = EXTERNAL | {"VISO_DELAY_MS": 200.0, "VISO_POS_M_NSE": 0.1, "EK3_SRC2_YAW": 1.0}
STEP_S, SCAN_NS = 0.025, 50_000_000
SCANNED_FROM_M = 2.0
ALONE_S = 10.0


def two_walls(rng: np.random.Generator) -> Floats:
    """Points of level ground between two long walls, densely seen."""
    walls = [wall(rng, None, y) for y in (-8.0, 8.0) for _ in range(3)]
    return np.concatenate([near_ground(rng), *walls])


def walls_seldom(rng: np.random.Generator) -> Floats:
    """Level ground, whose walls one scan in ten shows."""
    return courtyard(rng) if rng.random() < 0.1 else plain(rng)


class Loop:
    """A simulated vehicle in a hover, whose autopilot gets the odometry of a closed-form world.

    Attributes
    ----------
    stated_m
        Horizontal error of each estimate that was sent, (2,), beside that of the first.
    """

    def __init__(self, world: World) -> None:
        self.bench = Bench(wind_ms=0.0)
        self.bench.autopilot = Autopilot(ORIGIN, AIDING)
        self.bench.estimator = Estimator(
            np.random.default_rng(1), EstimateErrors.none(), self.bench.autopilot.aiding
        )
        self.bench.autopilot.add_link(0)
        self.world, self.rng = world, np.random.default_rng(1)
        self.history = PoseHistory(Parameters(), FRAME)
        self.odometry = LidarOdometry(self.history, GyroTrack(Mount(Parameters())))
        self.stated_m: list[Floats] = []
        self._waiting: deque[OdometryEstimate] = deque()
        self._true: dict[int, Floats] = {}
        self._calls = 0
        self.bench.run(6.0, self.step, every_s=STEP_S)
        self.bench.airborne_with(self.step, 10.0)

    def step(self) -> None:
        """Hand the autopilot's pose to the companion, a scan at each second call, and ODOMETRY back."""
        autopilot, now_ns = self.bench.autopilot, self.bench.now_ns
        if autopilot.estimate is None:
            return
        self._calls += 1
        if not autopilot.armed:
            self.bench.tell(clock_message(now_ns))
        estimate, truth = autopilot.estimate, self.bench.truth
        self._true[now_ns] = truth.pos_enu_m
        north, east, down = (float(v) for v in estimate.vel_enu_ms[[1, 0, 2]] * [1, 1, -1])
        self.history.add_attitude(now_ns, list(estimate.quat_wxyz), list(estimate.rates_frd_rad_s))
        lat_deg, lon_deg, alt_m = (float(v) for v in FRAME.lla(estimate.pos_enu_m))
        self.history.add_position(now_ns, lat_deg, lon_deg, alt_m, (north, east, down))
        if self._calls % 2 == 0 and truth.pos_enu_m[2] > SCANNED_FROM_M:
            self._scan(now_ns)
        while self._waiting and earliest_ns(VEHICLE, self._waiting[0]) <= now_ns:
            self._send(self._waiting.popleft(), now_ns)

    def _scan(self, now_ns: int) -> None:
        estimate, truth = self.bench.autopilot.estimate, self.bench.truth
        assert estimate is not None
        points = self.world(self.rng)
        points = points + self.rng.normal(0, NOISE_M, points.shape)
        body = (points - truth.pos_enu_m) @ rotation_enu_from_frd(truth.quat_wxyz)
        scan = Scan(
            points_enu_m=body @ rotation_enu_from_frd(estimate.quat_wxyz).T + estimate.pos_enu_m,
            stamp_ns=np.linspace(now_ns - SCAN_NS + 1, now_ns, len(points)).astype(np.int64),
            sensor_enu_m=estimate.pos_enu_m.copy(),
            frame=FRAME,
        )
        before = self.odometry.estimate
        self.odometry.add(scan)
        if self.odometry.estimate is not None and self.odometry.estimate is not before:
            self._waiting.append(self.odometry.estimate)

    def _send(self, estimate: OdometryEstimate, now_ns: int) -> None:
        message = odometry_message(VEHICLE, estimate, np.zeros(3), now_ns)
        if message is not None:
            self.stated_m.append((estimate.position_enu_m - self._true[estimate.stamp_ns])[:2])
            self.bench.tell(message)

    def without_gps(self, seconds: float) -> None:
        """Cut GPS, switch to the odometry and hover."""
        self.stated_m.clear()
        self.bench.autopilot.aiding.lose_gps(0.7)
        self.bench.command(mavlink.MAV_CMD_SET_EKF_SOURCE_SET, 2)
        self.bench.run(seconds, self.step, every_s=STEP_S)

    @property
    def is_aided(self) -> bool:
        return self.bench.autopilot.aiding.flags == AIDED

    @property
    def error_m(self) -> float:
        estimate = self.bench.autopilot.estimate
        assert estimate is not None
        return float(np.hypot(*(estimate.pos_enu_m - self.bench.truth.pos_enu_m)[:2]))


@pytest.mark.parametrize("world", [courtyard, roofs])
def test_where_the_scans_show_the_place_the_vehicle_is_held(world: World) -> None:
    loop = Loop(world)
    loop.without_gps(ALONE_S)
    assert len(loop.stated_m) > 8 * ALONE_S
    assert loop.is_aided
    assert loop.error_m < 0.2


@pytest.mark.parametrize("world", [plain, beside_wall, two_walls, walls_seldom])
def test_where_they_do_not_nothing_is_stated_that_is_not_so(world: World) -> None:
    loop = Loop(world)
    loop.without_gps(ALONE_S)
    assert not loop.is_aided or loop.error_m < 0.5
    assert max((float(np.hypot(*off)) for off in loop.stated_m), default=0.0) < 0.3
