"""Obstacles told by OBSTACLE_DISTANCE: arming, and how GUIDED keeps away from them."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.proximity import FRESH_NS, Proximity
from sitl.state import to_euler
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
