"""Poses of ROS messages: converted poses, derived velocities, and refusals."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np
import pytest

from companion.desk.replay.ros.ros_pose import NO_FIX, NO_ORIENTATION, GlobalPoses, LocalPoses
from companion.flight.fusion.pose_history import PoseHistory
from params import Parameters
from tests.unit.companion.desk.replay.flights import HOME, pose

MS = 1_000_000
POSE, ODOMETRY = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry"
FIX, IMU = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"


@dataclass
class Noted:
    """Takes the place of a history, and notes what it is given."""

    frame: object = HOME
    attitudes: list[int] = field(default_factory=list)
    positions: list[tuple[int, np.ndarray, np.ndarray]] = field(default_factory=list)

    def add_attitude(self, stamp_ns: int, _quat: object, _rates: object) -> None:
        self.attitudes.append(stamp_ns)

    def add_position(
        self, stamp_ns: int, lat: float, lon: float, alt: float, ned: tuple[float, float, float]
    ) -> None:
        self.positions.append((stamp_ns, HOME.enu_m(lat, lon, alt), np.array(ned)))


def noted() -> tuple[Noted, PoseHistory]:
    made = Noted()
    return made, cast(PoseHistory, made)


@pytest.mark.parametrize("kind", [POSE, ODOMETRY])
def test_a_local_pose_lies_at_its_metres_from_the_origin_with_the_rate_of_its_neighbours(kind: str) -> None:
    found, history = noted()
    poses = LocalPoses(history)
    for ms in (0, 100, 200):
        poses.add_message(pose(kind, ms), ms * MS)
    assert [stamp for stamp, _, _ in found.positions] == [0, 100 * MS]  # the last waits for what follows
    poses.finish()
    assert found.attitudes == [0, 100 * MS, 200 * MS]
    places = [pose(POSE, ms).pose.position for ms in (0, 100, 200)]
    enu_m = np.array([[p.x, p.y, p.z] for p in places])
    np.testing.assert_allclose([place for _, place, _ in found.positions], enu_m, atol=1e-6)
    enu_ms = [(enu_m[1] - enu_m[0]) / 0.1, (enu_m[2] - enu_m[0]) / 0.2, (enu_m[2] - enu_m[1]) / 0.1]
    wanted = [[v[1], v[0], -v[2]] for v in enu_ms]
    np.testing.assert_allclose([ned for _, _, ned in found.positions], wanted, atol=1e-9)


@pytest.mark.parametrize(("part", "name"), [("position", "z"), ("orientation", "w")])
def test_a_local_pose_that_is_no_number_is_refused(part: str, name: str) -> None:
    found, history = noted()
    poses = LocalPoses(history)
    for ms, value in ((0, 0.5), (100, np.nan), (200, 0.5)):
        message = pose(POSE, ms)
        setattr(getattr(message.pose, part), name, value)
        poses.add_message(message, ms * MS)
    poses.finish()
    assert poses.refused == 1
    assert found.attitudes == [stamp for stamp, _, _ in found.positions] == [0, 200 * MS]


def test_fixes_and_orientations_are_taken_apart_from_each_other() -> None:
    found, history = noted()
    poses = GlobalPoses(history)
    for ms in (0, 100):
        poses.add_message(pose(FIX, ms), ms * MS)
        poses.add_message(pose(IMU, ms), ms * MS + 7)
    poses.finish()
    assert found.attitudes == [7, 100 * MS + 7]
    (_, first, ned), (_, second, _) = found.positions
    np.testing.assert_allclose(ned[[1, 0, 2]] * [1, 1, -1], (second - first) / 0.1, atol=0.05)
    assert poses.refused == 0


def test_an_imu_without_an_orientation_is_refused() -> None:
    """ROS says so by the first number of its covariance."""
    found, history = noted()
    poses = GlobalPoses(history)
    without, broken = pose(IMU, 0), pose(IMU, 0)
    without.orientation_covariance[0] = NO_ORIENTATION
    broken.orientation.x = np.inf
    poses.add_message(without, 0)
    poses.add_message(broken, 0)
    assert (poses.refused, found.attitudes) == (2, [])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("latitude", np.nan),
        ("latitude", 90.1),
        ("longitude", -180.1),
        ("altitude", np.inf),
        ("status", NO_FIX),
    ],
)
def test_a_fix_that_is_no_place_is_refused(name: str, value: float) -> None:
    found, history = noted()
    poses = GlobalPoses(history)
    for ms in (0, 100, 200):
        message = pose(FIX, ms)
        if ms == 100:
            setattr(message.status if name == "status" else message, name, value)
        poses.add_message(message, ms * MS)
    poses.finish()
    assert poses.refused == 1
    assert [stamp for stamp, _, _ in found.positions] == [0, 200 * MS]


def test_a_place_that_comes_again_or_too_late_has_no_velocity_and_is_passed_over() -> None:
    found, history = noted()
    poses = LocalPoses(history)
    for ms in (0, 100, 100, 50, 200):
        poses.add_message(pose(POSE, ms), ms * MS)
    poses.finish()
    assert [stamp for stamp, _, _ in found.positions] == [0, 100 * MS, 200 * MS]
    assert all(np.isfinite(ned).all() for _, _, ned in found.positions)


def test_a_single_place_tells_no_velocity_and_is_not_handed_on() -> None:
    found, history = noted()
    poses = GlobalPoses(history)
    poses.add_message(pose(FIX, 0), 0)
    poses.finish()
    poses.finish()
    assert found.positions == []


def test_metres_from_an_origin_that_nobody_named_are_an_error() -> None:
    poses = LocalPoses(PoseHistory(Parameters()))
    poses.add_message(pose(POSE, 0), 0)
    with pytest.raises(RuntimeError, match="need an origin"):
        poses.add_message(pose(POSE, 100), 100 * MS)
