"""Simulated sensors in places like those of the recordings, through the project's own packet decoders."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.decoders.ouster_decoder import OusterDecoder
from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder
from companion.flight.sensors.returns import RawReturns
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.ouster_os1 import OS0, Ouster
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.sensors.velodyne_packets import ReturnMode
from sitl.sensors.vlp16 import Vlp16
from sitl.world.primitives import Box, Cylinder, Ground, Kind, Solid
from sitl.world.world import World

I64 = NDArray[np.int64]
F64 = NDArray[np.float64]
UPRIGHT = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=0.0)
SURFACES = (Kind.CONCRETE, Kind.WOOD, Kind.METAL, Kind.CAR, Kind.ASPHALT, Kind.BITUMEN, Kind.PAVING)


def velodyne(seed: int) -> RawReturns:
    """Return 0.4 s of the simulated VLP-16 in dual mode in a room 16 m wide."""
    sensor = Vlp16(np.random.default_rng(seed), UPRIGHT, mode=ReturnMode.DUAL)
    return VelodyneDecoder().decode(_packets(sensor, _place(seed, 8.0, 0.8), 1.0, 400_000_000))


def ouster(seed: int) -> RawReturns:
    """Return one turn of the simulated OS0 in a yard 30 m wide."""
    sensor = Ouster(np.random.default_rng(seed), UPRIGHT, model=OS0)
    packets = _packets(sensor, _place(seed, 15.0, 1.2), 1.8, 100_000_000)
    return OusterDecoder(sensor.metadata).decode(packets)


def _packets(sensor: PulseLidar, world: World, height_m: float, duration_ns: int) -> list[bytes]:
    def pose(stamps_ns: I64) -> tuple[F64, F64]:
        count = len(stamps_ns)
        return np.tile([0.0, 0.0, height_m], (count, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))

    return sensor.scan(0, duration_ns, pose, world)


def _place(seed: int, half_m: float, nearest_m: float) -> World:
    """Return a level place within four walls, with boxes and posts from `nearest_m` on."""
    rng = np.random.default_rng([seed, 1])
    posts = 2 * math.ceil(half_m) + 3
    ground = Ground(
        -(posts - 1) / 2.0,
        -(posts - 1) / 2.0,
        1.0,
        np.zeros((posts, posts)),
        np.full((posts - 1, posts - 1), Kind.ASPHALT, np.uint8),
    )
    solids: list[Solid] = []
    for k in range(4):
        across, yaw = k * math.pi / 2, (k + 1) * math.pi / 2
        x, y = half_m * math.cos(across), half_m * math.sin(across)
        solids.append(Box(x, y, 0.0, 2 * half_m, 0.2, 5.0, yaw, SURFACES[k], f"wall{k}"))
    for k in range(48):  # pilasters, for steps of some decimetres
        side, along, depth = k % 4, rng.uniform(-0.9, 0.9) * half_m, rng.uniform(0.1, 0.9)
        turn = side * math.pi / 2
        c, s = math.cos(turn), math.sin(turn)
        away = half_m - 0.1 - depth / 2
        x, y = c * away - s * along, s * away + c * along
        solids.append(Box(x, y, 0.0, depth, 0.06 * half_m, 5.0, turn, SURFACES[side], f"pilaster{k}"))
    for k in range(16):
        bearing = 2 * math.pi * (k + rng.uniform(0.2, 0.8)) / 16
        away = nearest_m + (0.8 * half_m - nearest_m) * rng.random() ** 2
        x, y = away * math.cos(bearing), away * math.sin(bearing)
        kind = SURFACES[int(rng.integers(len(SURFACES)))]
        if k % 4 == 3:
            solids.append(Cylinder(x, y, 0.0, 0.05, 3.0, kind, f"post{k}"))
        else:
            width, height = 0.3 * away * rng.uniform(0.5, 1.0), rng.uniform(0.8, 3.0)
            yaw = bearing + rng.uniform(-0.5, 0.5)
            solids.append(Box(x, y, 0.0, 0.1, width, height, yaw, kind, f"box{k}"))
    return World(ground, solids, cell_m=4.0)
