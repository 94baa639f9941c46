"""A folder of `slz map` as the prior of a flight."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from pyproj import Transformer

from companion.desk import survey
from companion.flight.mapping.survey_prior import SurveyPrior
from companion.flight.services.rally_points import best_points
from companion.runtime.errors import UsageError
from params import Parameters, load
from slz import SAFE, UNSAFE, LocalFrame
from tests.unit.companion.desk.survey.clouds import write
from tests.unit.companion.desk.survey.tiled.ground import CORNER, parameters, points

FLIGHT = load("quadcopter", [])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("prior")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("companion.desk.figures.save_maps", lambda *_: [])
        survey.run([write(made / "a.laz", points(100_000))], made / "out", parameters(), lambda *_: None)
    return made / "out"


def frame_at(east_m: float, north_m: float) -> LocalFrame:
    """Return the frame at a place of the surveyed field."""
    there = Transformer.from_crs("EPSG:32610", "EPSG:4326", always_xy=True)
    lon, lat = there.transform(CORNER[0] + east_m, CORNER[1] + north_m)
    return LocalFrame(float(lat), float(lon), 12.0)


def test_the_survey_lies_where_it_was_made(folder: Path) -> None:
    xyz = points(100_000)
    found = SurveyPrior(folder, FLIGHT)(frame_at(40, 90), np.zeros(3))
    assert found is not None
    rows, cols = np.nonzero(found.state == SAFE)
    assert len(rows) > 5000
    east = found.grid.west_m + (cols + 0.5) * found.grid.cell_m
    north = found.grid.south_m + (rows + 0.5) * found.grid.cell_m
    # Near the middle of a UTM zone its grid is that of the tangent plane, but for the scale of 0.9996.
    x, y = CORNER[0] + 40 + east * 0.9996, CORNER[1] + 90 + north * 0.9996
    for k in range(0, len(rows), 500):
        near = xyz[np.hypot(xyz[:, 0] - x[k], xyz[:, 1] - y[k]) < 0.7, 2]
        if len(near):
            assert found.height_m[rows[k], cols[k]] + 12.0 == pytest.approx(np.median(near), abs=0.15)
    assert (found.state == UNSAFE).sum() > 300


def test_a_place_off_the_survey_has_none(folder: Path) -> None:
    assert SurveyPrior(folder, FLIGHT)(frame_at(9000, 90), np.zeros(3)) is None


@pytest.mark.parametrize("setting", ["footprint_m=3", "relief_m=0.1", "safe_slope_deg=5"])
def test_a_survey_for_a_hardier_vehicle_is_refused(folder: Path, setting: str) -> None:
    with pytest.raises(UsageError, match=f"survey again with --set {setting}"):
        SurveyPrior(folder, load("quadcopter", [setting]))


def test_a_folder_without_survey_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no survey\.json"):
        SurveyPrior(tmp_path, Parameters())
    (tmp_path / "survey.json").write_text(json.dumps({"parameters": Parameters().model_dump()}))
    with pytest.raises(UsageError, match=r"no safe\.tif"):
        SurveyPrior(tmp_path, Parameters())


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ([], "not as slz map writes it"),
        ({"crs": None}, "not as slz map writes it"),
        ({"crs": "nonsense"}, "not as slz map writes it"),
        ({"cells": {}}, "not as slz map writes it"),
        ({"parameters": "none"}, "not as slz map writes it"),
        ({"vertical_unit_m": math.nan}, "lengths that are none"),
    ],
)
def test_a_damaged_summary_is_refused_in_one_line(
    folder: Path, tmp_path: Path, changed: Any, said: str
) -> None:
    made = shutil.copytree(folder, tmp_path / "survey")
    told = json.loads((made / "survey.json").read_text("utf-8"))
    text = json.dumps(told | changed if isinstance(changed, dict) else changed)
    (made / "survey.json").write_text(text, "utf-8")
    with pytest.raises(UsageError, match=said) as caught:
        SurveyPrior(made, FLIGHT)
    assert "\n" not in str(caught.value)


def test_damaged_maps_are_refused_before_the_flight(folder: Path, tmp_path: Path) -> None:
    made = shutil.copytree(folder, tmp_path / "survey")
    with rasterio.open(made / "dsm.tif") as file:
        profile = file.profile | {"height": 64, "width": 64}
    with rasterio.open(tmp_path / "other.tif", "w", **profile):
        pass
    shutil.copy(tmp_path / "other.tif", made / "dsm.tif")
    with pytest.raises(UsageError, match="not of one survey"):
        SurveyPrior(made, FLIGHT)
    (made / "dsm.tif").write_bytes(b"")
    with pytest.raises(UsageError, match=r"dsm\.tif cannot be read"):
        SurveyPrior(made, FLIGHT)


def test_rally_points_are_the_survey_s_until_near_zones_are_known() -> None:
    from dataclasses import replace
    from types import SimpleNamespace

    from tests.unit.companion.flight.landing.flight import Flight, zone

    vehicle: Any = SimpleNamespace(position_lla=(47.0, 8.0, 430.0), relative_alt_m=30.0)
    flight = Flight([])
    flight.prior_zones = [zone(100_001, 50, 0, certainty=0.5), zone(100_002, 0, 80, certainty=0.5)]
    report = flight.situation().report
    assert report is not None
    assert len(best_points(report, vehicle, FLIGHT)) == 2
    seen = replace(report, near=replace(report.near, zones=(zone(1, 10, 10),)))
    assert len(best_points(seen, vehicle, FLIGHT)) == 1
