"""Filter of the vehicle's own returns, rain and dust, with counts."""

from __future__ import annotations

import numpy as np

from companion.flight.fusion.vehicle_and_dust_filter import VehicleAndDustFilter
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.returns import Returns
from params import Parameters


def returns(xyz: list[list[float]], intensity: list[int], echo: list[int], echoes: list[int]) -> Returns:
    n = len(xyz)
    return Returns(
        np.array(xyz, np.float32).reshape(n, 3),
        np.arange(n, dtype=np.int64),
        *(np.array(column, np.uint8) for column in (intensity, [0] * n, echo, echoes)),
    )


def test_by_default_everything_passes() -> None:
    some = returns([[0.1, 0, 0], [5, 0, 0]], [0, 0], [1, 1], [2, 1])
    assert VehicleAndDustFilter(Parameters()).filter(some) is some


def test_returns_of_the_vehicle_are_told_by_their_distance_from_the_autopilot_not_the_sensor() -> None:
    parameters = Parameters(vehicle_m=0.8, lidar_x_m=0.0, lidar_y_m=0.0, lidar_z_m=1.0, lidar_pitch_deg=0.0)
    mount = Mount(parameters)
    body = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 1.5], [0.5, 0.5, 0.0], [0.7, 0.7, 0.0]])
    sensor = (body - mount.lever_frd_m) @ mount.rotation_frd_from_sensor
    screen = VehicleAndDustFilter(parameters)
    passed = screen.filter(returns(sensor.tolist(), [50] * 4, [1] * 4, [1] * 4))
    assert passed.stamp_ns.tolist() == [1, 3]
    assert (screen.vehicle, screen.dust) == (2, 0)


def test_rain_and_dust_are_weak_or_let_light_pass_and_are_near() -> None:
    screen = VehicleAndDustFilter(Parameters(dust_reach_m=8.0, dust_intensity=5))
    xyz = [[3.0, 0, 0], [3.0, 0, 0], [3.0, 0, 0], [3.0, 0, 0], [9.0, 0, 0]]
    passed = screen.filter(returns(xyz, [4, 5, 50, 50, 1], [1, 1, 1, 2, 1], [1, 1, 2, 2, 2]))
    assert passed.stamp_ns.tolist() == [1, 3, 4]
    assert (screen.vehicle, screen.dust) == (0, 2)
