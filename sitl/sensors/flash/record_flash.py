"""Recorder of raw flash frames over the borrow pit, for evaluation.

`python -m sitl.sensors.flash.record_flash --seed N --out FILE.npz`

The file holds the raw frames, the sensor's true positions, and the ground truth: heights on a grid of 0.1 m
and the objects on the ground.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sitl import scenes
from sitl.scenes.hills import BOXES
from sitl.sensors.flash.flash_sensor import FlashLidar
from sitl.sensors.instrument_recording import run
from sitl.world.primitives import Ellipsoid

F64 = NDArray[np.float64]
HEIGHT_M, OFF_DEG = 200.0, 37.0  # 250 m of slant range
HALF_M, STEP_M = 24.0, 6.0
TRUTH_HALF_M, TRUTH_CELL_M = 30.0, 0.1


def places() -> list[tuple[float, float]]:
    """Return the points where the axis meets the ground: first between the boxes, then all over the floor."""
    axis = np.arange(-HALF_M, HALF_M + 0.1, STEP_M)
    return [(0.0, 0.0), *((float(x), float(y)) for y in axis for x in axis)]


def record(seed: int, out: Path) -> None:
    """Fly over the pit and write the file."""
    scene = scenes.build("borrow_pit", seed)
    lidar = FlashLidar(np.random.default_rng(seed))
    half = np.radians(OFF_DEG) / 2
    quat = np.array([np.cos(half), 0.0, np.sin(half), 0.0])
    turn = lidar.mount.to_enu(np.eye(3), np.broadcast_to(quat, (3, 4))).T
    samples, counters, positions = [], [], []
    for east, north in places():
        position = np.array([east, north - HEIGHT_M * np.tan(2 * half), HEIGHT_M])
        frame = lidar.flash(position, quat, scene.world)
        samples.append(frame.samples)
        counters.append(frame.counter)
        positions.append(position)
    axis = np.arange(-TRUTH_HALF_M, TRUTH_HALF_M, TRUTH_CELL_M) + TRUTH_CELL_M / 2
    top, _ = scene.world.surface(*np.meshgrid(axis, axis))
    domes = [(s.x_m, s.y_m, s.radius_z_m) for s in scene.world.solids if isinstance(s, Ellipsoid)]
    np.savez(
        out,
        samples=np.stack(samples),
        counter=np.stack(counters),
        position_m=np.stack(positions),
        rotation=turn,
        truth_m=top.astype(np.float32),
        standing=np.array([*domes, *BOXES]),
    )


if __name__ == "__main__":
    run(record)
