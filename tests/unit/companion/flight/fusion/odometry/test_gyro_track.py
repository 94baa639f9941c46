"""Rotation of the vehicle by the LiDAR's gyroscope, against motions in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.fusion.odometry.gyro_track import GyroTrack
from companion.flight.geometry.sensor_mount import Mount, rotation_frd_from_sensor
from companion.flight.sensors.imu_samples import ImuSamples
from params import Parameters

Floats = NDArray[np.float64]
MS, S = 1_000_000, 1_000_000_000
START_NS = 1000 * S
NEVER = (0.0, 0.0, 0.0)
BIAS = np.array([0.01, -0.02, 0.015])
LEVEL = (1.0, 0.0, 0.0, 0.0)
TURNED = Parameters(lidar_roll_deg=7.0, lidar_yaw_deg=-20.0)  # with pitch alone the rotation is symmetric
MOUNT = Mount(TURNED)
SENSOR = MOUNT.rotation_frd_from_sensor


def angles(t: Floats) -> tuple[Floats, Floats, Floats]:
    """Return roll, pitch and yaw of a lively flight."""
    return 0.2 * np.sin(1.7 * t), 0.15 * np.sin(1.3 * t + 1), 0.2 * t + 0.4 * np.sin(0.5 * t)


def rates(t: Floats) -> Floats:
    """Return body rates (n, 3) of that flight, by the kinematics of Euler angles (yaw, pitch, roll)."""
    roll, pitch, _ = angles(t)
    roll_rate = 0.2 * 1.7 * np.cos(1.7 * t)
    pitch_rate = 0.15 * 1.3 * np.cos(1.3 * t + 1)
    yaw_rate = 0.2 + 0.4 * 0.5 * np.cos(0.5 * t)
    return np.stack(
        [
            roll_rate - yaw_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + yaw_rate * np.sin(roll) * np.cos(pitch),
            -pitch_rate * np.sin(roll) + yaw_rate * np.cos(roll) * np.cos(pitch),
        ],
        axis=-1,
    )


def attitude(t: float) -> Floats:
    """Return the rotation of body axes into north, east, down."""
    roll, pitch, yaw = (float(a) for a in angles(np.array(t)))
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def turned_deg(rotation: Floats) -> float:
    return math.degrees(math.acos(min(1.0, (float(np.trace(rotation)) - 1) / 2)))


def stamps_ns(t: Floats) -> NDArray[np.int64]:
    return START_NS + np.round(t * 1e9).astype(np.int64)


class Rig:
    """A track fed with a flight: the LiDAR at 200 Hz, the autopilot at 50 Hz, whose messages come first."""

    def __init__(
        self, seconds: float = 20.0, *, wrong_deg: tuple[float, ...] = NEVER, noise: float = 0.0
    ) -> None:
        self.track = GyroTrack(MOUNT)
        told = TURNED.lidar_roll_deg, TURNED.lidar_pitch_deg, TURNED.lidar_yaw_deg
        true = rotation_frd_from_sensor(*(a + b for a, b in zip(told, wrong_deg, strict=True)))
        rng = np.random.default_rng(5)
        for k in range(round(seconds * 10)):
            t = k / 10 + np.arange(20) / 200
            slow = t[::4]
            for at_ns, theirs in zip(stamps_ns(slow), rates(slow), strict=True):
                self.track.add_attitude(int(at_ns), LEVEL, (theirs + noise * rng.normal(size=3)).tolist())
            body = rates(t) + BIAS + noise * rng.normal(size=(20, 3))
            self.track.add_samples(self.samples(stamps_ns(t), body @ true))

    def samples(self, at_ns: NDArray[np.int64], sensor_rads: Floats) -> ImuSamples:
        return ImuSamples(at_ns, sensor_rads, np.zeros((len(at_ns), 3)))

    def between(self, t0: float, t1: float) -> Floats | None:
        return self.track.rotation_between(*(int(t) for t in stamps_ns(np.array([t0, t1]))))


@pytest.fixture(scope="module")
def flown() -> Rig:
    return Rig()


def test_the_bias_is_known_after_five_seconds() -> None:
    assert Rig(4.9).track.bias_rads is None
    assert Rig(4.9).between(1.0, 2.0) is None
    bias = Rig(7.0).track.bias_rads
    assert bias is not None
    np.testing.assert_allclose(bias, BIAS, atol=1e-4)


@pytest.mark.parametrize(("t0", "t1"), [(10.0, 10.1), (10.0012, 10.0987), (9.0, 14.0), (12.3, 12.3)])
def test_the_rotation_is_that_of_the_flight(flown: Rig, t0: float, t1: float) -> None:
    rotation = flown.between(t0, t1)
    assert rotation is not None
    true = attitude(t0).T @ attitude(t1)
    assert turned_deg(rotation.T @ true) < 0.002 + 0.01 * (t1 - t0)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


def test_the_way_back_is_the_inverse(flown: Rig) -> None:
    there, back = flown.between(9.0, 10.0), flown.between(10.0, 9.0)
    assert there is not None
    assert back is not None
    np.testing.assert_allclose(there @ back, np.eye(3), atol=1e-12)


def test_coning_adds_up_without_drift() -> None:
    """A body whose axis goes round a cone: its rates turn about z, and the plain sum of steps would drift."""
    cone, speed = math.radians(10), 2 * math.pi * 5
    track = GyroTrack(MOUNT)

    def body(t: Floats) -> Floats:
        across, along = speed * math.sin(cone), speed * (1 - math.cos(cone))
        return np.stack(
            [-across * np.sin(speed * t), across * np.cos(speed * t), np.full_like(t, -along)], -1
        )

    still = np.arange(0, 6, 0.005)
    for t in still[::4]:
        track.add_attitude(int(stamps_ns(np.array(t))), LEVEL, NEVER)
        none = np.zeros((4, 3))
        track.add_samples(ImuSamples(stamps_ns(t + np.arange(4) * 0.005), none, none))
    t = 6 + np.arange(0, 2.001, 0.002)
    track.add_samples(ImuSamples(stamps_ns(t), body(t - 6) @ SENSOR, np.zeros((len(t), 3))))
    rotation = track.rotation_between(START_NS + 6 * S, START_NS + 8 * S)
    assert rotation is not None
    assert turned_deg(rotation) < 0.05  # ten turns of the cone end where they began


def test_no_rotation_across_a_gap_or_beyond_the_samples(flown: Rig) -> None:
    assert flown.between(19.9, 20.1) is None
    assert flown.between(-1.0, 10.0) is None
    rig = Rig()
    t = 20.045 + np.arange(20) / 200
    rig.track.add_samples(rig.samples(stamps_ns(t), np.zeros((20, 3))))
    assert rig.between(19.95, 20.1) is not None
    rig = Rig()
    t = 20.047 + np.arange(20) / 200
    rig.track.add_samples(rig.samples(stamps_ns(t), np.zeros((20, 3))))
    assert rig.between(19.95, 20.1) is None
    assert rig.between(20.05, 20.1) is not None


def test_without_the_autopilot_there_is_no_bias() -> None:
    rig = Rig(0.0)
    t = np.arange(0, 10, 0.005)
    rig.track.add_samples(rig.samples(stamps_ns(t), rates(t)))
    assert rig.track.bias_rads is None
    assert rig.between(1, 2) is None


def test_an_autopilot_that_falls_silent_leaves_the_bias(flown: Rig) -> None:
    rig = Rig()
    t = 20 + np.arange(2000) / 200
    rig.track.add_samples(rig.samples(stamps_ns(t), (rates(t) + BIAS) @ SENSOR))
    rotation = rig.between(25, 26)
    assert rotation is not None
    assert turned_deg(rotation.T @ attitude(25).T @ attitude(26)) < 0.02


def test_a_bias_of_no_sound_unit_gives_no_rotation() -> None:
    rig = Rig(0.0)
    t = np.arange(0, 10, 0.005)
    for at_ns in stamps_ns(t[::4]):
        rig.track.add_attitude(int(at_ns), LEVEL, NEVER)
        rig.track.add_samples(rig.samples(at_ns + np.arange(-2, 2) * 5 * MS, np.full((4, 3), 0.1)))
    assert rig.track.bias_rads is None


def test_late_and_repeated_samples_change_nothing(flown: Rig) -> None:
    rig = Rig()
    t = np.arange(19.5, 20, 0.005)
    rig.track.add_samples(rig.samples(stamps_ns(t), np.ones((len(t), 3))))
    before, after = flown.between(19, 19.9), rig.between(19, 19.9)
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize("jump_s", [6.0, -6.0])
def test_a_sensor_that_was_off_begins_anew(jump_s: float) -> None:
    rig = Rig()
    t = 20 + jump_s + np.arange(20) / 200
    rig.track.add_samples(rig.samples(stamps_ns(t), np.zeros((20, 3))))
    assert rig.track.bias_rads is None
    assert rig.track.mount_error_deg() is None


# ---- mount ---------------------------------------------------------------------------------------------


def test_a_true_mount_has_no_error(flown: Rig) -> None:
    error = flown.track.mount_error_deg()
    assert error is not None
    assert error < 0.1


@pytest.mark.parametrize(
    ("wrong_deg", "error_deg"), [((0, 5, 0), 5), ((0, -15, 0), 15), ((4, 0, 0), 4), ((0, 0, 90), 90)]
)
def test_a_wrong_mount_is_noticed(wrong_deg: tuple[float, ...], error_deg: float) -> None:
    error = Rig(30.0, wrong_deg=wrong_deg, noise=0.02).track.mount_error_deg()
    assert error == pytest.approx(error_deg, rel=0.1, abs=1.0)


def test_turns_about_one_axis_do_not_show_the_mount() -> None:
    rig = Rig(0.0)
    for k in range(200):
        t = k / 10 + np.arange(20) / 200
        yaw = np.stack([0 * t, 0 * t, 0.4 * np.sin(t)], -1)
        for at_ns, theirs in zip(stamps_ns(t)[::4], yaw[::4], strict=True):
            rig.track.add_attitude(int(at_ns), LEVEL, theirs.tolist())
        rig.track.add_samples(rig.samples(stamps_ns(t), yaw @ SENSOR))
    assert rig.track.bias_rads is not None
    assert rig.track.mount_error_deg() is None
