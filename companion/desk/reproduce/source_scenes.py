"""The sources' scenes as test cases, with the sources' figures, and their runs through the pipeline."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import params
from companion.desk.reproduce.survey_recording import SurveyFlight, SurveyRecording, fly
from companion.desk.reproduce.truth_comparison import Scores, compare
from params import Parameters
from slz import Pipeline, Report, TerrainMaps, zone_mask
from slz.paper.paper_report import chosen_map

Settings = tuple[str, ...]

# The sources' figures (SLZ paper, Section 4; SLZ thesis, Section 4): Eq. (20), and time per second of LiDAR.
PAPER_AREA_ERROR = 0.287
PAPER_MS = 600.0
FINE = SurveyFlight("stadium", (-100.0, -10.0, 20.0, 90.0))


@dataclass(frozen=True, slots=True)
class Case:
    """One run: a survey, a profile with settings, and the limit of its area error, SLZ paper, Eq. (20)."""

    name: str
    survey: SurveyFlight
    area_error_limit: float
    profile: str = "quadcopter"
    settings: Settings = field(default=())

    @property
    def folder(self) -> str:
        """Return the name as that of a folder."""
        return self.name.replace(" ", "_").replace(",", "")


@dataclass(frozen=True, slots=True)
class CaseOutcome:
    """Result of a run."""

    case: Case
    scores: Scores
    report: Report
    maps: TerrainMaps
    parameters: Parameters
    ms: tuple[float, ...]
    ids: int
    regions: Mapping[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]

    @property
    def ms_median(self) -> float:
        return float(np.median(self.ms))

    @property
    def ms_p99(self) -> float:
        return float(np.percentile(self.ms, 99))

    @property
    def covered_m2(self) -> float:
        """Return the area of the union of all zones; zones of the source's rules overlap."""
        covered = zone_mask(self.report.zones, self.maps.box).sum()
        return float(covered) * self.maps.grid.cell_m**2

    @property
    def ms_max(self) -> float:
        return max(self.ms)


STADIUM_AT_1_M = SurveyFlight(
    "stadium",
    (-200.0, -200.0, 200.0, 200.0),
    spacing_m=20.0,
    speed_ms=20.0,
    point_rate_hz=50_000,
    cell_m=1.0,
    footprint_m=3.0,
    slope_limit_deg=4.0,
)
_SOURCE = ("mode=source", "zone_m=420")

CASES = (
    Case("1 stadium", FINE, 0.05),
    Case("2 road and yards", SurveyFlight("streets", (-10.0, 14.0, 90.0, 114.0)), 0.10),
    Case("3 plain between mountains", SurveyFlight("mountains", (-50.0, -70.0, 50.0, 30.0)), 0.10),
    Case("4 dense buildings", SurveyFlight("dense", (-38.0, -38.0, 38.0, 38.0)), 0.10),
    Case("5 hill", SurveyFlight("hill", (-50.0, -130.0, 50.0, -30.0)), 0.10),
    Case("plain with a lake", SurveyFlight("plain", (-10.0, -90.0, 90.0, 10.0), surface=True), 0.10),
    Case(
        "1 stadium, source mode at 1 m",
        STADIUM_AT_1_M,
        PAPER_AREA_ERROR,
        "helicopter",
        _SOURCE,
    ),
)


def pipeline_for(case: Case) -> tuple[Pipeline, Parameters]:
    """Return a pipeline for a case, its first map about the survey's middle, and its parameters."""
    x0, y0, x1, y1 = case.survey.extent_m
    side = 2.4 * max(x1 - x0, y1 - y0)
    own = [f"zone_m={side:.0f}", "max_zones=1000", "max_age_s=86400", *case.settings]
    parameters = params.load(case.profile, own)
    return Pipeline(parameters, ((x0 + x1) / 2, (y0 + y1) / 2)), parameters


def run(case: Case, folder: Path) -> tuple[CaseOutcome, SurveyRecording]:
    """Fly a case, or load its recording from the folder, and process it window by window."""
    recording = fly(case.survey, folder)
    pipeline, parameters = pipeline_for(case)
    report, ms, ids = None, [], set()
    for window in recording.windows():
        started = time.perf_counter()
        report = pipeline.process(window)
        ms.append(1e3 * (time.perf_counter() - started))
        ids |= {zone.id for zone in report.zones}
    maps = pipeline.maps(which=chosen_map(report))
    if report is None or maps is None:
        raise RuntimeError(f"{case.name}: nothing was seen")
    scores = compare(recording, maps, report.zones, parameters)
    outcome = CaseOutcome(case, scores, report, maps, parameters, tuple(ms), len(ids), recording.regions)
    return outcome, recording
