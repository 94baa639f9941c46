"""Poses from outside: the frames, qualities and rates that are taken, and the clock of their stamps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.external_navigation import ExternalNavigation
from sitl.autopilot.aiding.source_sets import JitterCorrection
from sitl.autopilot.parameters import DEFAULTS, in_range
from tests.unit.sitl.autopilot.aiding.external_poses import BODY_FRD, LOCAL_FRD, UNKNOWN, odometry

F64 = NDArray[np.float64]
PLACE = np.array([3.0, 4.0, 5.0])
NOW_NS = 20_000_000_000


def receiver(**parameters: float) -> ExternalNavigation:
    return ExternalNavigation(DEFAULTS | {"VISO_TYPE": 1.0} | parameters)


def test_a_pose_is_read_as_north_east_down_with_its_heading_and_speed() -> None:
    external = receiver()
    external.on_odometry(odometry(PLACE, 1_000, yaw_rad=math.pi / 2, velocity=(2.0, 0.5, 0.25)), NOW_NS)
    (pose,) = external.drain(None)
    np.testing.assert_allclose(pose.position_enu_m, PLACE)
    assert pose.yaw_rad == pytest.approx(math.pi / 2)
    assert pose.velocity_enu_ms is not None
    np.testing.assert_allclose(pose.velocity_enu_ms, (2.0, -0.5, -0.25), atol=1e-6)
    assert (pose.error_m, pose.yaw_error_rad) == (0.2, 0.2)
    assert external.is_healthy(NOW_NS)
    assert external.drain(None) == []


@pytest.mark.parametrize(
    "frames",
    [
        (mavlink.MAV_FRAME_LOCAL_NED, BODY_FRD),
        (mavlink.MAV_FRAME_LOCAL_ENU, BODY_FRD),
        (mavlink.MAV_FRAME_LOCAL_FLU, BODY_FRD),
        (LOCAL_FRD, LOCAL_FRD),
        (LOCAL_FRD, mavlink.MAV_FRAME_LOCAL_NED),
    ],
)
def test_other_frames_are_dropped_and_do_not_count_as_alive(frames: tuple[int, int]) -> None:
    external = receiver()
    external.on_odometry(odometry(PLACE, 1_000, frames=frames), NOW_NS)
    assert external.drain(None) == []
    assert external.refused == 1
    assert not external.is_healthy(NOW_NS)


def test_by_default_nothing_is_taken() -> None:
    external = ExternalNavigation(DEFAULTS)
    external.on_odometry(odometry(PLACE, 1_000), NOW_NS)
    assert external.drain(None) == []
    assert not external.enabled


def test_a_type_set_in_flight_counts_after_a_restart() -> None:
    parameters = dict(DEFAULTS)
    external = ExternalNavigation(parameters)
    parameters["VISO_TYPE"] = 1.0
    assert not external.enabled
    external.restart()
    assert external.enabled


def test_a_bad_quality_is_alive_but_not_taken() -> None:
    external = receiver(VISO_QUAL_MIN=50.0)
    external.on_odometry(odometry(PLACE, 1_000, quality=49), NOW_NS)
    assert external.drain(None) == []
    assert external.is_healthy(NOW_NS)
    external.on_odometry(odometry(PLACE, 101_000, quality=50), NOW_NS + 100_000_000)
    assert len(external.drain(None)) == 1


def test_failed_odometry_is_not_taken_by_default() -> None:
    external = receiver()
    external.on_odometry(odometry(PLACE, 1_000, quality=-1), NOW_NS)
    assert external.drain(None) == []


def test_not_a_number_is_not_taken() -> None:
    external = receiver()
    external.on_odometry(odometry(np.array([1.0, math.nan, 2.0]), 1_000), NOW_NS)
    assert external.drain(None) == []


def test_more_than_fifty_a_second_are_thinned() -> None:
    external = receiver()
    for number in range(100):
        external.on_odometry(odometry(PLACE, 1_000 + number * 10_000), NOW_NS + number * 10_000_000)
    assert len(external.drain(None)) == 50


def test_the_delay_is_subtracted_and_the_covariance_counts_above_the_least_noise() -> None:
    external = receiver(VISO_DELAY_MS=60.0)
    message = odometry(PLACE, 1_000)
    message.pose_covariance = [0.3, 0, 0, 0, 0, 0, 0.3, 0, 0, 0, 0, 0.4] + [0.0] * 9
    external.on_odometry(message, NOW_NS)
    (pose,) = external.drain(None)
    assert pose.stamp_ns == NOW_NS - 60_000_000
    assert pose.error_m == pytest.approx(1.0)
    assert pose.yaw_error_rad == pytest.approx(0.2)


def test_a_new_reset_counter_marks_one_pose() -> None:
    external = receiver()
    for number, resets in enumerate((0, 0, 1, 1)):
        stamp_us = 1_000 + number * 100_000
        external.on_odometry(odometry(PLACE, stamp_us, resets=resets), NOW_NS + stamp_us * 1000)
    assert [pose.is_reset for pose in external.drain(None)] == [False, False, True, False]


def test_unused_poses_are_aligned_level_to_the_filter() -> None:
    external = receiver()
    external.on_odometry(odometry(PLACE, 1_000), NOW_NS)
    external.drain(np.array([10.0, 20.0, 30.0]))
    external.on_odometry(odometry(PLACE, 101_000), NOW_NS + 100_000_000)
    (pose,) = external.drain(None)
    np.testing.assert_allclose(pose.position_enu_m, (10.0, 20.0, 5.0))


def test_a_vision_position_has_no_frame_and_no_quality() -> None:
    external = receiver()
    external.on_vision_position(
        mavlink.MAVLink_vision_position_estimate_message(1_000, 4.0, 3.0, -5.0, 0.0, 0.0, 0.5, UNKNOWN, 0),
        NOW_NS,
    )
    (pose,) = external.drain(None)
    np.testing.assert_allclose(pose.position_enu_m, PLACE)
    assert pose.yaw_rad == pytest.approx(0.5)
    assert pose.velocity_enu_ms is None


def test_jitter_of_the_link_does_not_move_stamps() -> None:
    jitter, rng = JitterCorrection(), np.random.default_rng(1)
    lags_ns = 30_000_000 + rng.integers(0, 80_000_000, 300)
    lags_ns[0] = 30_000_000
    for number, lag_ns in enumerate(lags_ns):
        stamp_ns = number * 100_000_000
        found_ns = jitter.local_ns(stamp_ns, 7_000_000_000 + stamp_ns + int(lag_ns))
        assert abs(found_ns - (7_030_000_000 + stamp_ns)) < 8_000_000


def test_a_stamp_of_another_clock_is_at_most_half_a_second_old() -> None:
    jitter = JitterCorrection()
    jitter.local_ns(10**18, NOW_NS)
    assert jitter.local_ns(5, NOW_NS + 10**9) == NOW_NS + 5 * 10**8


@pytest.mark.parametrize(
    ("name", "value", "fits"), [("VISO_QUAL_MIN", -1.0, True), ("VISO_DELAY_MS", 251.0, False)]
)
def test_parameters_are_limited_as_in_the_autopilot(name: str, value: float, fits: bool) -> None:
    assert in_range(name, value) is fits
