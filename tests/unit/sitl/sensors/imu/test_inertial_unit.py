"""The IMU inside a LiDAR: what it feels at rest, in turns and on a lever, and its errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors.imu.inertial_unit import (
    GRAVITY_MS2,
    IAM_20680,
    ICM_40609,
    InertialErrors,
    InertialModel,
    InertialSamples,
    InertialUnit,
)
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.sensor_clock import Clock
from sitl.vehicle.pose_track import PoseTrack
from sitl.vehicle.rigid_body import from_euler

F64 = NDArray[np.float64]
TICK_NS = 2_500_000
UPRIGHT = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=0.0)
CLOCK = Clock()


def true_unit(place_m: tuple[float, float, float] = (0.0, 0.0, 0.0), rate_hz: int = 200) -> InertialUnit:
    return InertialUnit(np.random.default_rng(1), InertialModel(rate_hz, place_m, InertialErrors.none()))


def turning(rate_rad_s: float, seconds: float, radius_m: float = 0.0) -> PoseTrack:
    """Return the motion of a level vehicle that turns right, ahead on a circle of a radius."""
    track = PoseTrack()
    for k in range(round(seconds * 1e9 / TICK_NS) + 1):
        yaw = rate_rad_s * k * TICK_NS * 1e-9
        place = radius_m * np.array([-math.cos(yaw), math.sin(yaw), 0.0])
        speed = radius_m * rate_rad_s * np.array([math.sin(yaw), math.cos(yaw), 0.0])
        track.add(k * TICK_NS, place, from_euler(0.0, 0.0, yaw), speed)
    return track


def measured(unit: InertialUnit, track: PoseTrack, mount: Mount = UPRIGHT) -> InertialSamples:
    return unit.measure(track.stamps[0], track.stamps[-1], track, mount, CLOCK)


def test_at_rest_and_upright_z_is_one_g_up() -> None:
    found = measured(true_unit(), turning(0.0, 1.0))
    np.testing.assert_allclose(found.force_ms2, np.tile([0, 0, GRAVITY_MS2], (len(found.stamp_ns), 1)))
    np.testing.assert_array_equal(found.rate_rad_s, np.zeros_like(found.rate_rad_s))


def test_samples_come_at_the_sensors_own_rate_by_its_clock() -> None:
    clock = Clock(offset_ns=5_000_000_000, drift_ppb=1_000_000)
    track = turning(0.0, 10.0)
    found = true_unit().measure(0, 10_000_000_000, track, UPRIGHT, clock)
    assert set(np.diff(found.stamp_ns)) == {5_000_000}
    assert len(found.stamp_ns) == 2002  # a thousandth fast
    assert 5_000_000_000 < found.stamp_ns[0] <= 5_005_000_000


def test_no_sample_is_lost_or_repeated_between_scans() -> None:
    track, unit = turning(0.3, 1.0), true_unit()
    whole = measured(true_unit(), track)
    parts = [
        unit.measure(t0, t0 + 10_000_000, track, UPRIGHT, CLOCK) for t0 in range(0, 1_000_000_000, 10_000_000)
    ]
    np.testing.assert_array_equal(np.concatenate([part.stamp_ns for part in parts]), whole.stamp_ns)
    np.testing.assert_array_equal(np.concatenate([part.rate_rad_s for part in parts]), whole.rate_rad_s)


def test_the_noise_does_not_depend_on_how_time_is_divided() -> None:
    track = turning(0.3, 1.0)
    whole = measured(InertialUnit(np.random.default_rng(1), ICM_40609), track)
    unit = InertialUnit(np.random.default_rng(1), ICM_40609)
    cuts = [(0, 500_000_000), (500_000_000, 1_000_000_000)]
    parts = [unit.measure(*cut, track, UPRIGHT, CLOCK).force_ms2 for cut in cuts]
    np.testing.assert_allclose(np.concatenate(parts), whole.force_ms2, atol=1e-12)


def test_a_right_turn_is_negative_about_z_up_and_positive_about_z_down() -> None:
    found = measured(true_unit(), turning(0.5, 1.0))
    np.testing.assert_allclose(
        found.rate_rad_s, np.tile([0.0, 0.0, -0.5], (len(found.stamp_ns), 1)), atol=1e-9
    )
    down = measured(true_unit(), turning(0.5, 1.0), Mount((0.0, 0.0, 0.0), pitch_deg=90.0))
    np.testing.assert_allclose(down.rate_rad_s - [0.5, 0.0, 0.0], 0.0, atol=1e-9)
    np.testing.assert_allclose(down.force_ms2[:, 0], -GRAVITY_MS2, atol=1e-9)


def test_a_circle_is_felt_towards_its_centre() -> None:
    found = measured(true_unit(), turning(0.5, 1.0, radius_m=8.0))
    np.testing.assert_allclose(found.force_ms2[:, 1], -8.0 * 0.25, rtol=1e-3)  # y is left, the centre right
    np.testing.assert_allclose(found.force_ms2[:, 0], 0.0, atol=0.01)


def test_a_lever_is_felt_by_its_centripetal_acceleration() -> None:
    track = turning(2.0, 1.0)
    found = measured(true_unit(), track, Mount((0.5, 0.0, 0.0), pitch_deg=0.0))
    np.testing.assert_allclose(found.force_ms2[1:, 0], -0.5 * 4.0, rtol=1e-3)
    inside = measured(true_unit((0.0, 0.25, 0.0)), track)
    np.testing.assert_allclose(inside.force_ms2[1:, 1], -0.25 * 4.0, rtol=1e-3)


def test_the_integral_of_what_is_felt_is_the_motion() -> None:
    """Dead reckoning with the true attitude from the samples alone gives the velocity back."""
    rng, track = np.random.default_rng(4), PoseTrack()
    position, velocity = np.zeros(3), np.zeros(3)
    angles, spin = np.zeros(3), np.zeros(3)
    for k in range(801):
        track.add(k * TICK_NS, position, from_euler(*angles), velocity)
        step_s = TICK_NS * 1e-9
        spin = spin + rng.normal(0.0, 0.05, 3)
        angles = angles + spin * step_s
        acceleration = rng.normal(0.0, 3.0, 3)
        position = position + velocity * step_s + 0.5 * acceleration * step_s**2
        velocity = velocity + acceleration * step_s
    unit = true_unit(rate_hz=400)
    found = unit.measure(0, track.stamps[-1], track, UPRIGHT, Clock(0, 0))
    assert len(found.stamp_ns) == 800
    gained, falling = np.zeros(3), np.array([0.0, 0.0, GRAVITY_MS2])
    _, quats = track.at(found.stamp_ns)
    for force, quat in zip(found.force_ms2, quats, strict=True):
        gained = gained + (UPRIGHT.to_enu(force[None], quat[None])[0] - falling) * TICK_NS * 1e-9
    np.testing.assert_allclose(gained, track.velocities[-1] - track.velocities[0], atol=1e-9)


def test_the_shock_of_a_touchdown_is_felt() -> None:
    track = PoseTrack()
    for k, speed in enumerate((-1.0, -1.0, 0.0, 0.0, 0.0)):
        track.add(k * TICK_NS, np.zeros(3), from_euler(0.0, 0.0, 0.0), np.array([0.0, 0.0, speed]))
    found = true_unit(rate_hz=400).measure(0, 4 * TICK_NS, track, UPRIGHT, Clock(0, 0))
    np.testing.assert_allclose(found.force_ms2[:, 2] - GRAVITY_MS2, (0.0, 400.0, 0.0, 0.0), atol=1e-9)


@pytest.mark.parametrize("model", [ICM_40609, IAM_20680])
def test_white_noise_and_bias_have_their_sizes(model: InertialModel) -> None:
    track = turning(0.0, 4.0)
    means, spreads = [], []
    for seed in range(200):
        found = measured(InertialUnit(np.random.default_rng(seed), model), track)
        both = np.hstack([found.rate_rad_s, found.force_ms2 - [0.0, 0.0, GRAVITY_MS2]])
        means.append(both.mean(axis=0))
        spreads.append(both.std(axis=0))
    e, bandwidth = model.errors, math.sqrt(model.rate_hz / 2)
    white = np.repeat([e.gyro_noise, e.accel_noise], 3) * bandwidth
    np.testing.assert_allclose(np.mean(spreads, axis=0), white, rtol=0.05)
    np.testing.assert_allclose(
        np.std(means, axis=0), np.repeat([e.gyro_bias_rad_s, e.accel_bias_ms2], 3), rtol=0.2
    )


def test_a_bias_walks() -> None:
    errors = InertialErrors(0.0, 0.0, 0.0, 0.0, gyro_walk=1e-3, accel_walk=1e-2)
    ends = []
    for seed in range(300):
        unit = InertialUnit(np.random.default_rng(seed), InertialModel(100, (0.0, 0.0, 0.0), errors))
        found = measured(unit, turning(0.0, 4.0))
        ends.append([found.rate_rad_s[-1, 0], found.force_ms2[-1, 0]])
    np.testing.assert_allclose(np.std(ends, axis=0), [2e-3, 2e-2], rtol=0.15)


def test_a_turn_that_quickens_is_felt_across_a_lever() -> None:
    track = PoseTrack()
    for k in range(201):
        track.add(
            k * TICK_NS, np.zeros(3), from_euler(0.0, 0.0, 1.5 * (k * TICK_NS * 1e-9) ** 2), np.zeros(3)
        )
    found = measured(true_unit(), track, Mount((0.5, 0.0, 0.0), pitch_deg=0.0))
    np.testing.assert_allclose(found.force_ms2[1:, 1], -0.5 * 3.0, rtol=1e-3)


def test_a_steady_turn_is_steady_across_the_scans() -> None:
    track, unit, across = PoseTrack(), true_unit(rate_hz=400), []
    mount = Mount((0.5, 0.0, 0.0), pitch_deg=0.0)
    for k in range(81):
        track.add(k * TICK_NS, np.zeros(3), from_euler(0.0, 0.0, 2.0 * k * TICK_NS * 1e-9), np.zeros(3))
        if k % 8 == 0 and k > 0:
            found = unit.measure(track.stamps[0], track.stamps[-1], track, mount, Clock(0, 0))
            across.append(found.force_ms2[:, 1])
            track.keep_last()
    np.testing.assert_allclose(np.concatenate(across)[1:], 0.0, atol=1e-6)
