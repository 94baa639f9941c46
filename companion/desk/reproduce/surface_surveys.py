"""Surveys of water, tarmac, roofs and crops: kinds of ground beside the truth, cell by cell."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from companion.desk.reproduce.source_scenes import Case, pipeline_for
from companion.desk.reproduce.survey_recording import RecordedSurface, SurveyFlight, SurveyRecording, fly
from slz import SAFE, Box, Grid, Pipeline, SurfaceKind

SIDE_M = 1.0  # of the cells whose kinds are compared
OBJECT = max(SurfaceKind) + 1
"""True kind of what stands on the ground, beside those of `SurfaceKind`."""
Kinds = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class SurfaceSurvey:
    """A survey of a part of a scene that holds some kind of ground and what surrounds it."""

    scene: str
    extent_m: tuple[float, float, float, float]

    @property
    def name(self) -> str:
        """Return the name by which the survey is chosen."""
        return f"surface of {self.scene}"

    @property
    def flight(self) -> SurveyFlight:
        """Return the flight: at 20 m, by 100,000 pulses/s, in lines so far apart that all ground is seen."""
        return SurveyFlight(
            self.scene,
            self.extent_m,
            spacing_m=20.0,
            speed_ms=10.0,
            point_rate_hz=100_000,
            surface=True,
        )


SURFACES = (
    SurfaceSurvey("lakes", (-20.0, -20.0, 60.0, 60.0)),
    SurfaceSurvey("ponds", (-40.0, -20.0, 40.0, 60.0)),
    SurfaceSurvey("river", (-20.0, -60.0, 60.0, 20.0)),
    SurfaceSurvey("flooded_field", (-40.0, -40.0, 40.0, 40.0)),
    SurfaceSurvey("car_park_dry", (-30.0, -55.0, 50.0, 25.0)),
    SurfaceSurvey("car_park_wet", (-30.0, -55.0, 50.0, 25.0)),
    SurfaceSurvey("flat_roofs", (-40.0, -45.0, 40.0, 20.0)),
    SurfaceSurvey("maize", (-40.0, -40.0, 40.0, 40.0)),
)


@dataclass(frozen=True, slots=True)
class ClassifiedSurface:
    """Kinds of ground after a survey, in cells of 1 m, and its water in cells of the near map.

    Rasters have rows from the south.

    truth: (rows, cols) `SurfaceKind` or `OBJECT`. kind: (rows, cols) `SurfaceKind`. water: (rows, cols)
    probability of water. raised_m, roof_height_m: (rows, cols) estimated and true height of roofs over the
    ground around them. moments: water cells seen and those of them called safe, after each window.
    safe_water: mask of the latter at the end. suspicion: probability of water above which ground is refused.
    """

    truth: Kinds
    kind: Kinds
    water: NDArray[np.float32]
    raised_m: NDArray[np.float32]
    roof_height_m: NDArray[np.float32]
    moments: tuple[tuple[int, int], ...]
    safe_water: NDArray[np.bool_]
    suspicion: float

    @property
    def known(self) -> NDArray[np.bool_]:
        """Return the cells that have a kind."""
        return np.asarray(self.kind != SurfaceKind.UNKNOWN)

    @property
    def refused(self) -> NDArray[np.bool_]:
        """Return the cells that may be water, in which nothing is safe."""
        return np.asarray(self.water > self.suspicion)

    @property
    def at_end(self) -> tuple[int, int]:
        """Return the water cells seen at the end, and those of them called safe."""
        return self.moments[-1]

    @property
    def at_worst(self) -> tuple[int, int]:
        """Return the same after the window when most of them were called safe."""
        return max(self.moments, key=lambda moment: (moment[1], moment[0]))


def run(survey: SurfaceSurvey, folder: Path) -> ClassifiedSurface:
    """Fly a survey, or load its recording from the folder, and process it window by window."""
    recording = fly(survey.flight, folder)
    if recording.surface is None:
        raise ValueError(f"{survey.name}: the recording tells nothing of the surface")
    pipeline, parameters = pipeline_for(Case(survey.name, survey.flight, 1.0))
    truth = true_kinds(recording.surface)
    moments: list[tuple[int, int]] = []
    safe = np.zeros(truth.shape, bool)
    for window in recording.windows():
        report = pipeline.process(window)
        maps = pipeline.maps(_box(report.near.grid, recording, truth.shape), "near")
        if maps is not None:
            water = (truth == SurfaceKind.WATER) & np.isfinite(maps.height_m)
            safe = water & (maps.state == SAFE)
            moments.append((int(water.sum()), int(safe.sum())))
    if not moments:
        raise RuntimeError(f"{survey.name}: nothing was seen")
    kind, probability, raised_m = _classified(pipeline, survey.extent_m)
    middle = _middles(recording, kind.shape)
    return ClassifiedSurface(
        truth[middle],
        kind,
        probability,
        raised_m,
        recording.surface.roof_height_m[middle],
        tuple(moments),
        safe,
        parameters.water_suspicion,
    )


def true_kinds(surface: RecordedSurface) -> Kinds:
    """Return the raster of the truth by the numbers of `SurfaceKind`, and `OBJECT`."""
    number = np.zeros(256, np.uint8)
    for name, value in surface.names.items():
        number[value] = OBJECT if name == "OBJECT" else SurfaceKind.__members__.get(name, 0)
    return np.asarray(number[surface.kind])


def _box(grid: Grid, recording: SurveyRecording, shape: tuple[int, ...]) -> Box:
    """Return the cells of a map that are those of the truth."""
    west, south, *_ = recording.survey.extent_m
    row, col = grid.index(west + grid.cell_m / 2, south + grid.cell_m / 2)
    return Box(row, row + shape[0], col, col + shape[1])


def _middles(recording: SurveyRecording, shape: tuple[int, ...]) -> tuple[NDArray[np.int64], ...]:
    """Return the indices of the truth's cells in the middle of cells of 1 m."""
    rows, cols = (
        np.floor((np.arange(n) + 0.5) * SIDE_M / recording.survey.cell_m).astype(np.int64) for n in shape
    )
    return np.ix_(rows, cols)


def _classified(
    pipeline: Pipeline, extent_m: tuple[float, float, float, float]
) -> tuple[Kinds, NDArray[np.float32], NDArray[np.float32]]:
    """Return kind, probability of water and height of a roof in cells of 1 m that fill an extent."""
    x0, y0, x1, y1 = extent_m
    rows, cols = int((y1 - y0) / SIDE_M), int((x1 - x0) / SIDE_M)
    kind = np.zeros((rows, cols), np.uint8)
    water, raised_m = np.zeros((2, rows, cols), np.float32)
    for row, col in itertools.product(range(rows), range(cols)):
        middle = np.array([x0 + (col + 0.5) * SIDE_M, y0 + (row + 0.5) * SIDE_M, 0.0])
        here = pipeline.surface_at(middle, 0.0)
        kind[row, col], water[row, col], raised_m[row, col] = here.kind, here.water, here.raised_m
    return kind, water, raised_m
