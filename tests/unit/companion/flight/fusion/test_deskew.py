"""De-skewing of scans from a fast, turning vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.georeference import Georeferencer
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.sensors.returns import Returns
from params import Parameters
from sitl import scenes
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.mid360 import Mid360, Noise
from sitl.world.world import World
from tests.unit.companion.flight.fusion.flights import HOME

Floats = NDArray[np.float64]
MS = 1_000_000
SPEED_MS, TURN_DEG_S = 15.0, 60.0


def pose(t_s: Floats) -> tuple[Floats, Rotation]:
    """Straight ahead to the east, turning all the while."""
    position = np.stack([SPEED_MS * (t_s - 1.0), np.zeros_like(t_s), np.full_like(t_s, 20.0)], -1)
    yaw = np.radians(TURN_DEG_S) * t_s
    return position, Rotation.from_euler("ZYX", np.stack([yaw, 0 * t_s, 0 * t_s], -1))


def scanned(parameters: Parameters) -> tuple[World, Returns, PoseHistory]:
    world = scenes.build("buildings", 1).world
    mount = Mount(
        (parameters.lidar_x_m, parameters.lidar_y_m, parameters.lidar_z_m),
        parameters.lidar_roll_deg,
        parameters.lidar_pitch_deg,
        parameters.lidar_yaw_deg,
    )

    def at(ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
        position, attitude = pose(ns * 1e-9)
        x, y, z, w = attitude.as_quat().T
        return position, np.stack([w, x, y, z], -1)

    lidar = Mid360(np.random.default_rng(1), mount, point_rate_hz=50_000, noise=Noise(ghost=0.0, dust=0.0))
    shots = lidar.shots(0, 2000 * MS, at, world)
    points, times = lidar.points_m(shots), lidar.stamps_ns(shots)
    false = shots.echoes.ghost | shots.echoes.dust
    seen = (shots.echoes.range_m > 0) & ~(false & shots.echoes.marked)
    returns = Returns.plain(points[seen].astype(np.float32), times[seen])
    history = PoseHistory(parameters, HOME)
    for k in range(-2, 103):
        position, attitude = pose(np.float64(k * 0.02))
        x, y, z, w = attitude.as_quat()
        history.add_attitude(k * 20 * MS, (w, x, y, z), (0.0, 0.0, np.radians(TURN_DEG_S)))
        lat, lon, alt = (float(v) for v in HOME.lla(position))
        history.add_position(k * 20 * MS, lat, lon, alt, (0.0, SPEED_MS, 0.0))
    return world, returns, history


def off_the_surface_m(world: World, points: Floats) -> float:
    """Return the RMS of how far points are above or below what stands within 30 cm of their place."""
    turn = np.arange(8) * np.pi / 4
    ring = np.stack([np.cos(turn), np.sin(turn)], -1)
    around = np.concatenate([[(0.0, 0.0)], 0.1 * ring, 0.2 * ring, 0.3 * ring])
    east, north = (points[:, k, None] + around[:, k] for k in (0, 1))
    heights, _ = world.surface(east, north)
    low, high = heights.min(axis=1), heights.max(axis=1)
    off = np.maximum(low - points[:, 2], points[:, 2] - high).clip(0)
    return float(np.sqrt((off**2).mean()))


def test_a_scan_in_a_fast_turn_is_flat_and_would_not_be_without_de_skewing() -> None:
    parameters = Parameters(lidar_max_m=25.0)  # what is mapped: farther off, noise of direction hides all
    world, returns, history = scanned(parameters)
    scan = Georeferencer(parameters).georeference(returns, history)
    assert scan is not None
    some = slice(None, None, 10)
    flat_m = off_the_surface_m(world, scan.points_enu_m[some])
    frames = []  # every 100 ms placed with the pose of its end, as without de-skewing
    for begin_ns in range(0, 1900 * MS, 100 * MS):
        here = (returns.stamp_ns >= begin_ns) & (returns.stamp_ns < begin_ns + 100 * MS)
        late = np.full(int(here.sum()), begin_ns + 100 * MS)
        frame = Returns.plain(returns.xyz_sensor_m[here], late)
        placed = Georeferencer(parameters).georeference(frame, history)
        assert placed is not None
        frames.append(placed.points_enu_m)
    smeared_m = off_the_surface_m(world, np.concatenate(frames)[some])
    assert flat_m <= 0.03
    assert smeared_m >= 10 * flat_m
