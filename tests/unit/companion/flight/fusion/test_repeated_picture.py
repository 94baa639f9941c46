"""A LiDAR that repeats one picture is recognised from another height or tilt, and nothing true is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.fusion.repeated_picture import MOST, RepeatedPicture, View
from companion.flight.fusion.vehicle_and_dust_filter import VehicleAndDustFilter
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.returns import Returns
from params import Parameters

N, SCAN_S, S = 2_000, 0.05, 1_000_000_000
RNG = np.random.default_rng(7)


def picture(n: int = N) -> NDArray[np.float32]:
    """Return what a sensor sees of rough ground, to the millimetre."""
    return np.asarray(np.round(RNG.normal(0.0, 3.0, (n, 3)), 3), np.float32)


def level(up_m: float) -> View:
    return View(up_m, np.array([0.0, 0.0, -1.0]))


def tilted(roll_deg: float) -> View:
    """Return a view at 10 m, with the vehicle rolled."""
    roll = math.radians(roll_deg)
    return View(10.0, np.array([0.0, -math.sin(roll), -math.cos(roll)]))


def judged(
    pictures: list[NDArray[np.float32]], sink_ms: float, memory: RepeatedPicture | None = None
) -> list[bool]:
    """Return the verdicts on pictures of a descent from 10 m."""
    memory = RepeatedPicture() if memory is None else memory
    return [
        memory.is_repeated(one, level(10.0 - sink_ms * k * SCAN_S), round(k * SCAN_S * S))
        for k, one in enumerate(pictures)
    ]


@pytest.mark.parametrize("sink_ms", [0.5, 1.0, -2.0])
def test_a_frozen_picture_is_recognised_within_a_fifth_of_a_metre(sink_ms: float) -> None:
    verdicts = judged([picture()] * 100, sink_ms)
    begun = verdicts.index(True)
    assert 0.14 < abs(sink_ms) * begun * SCAN_S < 0.21
    assert all(verdicts[begun:])


def test_several_pictures_in_turn_are_recognised_too() -> None:
    turns = [picture() for _ in range(8)]
    assert all(judged(turns * 10, 1.0)[11:])


@pytest.mark.parametrize("most_deg", [1.0, 2.0, -8.0])
def test_in_level_flight_a_change_of_tilt_tells(most_deg: float) -> None:
    memory, frozen = RepeatedPicture(), picture()
    verdicts = [
        memory.is_repeated(frozen, tilted(most_deg * k / 20), round(k * SCAN_S * S)) for k in range(21)
    ]
    assert verdicts == [abs(most_deg * k / 20) > 1.5 for k in range(21)]


def test_a_vehicle_that_stands_may_see_the_same_for_ever() -> None:
    assert not any(judged([picture()] * 100, 0.0))


def test_new_pictures_are_none_whatever_was_seen_before() -> None:
    memory = RepeatedPicture()
    frozen = picture()
    assert not any(judged([picture() for _ in range(100)], 1.0))
    assert judged([frozen] * 40 + [picture() for _ in range(5)], 1.0, memory)[39:] == [True] + [False] * 5
    assert memory.returns == (40 - 3) * N


def test_half_a_picture_that_repeats_is_a_wall() -> None:
    wall = picture(N // 2)
    assert not any(judged([np.concatenate([wall, picture(N // 2)]) for _ in range(60)], 1.0))


def test_few_returns_and_none_are_not_judged() -> None:
    for n in (0, 1, 100):
        assert not any(judged([picture(n)] * 60, 1.0))


def test_a_clock_that_was_set_back_begins_anew() -> None:
    memory, frozen = RepeatedPicture(), picture()
    assert any(judged([frozen] * 20, 1.0, memory))
    assert judged([frozen] * 3, 1.0, memory) == [False] * 3


def test_stamps_that_stand_still_fill_no_memory() -> None:
    memory = RepeatedPicture()
    for k in range(300):
        memory.is_repeated(picture(20_000), level(10.0 - 0.01 * k), S)
    memory.is_repeated(picture(0), level(0.0), S)
    assert len(memory) <= MOST


# Filter of the vehicle's own returns, rain and dust, with counts.


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
