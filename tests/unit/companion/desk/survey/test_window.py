"""Cloud in one window: user's settings are kept, and useless times are ignored."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.desk import survey as command
from companion.desk.clouds.cloud import GeoreferencedCloud
from companion.desk.clouds.crs import from_option
from companion.desk.survey.classified_points import UNKNOWN_CLASS, classes
from companion.desk.survey.cloud_survey import survey
from companion.desk.survey.findings import of_window
from companion.runtime.errors import UsageError
from params import Parameters, load
from tests.unit.companion.desk.survey.clouds import field, placed, write

UTM = "EPSG:32610"
FIELD = placed(field(0.8), UTM)
Floats = NDArray[np.float64]


def cloud(points: Floats, gps_s: Floats | None = None) -> GeoreferencedCloud:
    return GeoreferencedCloud(points, gps_s, from_option(UTM), len(points), {})


def parameters(*settings: str) -> Parameters:
    return load("quadcopter", ["cell_m=0.5", *settings])


def test_a_cloud_higher_than_any_ground_asks_for_the_unit() -> None:
    with pytest.raises(UsageError, match="all are higher than 20 km; is the vertical unit right"):
        survey(cloud(FIELD + np.array([0, 0, 30_000.0])), parameters())


def test_the_width_of_gaps_that_somebody_set_is_kept_and_chosen_where_nobody_did() -> None:
    assert survey(cloud(FIELD), parameters("coverage_m=1.5")).parameters.coverage_m == 1.5
    assert survey(cloud(FIELD), parameters()).parameters.coverage_m > 1.5


@pytest.mark.parametrize("mode", ["default", "source"])
def test_no_more_zones_are_told_of_than_somebody_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])
    near = placed(field(), UTM)
    path = write(tmp_path / "a.las", np.vstack([near, near + np.array([100.0, 0, 0])]))
    all_, one = (
        command.run([path], tmp_path / f"{len(own)}", parameters(f"mode={mode}", *own), lambda *_: None)
        for own in ([], ["max_zones=1"])
    )
    assert len(all_["zones"]) == 2
    best = all_["zones"][0]
    assert [(row["lat"], row["lon"]) for row in one["zones"]] == [(best["lat"], best["lon"])]


@pytest.mark.parametrize(
    "gps_s",
    [
        lambda n: np.full(n, np.nan),
        lambda n: np.where(np.arange(n) % 2, 2e9, 0.0),  # some of them of another clock
        lambda n: np.arange(n)[::-1] * 1e-3,
    ],
)
def test_the_order_of_points_and_times_that_cannot_be_change_no_zone(
    gps_s: Callable[[int], Floats],
) -> None:
    timed = survey(cloud(FIELD, gps_s(len(FIELD))), parameters())
    bare = survey(cloud(FIELD), parameters())
    assert timed.report.n_used == bare.report.n_used == len(FIELD)
    np.testing.assert_array_equal(timed.maps.state, bare.maps.state)
    assert [z.area_m2 for z in timed.report.zones] == [z.area_m2 for z in bare.report.zones] != []


def test_points_beside_the_map_are_of_unknown_class() -> None:
    found = of_window(survey(cloud(FIELD), parameters()), len(FIELD), 0.0)
    beside = FIELD[:5] + np.array([0, 5000.0, 0])
    assert classes(beside, found.maps, found.metric).tolist() == [UNKNOWN_CLASS] * 5
    assert classes(np.empty((0, 3)), found.maps, found.metric).tolist() == []
    assert set(classes(FIELD, found.maps, found.metric).tolist()) > {UNKNOWN_CLASS}
