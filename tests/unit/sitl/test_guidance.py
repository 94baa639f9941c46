"""Guided targets, and the disarming on the ground."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.vehicle.rigid_body import to_euler
from tests.unit.sitl.bench_flight import Bench

ONLY_RATE, ONLY_YAW, ONLY_POSITION = 0b010111000111, 0b100111000111, 0b110111111000


def target(
    bench: Bench, mask: int, *, frame: int = 1, ahead: float = 0.0, yaw: float = 0.0, rate: float = 0.0
) -> Bench:
    return bench.tell(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, frame, mask, ahead, 0, 0, 0, 0, 0, 0, 0, 0, yaw, rate
        )
    )


def turning(bench: Bench) -> float:
    return abs(float(bench.truth.rates_frd_rad_s[2]))


def test_a_turn_rate_ends_three_seconds_after_the_last_target() -> None:
    bench = target(Bench().airborne(10), ONLY_RATE, rate=0.5).run(2)
    assert turning(bench) == pytest.approx(0.5, abs=0.05)
    assert turning(bench.run(6)) < 0.05


@pytest.mark.parametrize(("mask", "yaw", "rate"), [(ONLY_YAW, math.nan, 0), (ONLY_RATE, 0, math.nan)])
def test_a_heading_that_is_no_number_is_not_followed(mask: int, yaw: float, rate: float) -> None:
    bench = target(Bench().airborne(10), mask, yaw=yaw, rate=rate)
    assert turning(bench.run(5)) < 0.05


@pytest.mark.parametrize("frame", [mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED])
def test_a_position_in_a_body_frame_is_an_offset_from_the_vehicle(frame: int) -> None:
    bench = Bench().airborne(10)
    bench.run(8, lambda: bench.velocity(4, 0, 0))
    bench.run(5)
    start, yaw = bench.truth.pos_enu_m, to_euler(bench.truth.quat_wxyz)[2]
    target(bench, ONLY_POSITION, frame=frame, ahead=5).run(10)
    moved = bench.truth.pos_enu_m - start
    np.testing.assert_allclose(moved, (5 * math.sin(yaw), 5 * math.cos(yaw), 0), atol=0.5)


def test_it_disarms_by_itself_on_the_ground_ten_seconds_after_touching_it() -> None:
    bench = Bench().airborne(5)
    bench.run(14, lambda: bench.velocity(0, 0, -0.5))
    assert bench.vehicle.on_ground
    assert bench.autopilot.armed
    bench.run(8, lambda: bench.velocity(0, 0, 1.0))
    assert bench.vehicle.on_ground
    assert not bench.autopilot.armed


def test_arming_again_starts_the_ten_seconds_again() -> None:
    bench = Bench().run(6)
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED) == 0
    for _ in range(2):
        assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        assert bench.run(9).autopilot.armed
        assert not bench.run(2).autopilot.armed
