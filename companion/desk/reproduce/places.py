"""The three landing places of the sources, and their surroundings (SLZ thesis, Section 4.4.5)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from companion.desk.reproduce.scenarios import ONE_MAP
from companion.desk.reproduce.source_scenes import Case, Settings, pipeline_for
from companion.desk.reproduce.survey_recording import SurveyFlight, SurveyRecording, fly
from companion.desk.reproduce.true_obstacles import Pair, TrueSurroundings
from params import Parameters
from slz import Box, SelectedPoint, Surroundings, TerrainMaps

ABOVE_DEG, BELOW_DEG = 7.0, 1.0
"""Tolerated errors of the horizon: too high costs an approach, too low hides an obstacle. Noise of 0.12 m on
the ground at the footprint's edge, 1 m away, appears 7 degrees high."""


@dataclass(frozen=True, slots=True)
class Place:
    """A landing point: its position, its survey, and the settings of each mode."""

    name: str
    survey: SurveyFlight
    east_north_m: tuple[float, float]
    settings: Settings = ()
    source: Settings = ("cell_m=1",)

    def case(self, mode: str) -> Case:
        own = (f"mode={mode}", *ONE_MAP, *self.settings)
        return Case(
            f"{self.name}, {mode} mode",
            self.survey,
            1.0,
            settings=(*own, *(self.source if mode == "source" else ())),
        )


PLACES = (
    Place(
        "open plain",
        SurveyFlight(
            "plain",
            (-33.0, -33.0, 33.0, 33.0),
            spacing_m=22.0,
            speed_ms=15.0,
            point_rate_hz=80_000,
            cell_m=0.5,
        ),
        (0.0, 0.0),
    ),
    Place(
        "between two buildings",
        SurveyFlight(
            "buildings", (-28.0, -20.0, 30.0, 20.0), spacing_m=14.0, speed_ms=10.0, point_rate_hz=100_000
        ),
        (1.0, 0.0),
    ),
    Place(
        "inside the stadium",
        SurveyFlight(
            "stadium",
            (-112.0, -14.0, 32.0, 98.0),
            spacing_m=22.0,
            speed_ms=25.0,
            point_rate_hz=100_000,
            cell_m=0.5,
        ),
        (-40.0, 40.0),
        ("cell_m=0.5", "surround_m=75"),
        (),
    ),
)


@dataclass(frozen=True, slots=True)
class ObservedPoint:
    """A selected point after a survey, the true obstacles around it, and the map about it."""

    place: Place
    mode: str
    selected: SelectedPoint
    truth: TrueSurroundings
    maps: TerrainMaps
    parameters: Parameters

    @property
    def surroundings(self) -> Surroundings:
        if self.selected.surroundings is None:
            raise RuntimeError(f"{self.place.name}: nothing is known around the point")
        return self.selected.surroundings

    @property
    def pairs(self) -> list[Pair]:
        """Return the true obstacles in named regions, each with the obstacle found for it."""
        return [pair for pair in self.truth.pairs(self.surroundings) if pair.true.where]

    @property
    def phantoms(self) -> int:
        return self.truth.phantoms(self.surroundings, 2 * self.maps.grid.cell_m)

    def true_horizon_deg(self, spare_deg: float = 0.0) -> NDArray[np.float64]:
        return self.truth.horizon_deg(self.parameters.footprint_m / 2, spare_deg)

    @property
    def too_low(self) -> int:
        """Return the number of sectors with a horizon below the truth; unseen sectors do not count."""
        return int((self.surroundings.horizon_deg < self.true_horizon_deg(-1.0) - BELOW_DEG).sum())

    @property
    def too_high(self) -> int:
        return int((self.surroundings.horizon_deg > self.true_horizon_deg(1.0) + ABOVE_DEG).sum())

    @property
    def horizon_error_deg(self) -> float:
        """Return the median absolute error of the horizon."""
        return float(np.nanmedian(np.abs(self.surroundings.horizon_deg - self.true_horizon_deg())))


def watch(place: Place, mode: str, surveys: Path, recording: SurveyRecording | None = None) -> ObservedPoint:
    """Fly over a place, select its point before the last window, and return its surroundings and truth."""
    recording = recording or fly(place.survey, surveys)
    pipeline, parameters = pipeline_for(place.case(mode))
    windows = list(recording.windows())
    if not windows:
        raise RuntimeError(f"{place.name}: nothing was seen")
    for window in windows[:-1]:
        pipeline.process(window)
    pipeline.select(np.array([*place.east_north_m, 0.0]))
    report = pipeline.process(windows[-1])
    grid, selected = report.near.grid, report.selected
    reach = int(np.ceil(1.1 * parameters.surround_m / grid.cell_m))
    row, col = grid.index(*place.east_north_m)
    box = Box(row - reach, row + reach + 1, col - reach, col + reach + 1)
    maps = pipeline.maps(box.grown(0, grid), "near")
    if selected is None or maps is None:
        raise RuntimeError(f"{place.name}: nothing is known of it")
    truth = TrueSurroundings(recording, *place.east_north_m, parameters.surround_m)
    return ObservedPoint(place, mode, selected, truth, maps, parameters)
