"""Surveys for the kind of ground: choice, truth, and a flight over a river."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.desk.reproduce import surface_surveys
from companion.desk.reproduce.surface_surveys import (
    OBJECT,
    SURFACES,
    ClassifiedSurface,
    SurfaceSurvey,
    run,
    true_kinds,
)
from companion.desk.reproduce.survey_recording import RecordedSurface, SurveyFlight, SurveyRecording, fly
from slz import SurfaceKind

BANK = SurfaceSurvey("river", (-20.0, -40.0, 20.0, 0.0))


@pytest.fixture(scope="module")
def surveys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("surveys")


def test_names_differ_and_every_survey_holds_the_surface() -> None:
    assert len({survey.name for survey in SURFACES}) == len(SURFACES)
    assert all(survey.flight.surface for survey in SURFACES)


def test_true_kinds_have_the_numbers_of_the_classified_ones() -> None:
    names = {"OUTSIDE": 0, "BARE": 1, "WATER": 7, "OBJECT": 9}
    none = np.empty((0, 3), np.float32)
    one = RecordedSurface(
        none[:, 0],
        none,
        none,
        none[:, 0],
        np.empty(0, np.int64),
        np.array([[0, 1], [7, 9]], np.uint8),
        names,
        np.zeros((2, 2), np.float32),
    )
    expected = [[SurfaceKind.UNKNOWN, SurfaceKind.BARE], [SurfaceKind.WATER, OBJECT]]
    assert true_kinds(one).tolist() == expected


def test_the_bank_is_told_apart_from_the_river(surveys: Path) -> None:
    found = run(BANK, surveys)
    assert found.truth.shape == found.kind.shape == found.water.shape == (40, 40)
    bank, river = np.s_[37:, :20], np.s_[13:23]
    assert (found.truth[bank] == SurfaceKind.BARE).all()
    assert (found.truth[river] == SurfaceKind.WATER).all()
    assert np.mean(found.kind[bank] == SurfaceKind.BARE) > 0.95
    assert np.mean(found.refused[river]) > 0.9
    seen, safe = found.at_end
    assert 2_000 < seen < 20_000  # of 40,000 cells of 0.2 m
    assert safe <= found.at_worst[1] < 0.05 * seen
    assert found.safe_water.sum() == safe


def test_the_worst_moment_is_that_with_most_safe_water() -> None:
    blank = np.zeros((1, 1))
    mask = blank.astype(bool)
    kinds, real = blank.astype(np.uint8), blank.astype(np.float32)
    found = ClassifiedSurface(kinds, kinds, real, real, real, ((9, 1), (20, 7), (30, 2)), mask, 0.05)
    assert found.at_worst == (20, 7)
    assert found.at_end == (30, 2)
    assert replace(found, moments=((0, 0), (30, 0), (20, 0))).at_worst == (30, 0)


def silent(survey: SurveyFlight, folder: Path) -> SurveyRecording:
    """Return a survey without its returns."""
    one = fly(survey, folder)
    return replace(one, count=np.zeros_like(one.count), surface=one.surface and quiet(one.surface))


def quiet(surface: RecordedSurface) -> RecordedSurface:
    return replace(surface, lost_count=np.zeros_like(surface.lost_count))


def test_a_survey_in_which_nothing_was_seen_is_said_to_be_one(
    surveys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(surface_surveys, "fly", silent)
    with pytest.raises(RuntimeError, match="surface of river: nothing was seen"):
        run(BANK, surveys)


def test_a_recording_without_evidence_of_the_surface_is_refused(
    surveys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(surface_surveys, "fly", lambda *asked: replace(fly(*asked), surface=None))
    with pytest.raises(ValueError, match="surface of river: the recording tells nothing of the surface"):
        run(BANK, surveys)
