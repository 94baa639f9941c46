"""The doctor's finding about the LiDAR's inertial measurement unit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.flight.doctor.finding import Finding
from companion.flight.doctor.imu_check import ImuObservation
from companion.flight.geometry.sensor_mount import Mount, rotation_frd_from_sensor
from companion.flight.sensors.imu_samples import ImuSamples
from params import Parameters

NONE = (0.0, 0.0, 0.0)
MOUNTED = Parameters(lidar_roll_deg=5.0, lidar_pitch_deg=112.5, lidar_yaw_deg=20.0)


def quaternion(pitch_deg: float) -> tuple[float, float, float, float]:
    half = math.radians(pitch_deg) / 2
    return math.cos(half), 0.0, math.sin(half), 0.0


def examined(
    *,
    hz: float = 200.0,
    weight_ms2: float = 9.81,
    bias_degs: float = 0.5,
    noise_degs: float = 0.1,
    pitch_deg: float = 0.0,
    tilt_deg: float = 0.0,
    attitudes: bool = True,
    turning_rads: float = 0.0,
    seconds: float = 5.0,
) -> Finding:
    """Examine a vehicle at rest, nose up by `pitch_deg`, whose LiDAR is mounted wrong by `tilt_deg`."""
    observation, rng = ImuObservation(Mount(MOUNTED)), np.random.default_rng(3)
    true = rotation_frd_from_sensor(5.0, 112.5 + tilt_deg, 20.0)
    pitch = math.radians(pitch_deg)
    up_frd = np.array([math.sin(pitch), 0.0, -math.cos(pitch)])
    n = round(hz * seconds)
    stamp_ns = (np.arange(n) * 1e9 / hz).astype(np.int64)
    rates = rng.normal([math.radians(bias_degs), 0, 0], math.radians(noise_degs), (n, 3))
    force = weight_ms2 * (up_frd @ true) + rng.normal(0, 0.05, (n, 3))
    observation.add_samples(ImuSamples(stamp_ns, rates, force))
    for at_ns in stamp_ns[::4] if attitudes else ():
        observation.add_attitude(int(at_ns), quaternion(pitch_deg), (turning_rads, 0.0, 0.0))
    (finding,) = observation.findings({"imu": n})
    return finding


@pytest.mark.parametrize("pitch_deg", [0.0, 8.0, -30.0])
def test_a_sound_unit_on_a_true_mount_has_nothing_to_remedy(pitch_deg: float) -> None:
    finding = examined(pitch_deg=pitch_deg)
    assert (finding.state, finding.remedy) == ("ok", "")
    assert "200 Hz, bias 0.50 deg/s, noise 0.10 deg/s, 9.81 m/s2, mount 0.0 deg" in finding.found


@pytest.mark.parametrize(
    ("tilt_deg", "state", "said"),
    [(2.0, "ok", "mount 2.0"), (5.0, "warn", "mount 5.0"), (-22.0, "fail", "22.0")],
)
def test_gravity_shows_a_wrong_mount(tilt_deg: float, state: str, said: str) -> None:
    finding = examined(tilt_deg=tilt_deg)
    assert finding.state == state
    assert said in finding.found
    assert ("lidar_pitch_deg" in finding.remedy) == (state != "ok")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"hz": 60.0}, "port of the IMU"),
        ({"weight_ms2": 1.0}, "units"),
        ({"weight_ms2": 9.5}, "units"),
        ({"bias_degs": 4.0}, "warm up"),
        ({"seconds": 0.5}, "port of the IMU"),
    ],
)
def test_what_is_wrong_has_a_remedy(wrong: dict[str, float], said: str) -> None:
    finding = examined(**wrong)  # type: ignore[arg-type]
    assert finding.state == "warn"
    assert said in finding.remedy


@pytest.mark.parametrize("moving", [{"noise_degs": 6.0}, {"turning_rads": 0.1}])
def test_a_vehicle_that_moves_is_judged_by_the_rate_alone(moving: dict[str, float]) -> None:
    finding = examined(tilt_deg=20.0, **moving)  # type: ignore[arg-type]
    assert finding.state == "ok"
    assert "not at rest" in finding.found


def test_without_an_autopilot_the_mount_is_not_judged() -> None:
    finding = examined(tilt_deg=20.0, attitudes=False)
    assert finding.state == "ok"
    assert "no attitude" in finding.found


def test_a_sensor_without_one_has_no_finding() -> None:
    observation = ImuObservation(Mount(MOUNTED))
    observation.add_attitude(0, quaternion(0), NONE)
    assert observation.findings({}) == []
    assert observation.findings({"imu": 0}) == []


def test_packets_without_a_time_are_named() -> None:
    (finding,) = ImuObservation(Mount(MOUNTED)).findings({"imu": 7})
    assert finding.state == "warn"
    assert "7 packets" in finding.found
    assert "clock" in finding.remedy
