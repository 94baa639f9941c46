"""Counts of kinds of ground on a case made by hand, and their section of the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.desk import reproduce
from companion.desk.reproduce import run, surface_section
from companion.desk.reproduce.reproduction_page import Section
from companion.desk.reproduce.surface_section import KindCount, section
from companion.desk.reproduce.surface_surveys import OBJECT, ClassifiedSurface, SurfaceSurvey
from slz import SurfaceKind

UNKNOWN, BARE, WATER, ROOF, PLANTS, _ = SurfaceKind
POND = SurfaceSurvey("pond", (0.0, 0.0, 4.0, 4.0))


def by_hand() -> ClassifiedSurface:
    """Return 4 x 4 cells: bare, water, roof, and a car beside what the survey did not reach."""
    truth = np.array([[BARE] * 4, [WATER] * 4, [ROOF] * 4, [OBJECT, UNKNOWN, UNKNOWN, PLANTS]], np.uint8)
    kind = np.array(
        [
            [BARE, BARE, BARE, WATER],
            [WATER, WATER, BARE, UNKNOWN],
            [ROOF, ROOF, ROOF, BARE],
            [BARE, WATER, UNKNOWN, UNKNOWN],
        ],
        np.uint8,
    )
    water = np.zeros((4, 4), np.float32)
    water[0], water[1] = [0.0, 0.06, 0.05, 0.9], [1.0, 0.8, 0.2, 0.9]
    raised, true_m = np.zeros((4, 4), np.float32), np.full((4, 4), np.nan, np.float32)
    raised[2], true_m[2] = [4.0, 3.5, 4.2, 0.0], 4.0
    safe = np.zeros((20, 20), bool)
    safe[7, 10:12] = True
    return ClassifiedSurface(truth, kind, water, raised, true_m, ((50, 10), (80, 2)), safe, 0.05)


def test_cells_are_counted_by_their_true_kind_where_they_have_one() -> None:
    found = by_hand()
    nothing = pytest.approx((np.nan, np.nan), nan_ok=True)
    assert KindCount.of(found, BARE) == KindCount(4, 4, 3, 1, 2, nothing)
    assert KindCount.of(found, WATER) == KindCount(4, 3, 2, 2, 3, nothing)
    assert KindCount.of(found, PLANTS) == KindCount(1, 0, 0, 0, 0, nothing)


def test_a_roof_classified_as_one_has_the_error_of_its_height() -> None:
    count = KindCount.of(by_hand(), ROOF)
    assert (count.known, count.right, count.water, count.refused) == (4, 3, 0, 0)
    assert count.roof_errors_m == pytest.approx((0.2, 0.5), abs=1e-6)


@pytest.fixture
def handmade(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surface_section, "run", lambda *_: by_hand())


@pytest.mark.usefixtures("handmade")
def test_the_section_has_a_row_for_each_kind_and_the_water_called_safe(tmp_path: Path) -> None:
    steps: list[str] = []
    found = section([POND], tmp_path / "surface", tmp_path, steps.append)
    kinds, water, probability = found.tables
    assert steps == ["surface of pond"]
    assert kinds.rows == [
        ("pond", "bare ground", "4", "4", "75.0", "25.0", "50.0", "", ""),
        ("pond", "water", "4", "3", "66.7", "66.7", "100.0", "", ""),
        ("pond", "roof", "4", "4", "75.0", "0.0", "0.0", "0.20", "0.50"),
        ("pond", "low vegetation", "1", "0", "", "", "", "", ""),
    ]
    assert water.rows == [("pond", "80", "2", "2.5", "10", "20.0")]
    # Of the cells known the car and the roof count as no water, what the survey did not reach not at all.
    assert sum(int(row[1]) for row in probability.rows) == 12
    error = (0.06 + 0.05 + 0.9 + (1 - 0.8) + (1 - 0.2)) / 12
    assert found.figures["probability_of_water"]["calibration_error"] == pytest.approx(error, abs=1e-4)
    assert found.figures["surface"]["pond"]["kinds"]["roof"]["roof_error_m"] == [0.2, 0.5]
    assert all(file.exists() for _, files in found.pictures for file in files)


@pytest.mark.usefixtures("handmade")
def test_a_survey_is_chosen_by_its_name_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def one(surveys: list[SurfaceSurvey], out: Path, *_: object) -> Section:
        asked.extend(survey.scene for survey in surveys)
        return Section([], [], {"out": out.name})

    monkeypatch.setattr(surface_section, "section", one)
    monkeypatch.setattr(reproduce, "SURFACES", (POND, SurfaceSurvey("meadow", POND.extent_m)))
    found = run(tmp_path, lambda _what, _share: None, "of pond")
    assert asked == ["pond"]
    assert found["out"] == "surface"
    assert "scenes" not in found
