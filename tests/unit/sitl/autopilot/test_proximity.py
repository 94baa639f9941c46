"""Obstacles from OBSTACLE_DISTANCE and OBSTACLE_DISTANCE_3D: arming, and avoidance in GUIDED."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.proximity import FRESH_NS, Proximity
from sitl.vehicle.rigid_body import to_euler
from tests.unit.sitl.bench_flight import Bench

WALL_EAST_M = 12.0


def obstacles(
    distances_m: dict[int, float], *, step_deg: float = 5.0, first_deg: float = 0.0, max_cm: int = 4000
) -> mavlink.MAVLink_obstacle_distance_message:
    """Return a message with distances by sector number, nothing elsewhere."""
    cells = [round(distances_m[i] * 100) if i in distances_m else 65535 for i in range(72)]
    return mavlink.MAVLink_obstacle_distance_message(0, 0, cells, 99, 20, max_cm, step_deg, first_deg, 12)


def wall(bench: Bench) -> None:
    """Tell of a wall that runs north to south."""
    yaw = to_euler(bench.truth.quat_wxyz)[2]
    seen = {}
    for sector in range(72):
        towards = math.sin(yaw + math.radians(5 * sector))
        if towards > 0.1:
            seen[sector] = (WALL_EAST_M - float(bench.truth.pos_enu_m[0])) / towards
    bench.tell(obstacles({i: d for i, d in seen.items() if 0.2 < d < 40}))


def with_proximity() -> Bench:
    bench = Bench()
    bench.run(6, lambda: wall(bench))
    bench.autopilot.parameters["PRX1_TYPE"] = 2
    return bench.airborne_with(lambda: wall(bench))


def test_arming_is_blocked_without_proximity_data_only_where_it_is_asked_for() -> None:
    bench = Bench().run(6)
    bench.autopilot.parameters["PRX1_TYPE"] = 2
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4) == 0
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_FAILED
    wall(bench)
    bench.run(0.6)
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_FAILED
    wall(bench)
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0


def test_a_guided_velocity_stops_before_a_wall_and_slides_along_it() -> None:
    bench = with_proximity()

    def each() -> None:
        wall(bench)
        bench.velocity(4, 1, 0)

    bench.run(20, each)
    assert 2.0 <= WALL_EAST_M - float(bench.truth.pos_enu_m[0]) < 3.0
    assert bench.truth.vel_enu_ms[1] == pytest.approx(1.0, abs=0.2)


def test_a_guided_position_is_flown_through_it() -> None:
    bench = with_proximity()
    bench.tell(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 0b110111111000, 0, WALL_EAST_M + 5, -10, 0, 0, 0, 0, 0, 0, 0, 0
        )
    ).run(15, lambda: wall(bench))
    assert bench.truth.pos_enu_m[0] > WALL_EAST_M


@pytest.mark.parametrize(
    ("message", "stopped"),
    [
        (obstacles({0: 1.5}), True),
        (obstacles({18: 1.5}), False),  # to the right
        (obstacles({0: 1.5}, first_deg=90.0), False),
        (obstacles({18: 1.5}, first_deg=-90.0), True),
        (obstacles({9: 1.5}, step_deg=40.0), True),  # a full turn
        (obstacles({0: 0.0}), False),
        (obstacles({0: 655.35}), False),
        (obstacles({0: 0.1}), False),
        (obstacles({0: 1.5}, max_cm=100), False),
        (obstacles({0: 1.5}, step_deg=math.nan), True),  # the whole degrees count then
        (obstacles({0: 1.5}, first_deg=math.inf), False),
    ],
)
def test_distances_are_relative_to_the_body_and_count_within_their_range(
    message: mavlink.MAVLink_obstacle_distance_message, stopped: bool
) -> None:
    proximity = Proximity()
    proximity.receive(message, 0)
    ahead = np.array([1.0, 0.0, 0.5])  # facing east
    limited = proximity.limited(ahead, math.pi / 2, 2.0, 0)
    np.testing.assert_allclose(limited, [0.0 if stopped else 1.0, 0.0, 0.5], atol=1e-9)


def test_what_is_old_is_forgotten() -> None:
    proximity = Proximity()
    proximity.receive(obstacles({0: 1.0}), 0)
    north = np.array([0.0, 1.0, 0.0])
    assert proximity.limited(north, 0.0, 2.0, FRESH_NS)[1] == 0.0
    assert proximity.limited(north, 0.0, 2.0, FRESH_NS + 1)[1] == 1.0


MS = 1_000_000
FORWARD, DOWN = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])  # east, north, up, facing north


def point(
    stamp_ms: int, x: float, y: float = 0, z: float = 0, *, frame: int = 12, max_m: float = 40.0
) -> mavlink.MAVLink_obstacle_distance_3d_message:
    return mavlink.MAVLink_obstacle_distance_3d_message(stamp_ms, 0, frame, 65535, x, y, z, 0.5, max_m)


def speed(proximity: Proximity, towards: np.ndarray, now_ms: int) -> float:
    return float(proximity.limited(towards, 0.0, 2.0, now_ms * MS) @ towards)


def test_a_batch_of_points_is_used_when_the_next_stamp_comes_or_after_fifty_milliseconds() -> None:
    proximity = Proximity()
    proximity.receive_3d(point(1, 1.5), 0)
    proximity.receive_3d(point(1, 0, 0, 1.5), 10 * MS)
    assert speed(proximity, FORWARD, 20) == 1.0
    assert speed(proximity, FORWARD, 70) == speed(proximity, DOWN, 70) == 0.0
    proximity.receive_3d(point(2, 0, 0, 1.5), 80 * MS)
    assert speed(proximity, FORWARD, 90) == 0.0, "the batch before"
    proximity.receive_3d(point(3, 0, 0, 1.5), 90 * MS)
    assert speed(proximity, FORWARD, 95) == 1.0
    assert speed(proximity, DOWN, 95) == 0.0


def test_one_stamp_for_ever_is_one_batch_for_ever_but_for_gaps() -> None:
    proximity = Proximity()
    for at in range(0, 400, 40):
        proximity.receive_3d(point(0, 1.5), at * MS)
    assert speed(proximity, FORWARD, 370) == 1.0


@pytest.mark.parametrize(
    "dropped", [point(1, 0.2), point(1, 41.0), point(1, 0.0), point(1, 1.5, frame=20), point(1, 1.5, frame=1)]
)
def test_what_is_dropped_still_counts_as_a_sign_of_life(
    dropped: mavlink.MAVLink_obstacle_distance_3d_message,
) -> None:
    proximity = Proximity()
    proximity.receive_3d(dropped, 0)
    assert proximity.fresh(FRESH_NS)
    assert not proximity.fresh(FRESH_NS + 1)
    assert speed(proximity, FORWARD, 100) == 1.0


def test_distances_not_told_again_are_forgotten_though_points_keep_it_alive() -> None:
    proximity = Proximity()
    proximity.receive(obstacles({0: 1.5}), 0)
    for at in range(0, 1400, 100):
        proximity.receive_3d(point(at, 1.5, frame=20), at * MS)
    assert speed(proximity, FORWARD, 1000) == 0.0
    assert speed(proximity, FORWARD, 1001) == 1.0


def test_points_and_distances_together_hold_a_guided_velocity_back() -> None:
    bench = with_proximity()
    bench.run(3, lambda: (wall(bench), bench.velocity(1, 0, 0), bench.tell(point(bench.now_ns // MS, 1.0))))
    yaw = to_euler(bench.truth.quat_wxyz)[2]
    assert abs(float(bench.truth.vel_enu_ms[:2] @ (math.sin(yaw), math.cos(yaw)))) < 0.15
    assert float(np.hypot(*bench.truth.vel_enu_ms[:2])) > 0.3, "it slides by"
    assert bench.autopilot.proximity.fresh(bench.now_ns)
    assert bench.autopilot.faults == 0


@pytest.mark.parametrize(("hz", "healthy"), [(10.0, 1.0), (3.0, 1.0), (1.0, 0.5)])
def test_a_distance_sensor_is_healthy_at_three_hertz_and_not_at_one(hz: float, healthy: float) -> None:
    bench = Bench().run(1)
    read: list[bool] = []

    def tell() -> None:
        if int(bench.now_ns * hz * 1e-9) != int((bench.now_ns - 50 * MS) * hz * 1e-9):
            bench.tell(mavlink.MAVLink_distance_sensor_message(0, 5, 12_000, 640, 0, 0, 25, 255))
        read.append(bench.autopilot.range_down_m() is not None)

    bench.run(5, tell)
    late = read[20:]
    assert sum(late) / len(late) == pytest.approx(healthy, abs=0.06)


@pytest.mark.parametrize(
    ("orientation", "low_cm", "high_cm", "found"),
    [(25, 5, 12_000, 6.4), (24, 5, 12_000, None), (25, 700, 12_000, None), (25, 5, 500, None)],
)
def test_only_a_distance_downwards_and_in_its_own_range_is_read(
    orientation: int, low_cm: int, high_cm: int, found: float | None
) -> None:
    bench = Bench().run(1)
    bench.tell(mavlink.MAVLink_distance_sensor_message(0, low_cm, high_cm, 640, 0, 0, orientation, 255))
    assert bench.autopilot.range_down_m() == found
