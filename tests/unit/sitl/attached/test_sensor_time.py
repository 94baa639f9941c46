"""Sensor clock with a simulator that is too slow, stops, or reports late."""

import numpy as np
import pytest

from sitl.attached.pose_source import SensorTime

STEP_NS = 10_000_000
S = 1_000_000_000


def errors_ms(rate: float, late_ns: object = None, seconds: float = 30.0) -> np.ndarray:
    """Return how far the stamps are from real time (ms), pose by pose, with a simulator of a rate."""
    time, rng = SensorTime(), np.random.default_rng(1)
    time.restart(5 * S, 0, 0)
    found = []
    for i in range(round(seconds * S / STEP_NS)):
        real_ns = i * STEP_NS
        late = rng.exponential(1e6) if late_ns is None else 0.0
        found.append(time.to_sensor_ns(5 * S + round(real_ns * rate), real_ns + round(late)) - real_ns)
    return np.array(found) / 1e6


@pytest.mark.parametrize("rate", [1.0, 0.98, 1.03])
def test_it_runs_with_real_time_beside_a_simulator_that_does_not(rate: float) -> None:
    assert np.abs(errors_ms(rate)[1000:]).max() < 3.0


def test_a_message_held_up_moves_the_stamps_by_a_millisecond_or_two() -> None:
    time = SensorTime()
    time.restart(0, 0, 0)
    for i in range(1000):
        at = time.to_sensor_ns(i * STEP_NS, i * STEP_NS)
    at = time.to_sensor_ns(1000 * STEP_NS, 1000 * STEP_NS + 80_000_000)
    assert abs(at - 1000 * STEP_NS) < 2_000_000


def test_it_stands_still_with_the_simulator() -> None:
    time = SensorTime()
    time.restart(0, 0, 0)
    assert time.to_sensor_ns(STEP_NS, STEP_NS) == STEP_NS
    assert time.to_sensor_ns(2 * STEP_NS, 9 * S) == 2 * STEP_NS
    assert time.to_sensor_ns(3 * STEP_NS, 9 * S + STEP_NS) == 3 * STEP_NS


def test_a_message_that_waited_to_be_read_does_not_move_the_stamps() -> None:
    time = SensorTime()
    time.restart(0, 0, 0)
    for i in range(1000):
        time.to_sensor_ns(i * STEP_NS, i * STEP_NS)
    for i in range(1000, 1200):
        assert time.to_sensor_ns(i * STEP_NS, None) == i * STEP_NS
    assert time.to_sensor_ns(1200 * STEP_NS, 1200 * STEP_NS) == 1200 * STEP_NS


@pytest.mark.parametrize("lost_ms", [30, 60, 300, 900])
def test_when_the_simulator_loses_time_at_a_stroke_it_goes_on_with_real_time_a_fifth_of_a_second_later(
    lost_ms: int,
) -> None:
    time, lost_ns, errors = SensorTime(), lost_ms * 1_000_000, []
    time.restart(0, 0, 0)
    for i in range(2000):
        boot_ns = i * STEP_NS
        real_ns = boot_ns + (lost_ns if i >= 1000 else 0)
        errors.append(time.to_sensor_ns(boot_ns, real_ns) - real_ns)
    assert np.abs(errors[1020:]).max() < 3_000_000


def test_time_that_the_simulator_makes_up_for_is_followed_at_once() -> None:
    time = SensorTime()
    time.restart(0, 0, 0)
    for i in range(2000):
        boot_ns = i * STEP_NS
        real_ns = boot_ns + (80_000_000 if 1000 <= i < 1100 else 0)
        at_ns = time.to_sensor_ns(boot_ns, real_ns)
        if i >= 1100:
            assert abs(at_ns - real_ns) < 3_000_000
