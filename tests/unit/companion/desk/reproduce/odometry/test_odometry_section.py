"""Odometry under drift, over level ground made by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.desk.reproduce import odometry_section
from companion.desk.reproduce.odometry_section import SURVEYS, DriftingSurvey, DriftOutcome, run
from companion.desk.reproduce.survey_recording import SurveyFlight, SurveyRecording

PLAIN = DriftingSurvey("plain", "severe")
SCANS, POINTS, SPEED_MS = 80, 3000, 5.0


def level_ground(_flight: SurveyFlight, _folder: Path) -> SurveyRecording:
    """Eight seconds over level ground, eastward."""
    rng = np.random.default_rng(1)
    stamp_ns = np.sort(rng.integers(0, 100_000_000, (SCANS, POINTS)), axis=1)
    stamp_ns[:, 0], stamp_ns[:, -1] = 0, 99_999_999
    stamp_ns += 100_000_000 * np.arange(SCANS)[:, np.newaxis]
    east_m = SPEED_MS * stamp_ns[:, -1] * 1e-9
    points = rng.uniform(-12, 12, (SCANS, POINTS, 3))
    points[..., 0] += east_m[:, np.newaxis]
    points[..., 2] = rng.normal(0, 0.02, (SCANS, POINTS))
    none = np.zeros((1, 1), np.float32)
    return SurveyRecording(
        SurveyFlight("plain", (0.0, 0.0, 1.0, 1.0)),
        points.reshape(-1, 3).astype(np.float32),
        stamp_ns.ravel(),
        np.column_stack([east_m, np.zeros(SCANS), np.full(SCANS, 20.0)]),
        np.full(SCANS, POINTS),
        none.astype(np.uint8),
        none,
        none,
        none,
        {},
        "made by hand",
    )


@pytest.fixture
def outcome(monkeypatch: pytest.MonkeyPatch) -> DriftOutcome:
    monkeypatch.setattr(odometry_section, "fly", level_ground)
    monkeypatch.setitem(odometry_section.SEVERITIES, "severe", (0.03, 0.1))  # enough to see in eight seconds
    return run(PLAIN, Path())


def test_over_level_ground_the_place_follows_the_autopilot_and_the_height_the_map(
    outcome: DriftOutcome,
) -> None:
    assert outcome.way_m == pytest.approx(SPEED_MS * 0.1 * (SCANS - 1), rel=1e-6)
    settled = outcome.at_s > 2.0
    assert outcome.observed[settled].all(axis=0).tolist() == [False, False, True]
    np.testing.assert_allclose(outcome.error_enu_m[:, :2], outcome.drift_enu_m[:, :2], atol=0.01)
    assert np.abs(outcome.drift_enu_m[-1, 2]) > 0.2
    assert np.abs(outcome.error_enu_m[-1, 2]) < 0.05
    assert outcome.inside_band > 0.9


def test_the_section_tells_errors_consistency_and_time(
    outcome: DriftOutcome, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(odometry_section, "run", lambda survey, _folder: replace(outcome, survey=survey))
    told: list[str] = []
    section = odometry_section.section(SURVEYS[:2], tmp_path / "odometry", tmp_path, told.append)
    assert told == [survey.name for survey in SURVEYS[:2]]
    (table,), ((_, (picture,)),) = section.tables, section.pictures
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert [row[0] for row in table.rows] == ["stadium, no drift", "stadium, moderate drift"]
    assert all(len(row) == len(table.columns) for row in table.rows)
    figures = section.figures["odometry"]["odometry over stadium, no drift"]
    assert figures["place_observed"] == 0.0
    assert figures["height_observed"] > 0.8
    assert figures["autopilot_up_rms_m"] > figures["odometry_up_rms_m"]


def test_each_survey_is_one_of_the_scenes_of_the_sources() -> None:
    assert len({survey.name for survey in SURVEYS}) == len(SURVEYS) >= 7
    assert {survey.scene for survey in SURVEYS} <= {c.survey.scene for c in odometry_section.CASES}
