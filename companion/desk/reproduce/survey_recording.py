"""Recordings of surveys flown by the simulator: returns placed with the true pose, and the truth."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from companion.runtime.errors import CompanionError
from slz import LocalFrame, Scan, Window, join

FRAME = LocalFrame(47.3977419, 8.5455938, 488.0)
WINDOW_CHUNKS = 10


@dataclass(frozen=True, slots=True)
class SurveyFlight:
    """Options of `python -m sitl.flown_survey`."""

    scene: str
    extent_m: tuple[float, float, float, float]
    seed: int = 1
    height_m: float = 20.0
    spacing_m: float = 15.0
    speed_ms: float = 5.0
    point_rate_hz: int = 200_000
    cell_m: float = 0.2
    footprint_m: float = 2.0
    slope_limit_deg: float = 10.0
    relief_limit_m: float = 0.3
    climb_m: float = 0.0

    def options(self) -> list[str]:
        return [
            f"--scene={self.scene}",
            f"--seed={self.seed}",
            "--extent=" + ",".join(f"{v:g}" for v in self.extent_m),
            f"--height={self.height_m:g}",
            f"--spacing={self.spacing_m:g}",
            f"--speed={self.speed_ms:g}",
            f"--point-rate={self.point_rate_hz}",
            f"--cell={self.cell_m:g}",
            f"--footprint={self.footprint_m:g}",
            f"--slope-limit={self.slope_limit_deg:g}",
            f"--relief-limit={self.relief_limit_m:g}",
            *([f"--climb={self.climb_m:g}"] if self.climb_m else []),
        ]


@dataclass(frozen=True, slots=True)
class SurveyRecording:
    """A flown survey; rasters of the truth have rows from the south."""

    survey: SurveyFlight
    points_enu_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    sensor_enu_m: NDArray[np.float64]
    count: NDArray[np.int64]
    safe: NDArray[np.uint8]
    slope_deg: NDArray[np.float32]
    relief_m: NDArray[np.float32]
    height_m: NDArray[np.float32]
    regions: dict[str, NDArray[np.float64]]
    description: str

    def windows(self) -> Iterator[Window]:
        """Yield windows of one second, joined from scans as in flight."""
        start = np.concatenate([[0], np.cumsum(self.count)])
        for chunk in range(0, len(self.count), WINDOW_CHUNKS):
            parts = [
                (slice(int(start[k]), int(start[k + 1])), self.sensor_enu_m[k])
                for k in range(chunk, min(chunk + WINDOW_CHUNKS, len(self.count)))
            ]
            scans = [
                Scan(self.points_enu_m[part].astype(np.float64), self.stamp_ns[part], sensor, FRAME)
                for part, sensor in parts
                if part.start < part.stop
            ]
            if scans:
                yield join(scans)


def fly(survey: SurveyFlight, folder: Path) -> SurveyRecording:
    """Fly a survey with the simulator; an existing recording is reused.

    Raises
    ------
    CompanionError
        The simulator fails.
    """
    name = "_".join(option.lstrip("-").replace("=", "").replace(",", "_") for option in survey.options())
    file = folder / f"{name}.npz"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}.npz")  # another process may fly the same
        command = [sys.executable, "-m", "sitl.flown_survey", *survey.options(), f"--out={partial}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            last = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no reason given"
            raise CompanionError(f"the simulator could not fly {survey.scene}: {last}")
        partial.replace(file)
    with np.load(file) as data:
        regions = {name: np.array(corners) for name, corners in json.loads(str(data["regions"])).items()}
        return SurveyRecording(
            survey=survey,
            points_enu_m=data["points_enu_m"],
            stamp_ns=data["stamp_ns"],
            sensor_enu_m=data["sensor_enu_m"],
            count=data["count"],
            safe=data["safe"],
            slope_deg=data["slope_deg"],
            relief_m=data["relief_m"],
            height_m=data["height_m"],
            regions=regions,
            description=str(data["description"]),
        )
