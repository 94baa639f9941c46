"""Dead reckoning without GPS, and the reports of filter and receiver."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.autopilot.position_aiding import PositionAiding
from sitl.vehicle.rigid_body import State, from_euler

F64 = NDArray[np.float64]
DT_S = 0.01
TRUTH = State(np.zeros(3), np.zeros(3), from_euler(0.0, 0.0, 0.0), np.zeros(3), np.zeros(3))


def after(aiding: PositionAiding, seconds: float) -> PositionAiding:
    for _ in range(round(seconds / DT_S)):
        aiding.update(DT_S)
    return aiding


def lost(seconds: float, bearing_rad: float = 0.0) -> PositionAiding:
    aiding = PositionAiding()
    aiding.lose_gps(bearing_rad)
    return after(aiding, seconds)


def off_m(aiding: PositionAiding) -> float:
    return math.hypot(*aiding.offset_enu_m[:2])


@pytest.mark.parametrize(("seconds", "error_m"), [(2.0, 0.07), (5.0, 0.43), (10.0, 1.7), (30.0, 1.7)])
def test_the_error_grows_to_one_metre_seventy_within_ten_seconds(seconds: float, error_m: float) -> None:
    assert off_m(lost(seconds)) == pytest.approx(error_m, rel=0.05)


def test_it_wanders_towards_the_bearing_and_stays_level() -> None:
    np.testing.assert_allclose(lost(10, math.pi / 2).offset_enu_m, (1.7, 0.0, 0.0), atol=0.01)
    np.testing.assert_allclose(lost(10, math.pi).offset_enu_m, (0.0, -1.7, 0.0), atol=0.01)


def test_the_estimate_is_off_by_that_error_in_place_and_in_speed() -> None:
    aiding = PositionAiding()
    estimator = Estimator(np.random.default_rng(0), EstimateErrors.none(), aiding)
    aiding.lose_gps(0.0)
    before = estimator.update(DT_S, TRUTH)
    for _ in range(500):
        estimate = estimator.update(DT_S, TRUTH)
    moved = estimate.pos_enu_m - before.pos_enu_m
    np.testing.assert_allclose(moved, aiding.offset_enu_m, atol=1e-3)
    np.testing.assert_allclose(estimate.vel_enu_ms, (0.0, 0.17, 0.0), atol=1e-3)


def test_the_receiver_has_no_fix_at_once() -> None:
    assert PositionAiding().fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
    assert lost(0.1).fix_type == mavlink.GPS_FIX_TYPE_NO_FIX


# As an ArduCopter 4.7 SITL reported them, but for the height over ground of its rangefinder.
@pytest.mark.parametrize(("seconds", "flags"), [(7.0, 0x33F), (7.5, 0x25), (15.0, 0x25), (15.5, 0xA7)])
def test_the_filter_gives_its_position_up_and_later_stops_aiding(seconds: float, flags: int) -> None:
    assert lost(seconds).flags == flags


def test_nothing_is_tested_without_gps_so_that_no_ratio_grows() -> None:
    assert lost(12.0).test_ratio == PositionAiding().test_ratio > 0.0
    assert lost(16.0).test_ratio == 0.0


def test_a_short_gap_is_pulled_in_without_a_jump() -> None:
    aiding = lost(5.0)
    aiding.regain_gps()
    before = off_m(aiding)
    steps = []
    for _ in range(1500):
        after(aiding, DT_S)
        steps.append(before - off_m(aiding))
        before = off_m(aiding)
    assert max(steps) < 0.02
    assert off_m(aiding) == 0.0
    assert aiding.flags == 831
    assert aiding.take_reset() is None


def test_a_position_given_up_comes_back_by_a_reset() -> None:
    aiding = lost(12.0)
    aiding.regain_gps()
    after(aiding, 1.0)
    assert aiding.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
    assert not aiding.absolute
    was_enu_m = aiding.offset_enu_m
    after(aiding, 1.5)
    assert aiding.absolute
    np.testing.assert_array_equal(aiding.offset_enu_m, np.zeros(3))
    jump_enu_m = aiding.take_reset()
    assert jump_enu_m is not None
    np.testing.assert_allclose(jump_enu_m, -was_enu_m)
    assert aiding.take_reset() is None
