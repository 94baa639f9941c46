"""Radio channels, their overrides, and the effect of the sticks."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.autopilot.radio_receiver import AT_REST, PITCH, ROLL, RadioReceiver, Sticks
from tests.unit.sitl.bench_flight import Bench

SECOND = 1_000_000_000
LEFT_ALONE = 65_535
PULSES = [(1519, 0.0), (1800, 0.737), (1950, 1.0), (1200, -0.737)]


def override(roll: int = LEFT_ALONE, pitch: int = LEFT_ALONE, throttle: int = LEFT_ALONE) -> Sequence[int]:
    return [roll, pitch, throttle, *[LEFT_ALONE] * 5]


def stick(
    bench: Bench, *, roll: int = LEFT_ALONE, pitch: int = LEFT_ALONE, throttle: int = LEFT_ALONE
) -> None:
    values = override(roll, pitch, throttle)
    bench.tell(mavlink.MAVLink_rc_channels_override_message(1, 1, *values))


def test_a_transmitter_at_rest_deflects_nothing() -> None:
    receiver = RadioReceiver()
    assert receiver.channels(0) == list(AT_REST)
    assert receiver.sticks(0) == Sticks()


@pytest.mark.parametrize(
    ("pulse_us", "deflection"), [(1519, 0.0), (1800, 0.737), (1950, 1.0), (1200, -0.737)]
)
def test_a_stick_counts_from_beyond_its_dead_zone(pulse_us: int, deflection: float) -> None:
    receiver = RadioReceiver()
    receiver.transmitter[ROLL] = pulse_us
    assert receiver.sticks(0).right == pytest.approx(deflection, abs=1e-3)


def test_pitch_forward_is_a_low_pulse() -> None:
    receiver = RadioReceiver()
    receiver.transmitter[PITCH] = 1200
    assert receiver.sticks(0).forward > 0.5


def test_an_override_lasts_three_seconds_or_until_it_is_released() -> None:
    receiver = RadioReceiver()
    receiver.override(override(roll=1800), 0)
    assert receiver.channels(2 * SECOND)[ROLL] == 1800
    receiver.override(override(pitch=1700), 2 * SECOND)
    assert receiver.channels(2 * SECOND)[:2] == [1800, 1700]
    assert receiver.channels(4 * SECOND)[:2] == [1500, 1700]
    receiver.override(override(pitch=0), 4 * SECOND)
    assert receiver.channels(4 * SECOND) == list(AT_REST)


def test_the_radio_is_lost_after_a_second_of_silence_and_its_sticks_with_it() -> None:
    receiver = RadioReceiver()
    receiver.transmitter[ROLL] = 1800
    assert receiver.sticks(0).right > 0.5
    receiver.transmitting = False
    assert not receiver.lost(SECOND // 2)
    assert receiver.lost(2 * SECOND)
    assert receiver.sticks(2 * SECOND) == Sticks()
    receiver.transmitting = True
    assert not receiver.lost(3 * SECOND)


def test_overrides_of_another_than_the_ground_station_do_nothing() -> None:
    bench = Bench().run(1)
    message = mavlink.MAVLink_rc_channels_override_message(1, 1, *override(roll=1800))
    message.pack(mavlink.MAVLink(None, 7, 190))
    bench.autopilot.receive(message, 0, bench.now_ns)
    assert bench.autopilot.receiver.channels(bench.now_ns)[ROLL] == 1500
    stick(bench, roll=1800)
    assert bench.autopilot.receiver.channels(bench.now_ns)[ROLL] == 1800


# ---- what the sticks move ---------------------------------------------------------------------------


def over_target(parameters: dict[str, float] | None = None, height_m: float = 12.0) -> Bench:
    """Return a vehicle in LAND that follows a target under it."""
    bench = Bench(wind_ms=0.0)
    bench.autopilot.parameters.update(parameters or {})
    bench.airborne(height_m)
    bench.run(3, lambda: bench.landing_target(0, 0))
    assert bench.command(mavlink.MAV_CMD_NAV_LAND) == 0
    return bench.run(1, lambda: bench.landing_target(0, 0))


def moved(bench: Bench, seconds: float, **sticks: int) -> tuple[float, float]:
    """Return metres to the right and ahead that the vehicle moves meanwhile."""
    before, yaw = bench.truth.pos_enu_m, 0.7

    def each() -> None:
        bench.landing_target(0, 0)
        if sticks:
            stick(bench, **sticks)

    bench.run(seconds, each)
    east, north, _ = bench.truth.pos_enu_m - before
    right, ahead = np.array([math.cos(yaw), -math.sin(yaw)]), np.array([math.sin(yaw), math.cos(yaw)])
    return float(right @ (east, north)), float(ahead @ (east, north))


def test_a_roll_stick_in_land_moves_the_vehicle_and_its_target_is_given_up() -> None:
    bench = over_target()
    right, ahead = moved(bench, 5.0, roll=1800)
    assert right == pytest.approx(4.15, abs=0.8)  # as measured on ArduCopter
    assert abs(ahead) < 0.3
    stick(bench, roll=0)
    bench.run(25, lambda: bench.landing_target(0, 0))
    assert not bench.autopilot.armed
    assert math.hypot(*bench.truth.pos_enu_m[:2]) > 3.5


def test_a_pitch_stick_in_land_moves_it_ahead() -> None:
    right, ahead = moved(over_target(), 2.0, pitch=1200)
    assert ahead > 0.8
    assert abs(right) < 0.3


def test_a_stick_within_its_dead_zone_leaves_the_landing_on_its_target() -> None:
    bench = over_target()
    moved(bench, 5.0, roll=1515)
    bench.run(20, lambda: bench.landing_target(0, 0))
    assert math.hypot(*bench.truth.pos_enu_m[:2]) < 0.2


def test_a_parameter_switches_repositioning_off() -> None:
    bench = over_target({"LAND_REPOSITION": 0})
    assert math.hypot(*moved(bench, 2.0, roll=1800)) < 0.3


def test_sticks_do_nothing_in_guided() -> None:
    bench = Bench(wind_ms=0.0).airborne(5)
    before = bench.truth.pos_enu_m
    bench.run(4, lambda: stick(bench, roll=1800, pitch=1200, throttle=1000))
    assert np.abs(bench.truth.pos_enu_m - before).max() < 0.3


def test_sticks_fly_in_loiter_and_a_low_throttle_sinks() -> None:
    bench = Bench(wind_ms=0.0).airborne(12)
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.LOITER) == 0
    right, ahead = moved(bench, 3.0, roll=1700)
    assert right > 5
    assert abs(ahead) < 1
    bench.run(8, lambda: stick(bench, roll=0))
    assert math.hypot(*bench.truth.vel_enu_ms[:2]) < 0.5
    bench.run(3, lambda: stick(bench, throttle=1000))
    assert bench.truth.vel_enu_ms[2] == pytest.approx(-2.5, abs=0.3)
