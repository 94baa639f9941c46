"""Recovery of planted boresight and time errors from simulated flights; undetermined ones are not guessed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.desk.calibrate.calibration import FlownReturns, SystematicSample, corrected, mount_angles
from companion.desk.calibrate.overlap_agreement import TooLittleError, solve
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.returns import Returns, join
from params import Parameters
from sitl import scenes
from sitl.sensors.lidar_mount import Mount as TrueMount
from sitl.sensors.mid360 import Mid360
from tests.unit.companion.flight.fusion.flights import HOME

Floats = NDArray[np.float64]
MS = 1_000_000
BEGIN_NS = 1_000 * MS


def figure_of_eight(t: Floats) -> tuple[Floats, Floats, Rotation]:
    position = np.stack([30 * np.sin(0.25 * t), 25 * np.sin(0.4 * t + 1), 26 + 5 * np.sin(0.3 * t)], -1)
    velocity = np.stack([7.5 * np.cos(0.25 * t), 10 * np.cos(0.4 * t + 1), 1.5 * np.cos(0.3 * t)], -1)
    angles = np.stack([0.35 * t, 0.12 * np.sin(0.9 * t), 0.12 * np.sin(0.7 * t + 0.5)], -1)
    return position, velocity, Rotation.from_euler("ZYX", angles)


def straight(t: Floats) -> tuple[Floats, Floats, Rotation]:
    position = np.stack([np.zeros_like(t), 4 * t - 40, np.full_like(t, 25.0)], -1)
    velocity = np.stack([np.zeros_like(t), np.full_like(t, 4.0), np.zeros_like(t)], -1)
    return position, velocity, Rotation.from_euler("ZYX", np.zeros((*np.shape(t), 3)))


@functools.cache
def flown(
    path: Callable[[Floats], tuple[Floats, Floats, Rotation]],
    scene: str,
    seconds: float,
    turn_deg: tuple[float, float, float],
    delay_ms: float,
) -> FlownReturns:
    """Return what a LiDAR measured whose mount is turned, and whose stamps are late, by so much."""
    parameters = Parameters()
    rotation = corrected(Mount(parameters).rotation_frd_from_sensor, np.array([*turn_deg, 0.0]))
    angles = mount_angles(rotation)
    mount = TrueMount(
        (parameters.lidar_x_m, parameters.lidar_y_m, parameters.lidar_z_m),
        angles["lidar_roll_deg"],
        angles["lidar_pitch_deg"],
        angles["lidar_yaw_deg"],
    )
    lidar = Mid360(np.random.default_rng(1), mount, point_rate_hz=10_000)

    def pose_at(ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
        position, _, attitude = path(ns * 1e-9)
        x, y, z, w = attitude.as_quat().T
        return position, np.stack([w, x, y, z], -1)

    shots = lidar.shots(0, round(seconds * 1e9), pose_at, scenes.build(scene, 1).world)
    points, times = lidar.points_m(shots), lidar.stamps_ns(shots)
    false = shots.echoes.ghost | shots.echoes.dust
    seen = (shots.echoes.range_m > 0) & ~(false & shots.echoes.marked)
    stamps = times[seen] + BEGIN_NS + round(delay_ms * 1e6)
    returns = Returns.plain(points[seen].astype(np.float32), stamps)
    history = PoseHistory(parameters, HOME, capacity=8192)
    for k in range(-10, round(seconds * 50) + 10):
        position, (east, north, up), attitude = path(np.float64(k * 0.02))
        x, y, z, w = attitude.as_quat().ravel()
        at_ns = BEGIN_NS + k * 20 * MS
        history.add_attitude(at_ns, (w, x, y, z), (0.0, 0.0, 0.0))
        lat, lon, alt = (float(v) for v in HOME.lla(position))
        history.add_position(at_ns, lat, lon, alt, (north, east, -up))
    return FlownReturns(returns, history, parameters)


def test_a_degree_of_boresight_and_fifteen_milliseconds_are_found() -> None:
    planted = (0.6, -0.7, 0.4)  # one degree in all
    flight = flown(figure_of_eight, "buildings", 40.0, planted, 15.0)
    fit = solve(flight.place, flight.stamp_s, np.zeros(4, bool))
    assert fit.correction[:3] == pytest.approx(planted, abs=0.05)
    assert fit.correction[3] == pytest.approx(15.0, abs=1.0)
    assert fit.after_m < 0.035 < 0.1 < fit.before_m
    assert (fit.sigma < [0.05, 0.05, 0.05, 1.0]).all()


def test_a_straight_flight_over_a_plain_shows_too_little_and_says_so() -> None:
    flight = flown(straight, "plain", 12.0, (0.0, 0.0, 0.0), 0.0)
    fit = solve(flight.place, flight.stamp_s, np.zeros(4, bool))
    assert fit.sigma[3] > 2.0
    assert fit.sigma[2] > 0.1


def test_ground_seen_once_is_refused() -> None:
    flight = flown(straight, "plain", 2.0, (0.0, 0.0, 0.0), 0.0)
    with pytest.raises(TooLittleError, match="two passes"):
        solve(flight.place, flight.stamp_s, np.zeros(4, bool))


def test_angles_of_a_mount_are_its_parameters() -> None:
    for values in ((0.0, 112.5, 0.0), (3.0, 20.0, -40.0)):
        names = ("lidar_roll_deg", "lidar_pitch_deg", "lidar_yaw_deg")
        mount = Mount(Parameters(**dict(zip(names, values, strict=True))))
        again = Mount(Parameters(**mount_angles(mount.rotation_frd_from_sensor)))
        np.testing.assert_allclose(again.rotation_frd_from_sensor, mount.rotation_frd_from_sensor, atol=1e-12)


def hovering(jump_at: int | None = None, missing: Sequence[int] = (), attitudes: bool = True) -> FlownReturns:
    """Return what two seconds of hovering measured, a return a millisecond, poses every 20 ms.

    jump_at: first position that lies elsewhere. missing: numbers of the poses that never came.
    """
    parameters = Parameters(pose_timeout_s=0.05)
    history = PoseHistory(parameters, HOME, capacity=8192)
    for k in range(101):
        if k in missing:
            continue
        at_ns = BEGIN_NS + k * 20 * MS
        if attitudes:
            history.add_attitude(at_ns, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        east_m = 0.0 if jump_at is None or k < jump_at else 30.0
        lat, lon, alt = (float(v) for v in HOME.lla(np.array([east_m, 0.0, 20.0])))
        history.add_position(at_ns, lat, lon, alt, (0.0, 0.0, 0.0))
    assert history.jumps == (jump_at is not None)
    stamps = BEGIN_NS + np.arange(2001, dtype=np.int64) * MS
    points = np.tile(np.array([5.0, 0.0, -5.0], np.float32), (len(stamps), 1))
    return FlownReturns(Returns.plain(points, stamps), history, parameters)


@pytest.mark.parametrize(
    ("flight", "left_out"),
    [
        ({}, 0),
        ({"jump_at": 50}, 20 + 2 * 100 + 1),  # between 980 and 1000 ms
        ({"missing": range(50, 53)}, 80 + 2 * 100 + 1),
    ],
)
def test_returns_beside_a_jump_or_a_gap_are_left_out_so_that_any_delay_has_poses(
    flight: dict[str, Any], left_out: int
) -> None:
    flown_ = hovering(**flight)
    assert len(flown_) == 2000 - 2 * 100 - 1 - left_out
    for delay_ms in np.linspace(-120.0, 120.0, 49):
        places = flown_.place(np.array([0.0, 0.0, 0.0, delay_ms]))
        assert places.shape == (len(flown_), 3)
        assert np.isfinite(places).all()


def test_without_attitudes_no_return_has_a_place() -> None:
    assert len(hovering(attitudes=False)) == 0


def test_ground_that_is_nowhere_flat_is_refused() -> None:
    rng = np.random.default_rng(1)
    bush = rng.uniform(0, 8, (20_000, 3))
    twice = rng.choice([0.0, 10.0], len(bush)) + rng.uniform(0, 1, len(bush))
    with pytest.raises(TooLittleError, match="no ground that is seen twice is flat"):
        solve(lambda _: bush, twice, np.zeros(4, bool))


# Systematic sample of returns: bounded, and even over the flight.


def batch(first: int, count: int) -> Returns:
    stamps = np.arange(first, first + count)
    return Returns.plain(np.zeros((count, 3), np.float32), stamps)


@pytest.mark.parametrize("size", [1, 7, 100, 5000])
@pytest.mark.parametrize("total", [900, 1000, 1001, 5000])
def test_returns_are_thinned_evenly_and_never_more_than_so_many(size: int, total: int) -> None:
    sample = SystematicSample(1000)
    for first in range(0, total, size):
        sample.add_batch(batch(first, min(size, total - first)))
        assert sum(map(len, sample.parts)) <= 1000
    stamps = join(sample.parts).stamp_ns
    if total <= 1000:
        assert stamps.tolist() == list(range(total))
    else:
        assert len(stamps) >= 490
        steps = np.diff(stamps)
        assert steps.min() > 0
        assert steps.max() <= 2.1 * np.median(steps)
        assert stamps[-1] >= total - 2 * np.median(steps)
