"""Ground effect of the simulated rotors."""

import numpy as np
import pytest

from sitl.vehicle.ground_effect import ROTOR_OVER_FEET_M, ROTOR_RADIUS_M, ground_effect
from sitl.vehicle.multirotor import GRAVITY_MS2, Vehicle

DT_S = 0.0025


def test_thrust_one_radius_over_the_ground_rises_by_a_fifteenth() -> None:
    assert ground_effect(ROTOR_RADIUS_M - ROTOR_OVER_FEET_M) == pytest.approx(16 / 15)


def test_the_effect_fades_with_height_and_is_bounded_below() -> None:
    heights = (-5.0, -0.2, 0.0, 0.5, 1.0, 5.0, 1e6)
    factors = [ground_effect(height) for height in heights]
    assert factors == sorted(factors, reverse=True)
    assert factors[0] < 1.34
    assert factors[4] < 1.002
    assert factors[-1] == pytest.approx(1.0)


def test_a_vehicle_near_the_ground_is_accelerated_upwards_by_the_additional_thrust() -> None:
    near, far = (Vehicle(np.random.default_rng(1), (0.0, 0.0, up), 0.0, 0.0) for up in (0.4, 50.0))
    for body in (near, far):
        for tick in range(160):  # until the motors have their speed
            body.update(DT_S, tick * 2_500_000, (np.zeros(3), GRAVITY_MS2), 0.0)
    additional = near.truth.acc_enu_ms2[2] - far.truth.acc_enu_ms2[2]
    share = ground_effect(near.truth.pos_enu_m[2]) - 1
    assert share > 0.005
    assert additional == pytest.approx(GRAVITY_MS2 * share, rel=0.15)
