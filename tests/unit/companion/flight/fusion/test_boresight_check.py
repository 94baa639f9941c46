"""A boresight told wrong is noticed from simulated flights, and a right one never is."""

from __future__ import annotations

import functools
from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.desk.calibrate.calibration import corrected, mount_angles
from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.returns import Returns
from params import Parameters
from sitl import scenes
from sitl.sensors.mid360 import Mid360
from tests.unit.companion.flight.fusion.flights import HOME, MS

Floats = NDArray[np.float64]
Path = Callable[[Floats], tuple[Floats, Floats]]
SECONDS, POSE_MS, SCAN_MS = 32, 20, 50
TILT_DEG, TILT_S = 0.8, 5.0  # standard deviation and correlation time of the told attitude's error
LEG_S, SPEED_MS, HEIGHT_M = 8.0, 3.0, 25.0


def square(t: Floats) -> tuple[Floats, Floats]:
    """Return positions (n, 3) around a square, and headings (n,) along its sides."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) * LEG_S * SPEED_MS
    place = [np.interp(t, np.arange(5) * LEG_S, axis) for axis in corners.T]
    heading = np.interp((t + 0.5) % LEG_S, [0, 1], [-1, 0]) + (t + 0.5) // LEG_S
    return np.column_stack([*place, np.full_like(t, HEIGHT_M)]), heading * np.pi / 2


def hover(t: Floats) -> tuple[Floats, Floats]:
    """Return one position (n, 3) and heading (n,)."""
    return np.column_stack([0 * t, 0 * t, np.full_like(t, HEIGHT_M)]), 0 * t


@functools.cache
def measured(path: Path, scene: str, seed: int) -> tuple[Returns, Callable[[Floats], Any]]:
    """Return what a LiDAR measures on a path over a scene, and its true poses."""
    built = scenes.build(scene, seed)
    x, y, _ = built.home_enu
    home = np.array([x, y, built.world.highest_about_m(x, y, 12.0)])

    def poses(t: Floats) -> tuple[Floats, Rotation]:
        places, headings = path(t)
        return places + home, Rotation.from_euler("Z", np.pi / 2 - headings[:, None])

    def pose_at(ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
        places, attitudes = poses(ns * 1e-9)
        x, y, z, w = attitudes.as_quat().T
        return places, np.stack([w, x, y, z], -1)

    lidar = Mid360(np.random.default_rng(seed), point_rate_hz=10_000)
    shots = lidar.shots(0, SECONDS * 1_000 * MS, pose_at, built.world)
    seen = shots.echoes.range_m > 0
    return Returns.plain(lidar.points_m(shots)[seen].astype(np.float32), lidar.stamps_ns(shots)[seen]), poses


def checked(path: Path, scene: str, seed: int, roll_deg: float, pitch_deg: float) -> ScanAssembler:
    """Return the assembler after a flight whose mount is told wrong by so much about the body's axes."""
    returns, poses = measured(path, scene, seed)
    right = Mount(Parameters()).rotation_frd_from_sensor
    parameters = Parameters(**mount_angles(corrected(right, np.array([roll_deg, pitch_deg, 0.0]))))
    history = PoseHistory(parameters, HOME)
    assembler = ScanAssembler(parameters, history, lambda _: None)
    rng, off_deg = np.random.default_rng(seed), np.zeros(2)
    keeps = np.exp(-POSE_MS * 1e-3 / TILT_S)
    batches = iter(np.split(np.arange(len(returns)), np.searchsorted(
        returns.stamp_ns, np.arange(SCAN_MS, SECONDS * 1_000, SCAN_MS) * MS)))  # fmt: skip
    for at_ms in range(0, SECONDS * 1_000 + 1, POSE_MS):
        places, attitudes = poses(at_ms * 1e-3 + np.array([0.0, -0.01, 0.01]))
        place, attitude = places[0], attitudes[0]
        east, north, up = (places[2] - places[1]) / 0.02
        off_deg = keeps * off_deg + TILT_DEG * np.sqrt(1 - keeps**2) * rng.standard_normal(2)
        x, y, z, w = (Rotation.from_rotvec(np.radians([*off_deg, 0.0])) * attitude).as_quat()
        history.add_attitude(at_ms * MS, (w, x, y, z), (0.0, 0.0, 0.0))
        lat, lon, alt = (float(v) for v in HOME.lla(place))
        history.add_position(at_ms * MS, lat, lon, alt, (north, east, -up))
        if at_ms % 100 == 0 and at_ms:
            for _ in range(100 // SCAN_MS):
                assembler.add(returns.select(next(batches)))
    return assembler


TOLD = (((0.0, 10.0), (4.0, 0.0)), ((-10.0, 0.0), (0.0, -4.0)))
SCENES = ("plain", "hill", "mountains", "dense", "streets", "stadium")


@pytest.mark.long
@pytest.mark.parametrize(("scene", "seed"), [*((scene, 1) for scene in SCENES), ("plain", 2), ("hill", 2)])
def test_a_right_mount_is_never_called_wrong(scene: str, seed: int) -> None:
    assert checked(square, scene, seed, 0.0, 0.0).boresight.error_deg is None


@pytest.mark.parametrize(
    ("scene", "roll_deg", "pitch_deg"),
    [(scene, *told) for scene, pair in zip(SCENES, cycle(TOLD), strict=False) for told in pair],
)
def test_a_mount_told_wrong_is_noticed_with_its_error(scene: str, roll_deg: float, pitch_deg: float) -> None:
    error_deg = checked(square, scene, 1, roll_deg, pitch_deg).boresight.error_deg
    assert error_deg == pytest.approx((roll_deg, pitch_deg), abs=1.2)


def test_a_hover_shows_no_mount() -> None:
    assert checked(hover, "hill", 1, 0.0, 10.0).boresight.error_deg is None
