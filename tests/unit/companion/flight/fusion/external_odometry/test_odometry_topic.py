"""Topic of an external odometry, and the vehicle's pose by that of its child frame."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.external_pose import ExternalPose
from companion.flight.fusion.external_odometry.odometry_topic import (
    ChildFrame,
    OdometryTopic,
    parse_odometry_topic,
)
from companion.flight.geometry.sensor_mount import Mount
from companion.runtime.errors import UsageError
from params import Parameters


def test_a_topic_is_of_the_vehicle_unless_it_says_lidar() -> None:
    assert parse_odometry_topic("/fast_lio/odometry") == OdometryTopic("/fast_lio/odometry")
    assert parse_odometry_topic("/Odometry?lidar") == OdometryTopic("/Odometry", of_lidar=True)
    assert str(parse_odometry_topic("/Odometry?lidar")) == "/Odometry?lidar"


@pytest.mark.parametrize(
    "text", ["", "odom", "/", "/a//b", "/a b", "/a?", "/a?body", "/1a", "/a?lidar&x", "/*"]
)
def test_another_text_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(UsageError, match="is no topic: write /TOPIC"):
        parse_odometry_topic(text)


def test_the_vehicle_hangs_on_its_lidar_by_the_mount() -> None:
    parameters = Parameters(lidar_x_m=0.2, lidar_z_m=0.1, lidar_pitch_deg=90.0)
    mount, pose = Mount(parameters), Rotation.from_euler("zyx", [0.7, 0.1, -0.2]).as_matrix()
    vehicle_m = np.array([4.0, 5.0, 6.0])
    lidar_m, lidar = vehicle_m + pose @ mount.lever_frd_m, pose @ mount.rotation_frd_from_sensor
    told = ExternalPose(1, lidar_m, lidar, np.eye(6), True, "", "", "")
    found_m, found, _ = ChildFrame.of_lidar(mount).vehicle(told)
    np.testing.assert_allclose(found_m, vehicle_m, atol=1e-12)
    np.testing.assert_allclose(found, pose, atol=1e-12)


def test_an_unsure_attitude_makes_the_place_beside_the_lidar_unsure() -> None:
    """The covariance is that of many poses whose attitude and place err as the message says."""
    child = ChildFrame.of_lidar(Mount(Parameters(lidar_x_m=2.0, lidar_z_m=1.0)))
    rng = np.random.default_rng(1)
    stated = np.diag([1e-4, 4e-4, 1e-4, 1e-3, 2e-3, 5e-3])
    rotation, place = Rotation.from_euler("zyx", [0.5, 0.2, 0.1]), np.array([1.0, 2.0, 3.0])
    errors = rng.multivariate_normal(np.zeros(6), stated, 4000)
    told = [
        ExternalPose(
            1, place + e[:3], (Rotation.from_rotvec(e[3:]) * rotation).as_matrix(), stated, True, "", "", ""
        )
        for e in errors
    ]
    places = np.array([child.vehicle(one)[0] for one in told])
    exact = ExternalPose(1, place, rotation.as_matrix(), stated, True, "", "", "")
    _, _, covariance = child.vehicle(exact)
    np.testing.assert_allclose(np.cov(places.T), covariance[:3, :3], atol=0.08 * covariance[:3, :3].max())
    both = np.cov(np.hstack([places, errors[:, 3:]]).T)
    np.testing.assert_allclose(both[:3, 3:], covariance[:3, 3:], atol=0.08 * np.abs(covariance[:3, 3:]).max())
