"""Recordings of surveys flown by the simulator: returns placed with the true pose, and the truth."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.runtime.errors import CompanionError
from slz import LocalFrame, PointAttributes, Scan, Window, join

FRAME = LocalFrame(47.3977419, 8.5455938, 488.0)
WINDOW_CHUNKS = 10


@dataclass(frozen=True, slots=True)
class SurveyFlight:
    """Options of `python -m sitl.flown_survey`.

    surface: whether the recording holds evidence of the kind of ground besides its shape.
    """

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
    surface: bool = False

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
            *(["--surface"] if self.surface else []),
        ]


@dataclass(frozen=True, slots=True)
class RecordedSurface:
    """Evidence of the kind of ground beside its shape, and the true kind.

    bright: (n,) share of what a white target sends back, of each return. lost_enu_m, lost_origin_enu_m:
    (m, 3) point on each ray without a return, and the sensor's position then. lost_weight: (m,) number of
    rays that each represents. lost_count: (k,) of each scan. kind: raster of the truth, by the numbers of
    `names`. roof_height_m: of roofs over the ground around them, NaN elsewhere.
    """

    bright: NDArray[np.float32]
    lost_enu_m: NDArray[np.float32]
    lost_origin_enu_m: NDArray[np.float32]
    lost_weight: NDArray[np.float32]
    lost_count: NDArray[np.int64]
    kind: NDArray[np.uint8]
    names: dict[str, int]
    roof_height_m: NDArray[np.float32]

    def attributes(self, returns: slice, lost: slice) -> PointAttributes:
        """Return the attributes of a scan; numbers of returns are unknown."""
        none = np.zeros(returns.stop - returns.start, np.uint8)
        rays = (self.lost_enu_m[lost], self.lost_origin_enu_m[lost])
        ends, origins = (ray.astype(np.float64) for ray in rays)
        return PointAttributes.of(self.bright[returns], none, none, ends, origins, self.lost_weight[lost])


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
    surface: RecordedSurface | None = None

    def windows(self) -> Iterator[Window]:
        """Yield windows of one second, joined from scans as in flight, with the attributes recorded."""
        scans = self.scans()
        while window := list(itertools.islice(scans, WINDOW_CHUNKS)):
            if any(len(scan) for scan in window):
                yield join(scan for scan in window if len(scan) or scan.attributes is not None)

    def scans(self) -> Iterator[Scan]:
        """Yield every scan, those without a return too."""
        lost_counts = np.zeros_like(self.count) if self.surface is None else self.surface.lost_count
        for part, lost, sensor in zip(
            _slices(self.count), _slices(lost_counts), self.sensor_enu_m, strict=True
        ):
            attributes = None if self.surface is None else self.surface.attributes(part, lost)
            points = self.points_enu_m[part].astype(np.float64)
            yield Scan(points, self.stamp_ns[part], sensor, FRAME, attributes=attributes)


def _slices(counts: NDArray[np.int64]) -> list[slice]:
    """Return consecutive slices of the given lengths."""
    bounds = np.concatenate([[0], np.cumsum(counts)]).tolist()
    return [slice(start, stop) for start, stop in itertools.pairwise(bounds)]


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
            surface=_surface(data) if survey.surface else None,
        )


def _surface(data: Mapping[str, NDArray[Any]]) -> RecordedSurface:
    return RecordedSurface(
        bright=data["bright"],
        lost_enu_m=data["lost_enu_m"],
        lost_origin_enu_m=data["lost_origin_enu_m"],
        lost_weight=data["lost_weight"],
        lost_count=data["lost_count"],
        kind=data["surface"],
        names=json.loads(str(data["surface_names"])),
        roof_height_m=data["roof_height_m"],
    )
