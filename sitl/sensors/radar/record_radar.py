"""Recorder of the landing site as seen by the radar from four sides, for evaluation.

`python -m sitl.sensors.radar.record_radar --seed N --out FILE.npz`
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sitl import scenes
from sitl.scenes.landing_sites import HALF_M
from sitl.sensors.instrument_recording import run
from sitl.sensors.radar.side_looker import SideLooker, Track
from sitl.world.primitives import Kind

HEIGHTS_M = (65.0, 75.0, 85.0, 95.0)
"""Heights of the flights on headings of 0, 90, 180 and 270 degrees."""
LINES, LINE_M = 130, 0.8
CELL_M = 0.5


def record(seed: int, out: Path) -> None:
    """Fly around the site and write the file: images, tracks, and the exact heights on a grid of 0.5 m."""
    scene = scenes.build("landing_site", seed)
    held: dict[str, Any] = {}
    for k, height in enumerate(HEIGHTS_M):
        heading = k * np.pi / 2
        ahead = np.array([np.sin(heading), np.cos(heading)])
        radar = SideLooker(np.random.default_rng(100 * seed + k))
        away = height * (np.tan(radar.near_rad) + np.tan(radar.far_rad)) / 2
        along = (np.arange(LINES) - LINES / 2) * LINE_M
        flat = along[:, np.newaxis] * ahead - away * np.array([ahead[1], -ahead[0]])
        roll = np.radians(0.5) * np.sin(along / 7)
        raw = radar.fly(Track(np.column_stack([flat, np.full(LINES, height)]), heading, roll), scene.world)
        held |= {f"samples_{k}": raw.samples, f"range_{k}": np.array([raw.first_m, raw.step_m])}
        held |= {f"position_{k}": raw.track.position_enu_m, f"heading_{k}": heading, f"roll_{k}": roll}
    axis = np.arange(-HALF_M, HALF_M, CELL_M) + CELL_M / 2
    height_m, kind = scene.world.surface(*np.meshgrid(axis, axis))
    np.savez(out, truth_m=height_m.astype(np.float32), water=kind == Kind.WATER, **held)


if __name__ == "__main__":
    run(record)
