"""Reason for a survey without a zone, in one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.desk import survey
from companion.desk.survey.nearest_zones import nearest
from tests.unit.companion.desk.survey.clouds import LAT, LON, field, placed, write
from tests.unit.companion.desk.survey.tiled.ground import parameters


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])


def told(folder: Path, points_m: np.ndarray, *settings: str) -> dict[str, Any]:
    path = write(folder / "a.laz", placed(points_m, "EPSG:32610"))
    return survey.run([path], folder / "out", parameters(*settings), lambda *_: None)


def steep() -> np.ndarray:
    points = field()
    points[:, 2] += points[:, 0] * np.tan(np.radians(25))
    return points


@pytest.mark.parametrize(
    ("points_m", "settings", "says"),
    [
        (field(10.0), (), "24 of 24 points, 0.06 per m2, leave no ground without gaps of"),
        (steep(), (), "of known ground is safe: 100% of what is unsafe is steeper than 10 degrees"),
        (field(), ("min_square_m=50",), "no square of 50 m fits into the"),
    ],
    ids=["too few", "too steep", "square too large"],
)
def test_no_zone_has_its_reason(
    tmp_path: Path, points_m: np.ndarray, settings: tuple[str, ...], says: str
) -> None:
    answer = told(tmp_path, points_m, *settings)
    assert answer["zones"] == []
    assert says in answer["no_zone"]
    assert f'"no_zone": {json.dumps(answer["no_zone"])}' in (tmp_path / "out" / "map.html").read_text("utf-8")
    nothing = nearest(tmp_path / "out", LAT, LON, 100.0)
    assert nothing["no_zone"] == "the survey holds none within 100 m"


def test_points_that_were_dropped_are_part_of_the_reason(tmp_path: Path) -> None:
    points_m = placed(steep(), "EPSG:32610")
    kinds = np.full(len(points_m), 2)
    kinds[:3391], kinds[-9:] = 9, 7  # water; so little noise does not matter
    path = write(tmp_path / "a.laz", points_m, classification=kinds)
    answer = survey.run([path], tmp_path / "out", parameters(), lambda *_: None)
    assert answer["no_zone"].endswith("near an obstacle; 3,391 points dropped as water")


def test_a_survey_with_zones_gives_no_reason(tmp_path: Path) -> None:
    answer = told(tmp_path, field())
    assert answer["zones"]
    assert answer["no_zone"] is None
    assert nearest(tmp_path / "out", LAT, LON)["no_zone"] is None
