"""Ways in and out of surveyed landing points: blocked, or not seen, and in every file of the zones."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Geod

from companion.desk import survey
from companion.desk.survey.flatgeobuf import zones_within
from companion.desk.survey.map_run import MapOptions
from companion.desk.survey.survey_corridors import check_reach
from companion.runtime.errors import UsageError
from params import Parameters, load
from tests.unit.companion.desk.survey.clouds import field, placed, write

CRS, GROUND_M, WALL_M = "EPSG:32612", 100.0, 8.0  # 12 degrees from its meridian the grid is turned by 8
WALL_EAST_M = 46.0
EARTH = Geod(ellps="WGS84")


def settings(*more: str) -> Parameters:
    return load(
        "quadcopter", ["cell_m=0.5", "survey_height_m=15", "coverage_m=1.5", "approach_slope_deg=15", *more]
    )


def walled() -> NDArray[np.float64]:
    """Return the flat field with a wall 8 m high from south to north, and nothing on it but the wall."""
    xyz = field()
    xyz[(np.abs(xyz[:, :2] - 20) < 2).all(axis=1), 2] = GROUND_M
    xyz[np.abs(xyz[:, 0] - WALL_EAST_M) < 0.6, 2] = GROUND_M + WALL_M
    return xyz


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("walled")
    path = write(folder / "a.laz", placed(walled(), CRS), CRS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("companion.desk.figures.save_maps", lambda *_: [])
        plan = MapOptions(corridors=True, tile_m=128)
        return folder / "out", survey.run([path], folder / "out", settings(), lambda *_: None, plan)


def within(bearing: float, pair: list[int]) -> bool:
    return (bearing - pair[0]) % 360 <= (pair[1] - pair[0]) % 360


def test_a_wall_blocks_the_bearings_towards_it_and_the_rest_was_not_seen(mapped: Any) -> None:
    zones = mapped[1]["zones"]
    west = max(zones, key=lambda zone: zone["area_m2"])
    told = west["corridors"]
    assert told["slope_deg"] == 15.0
    assert "clear_deg" not in told
    wall = next(one for one in told["blocked"] if within(90.0, one["bearings_deg"]))
    assert wall["height_m"] == pytest.approx(WALL_M, abs=0.1)
    bearing, _, away = EARTH.inv(west["lon"], west["lat"], wall["lon"], wall["lat"])
    assert within(bearing % 360, wall["bearings_deg"])
    first, last = wall["bearings_deg"]
    assert (first + last) / 2 == pytest.approx(
        90, abs=4
    )  # true bearings: those of the grid differ by 8 degrees
    assert wall["distance_m"] == pytest.approx(away, rel=0.01)
    assert wall["least_slope_deg"] >= math.degrees(math.atan(wall["height_m"] / wall["distance_m"]))
    assert any(within(270.0, pair) for pair in told["unknown_deg"])
    assert told["unblocked_deg"] < 360


def test_every_file_of_the_zones_holds_them(mapped: Any) -> None:
    out, summary = mapped
    features = json.loads((out / "zones.geojson").read_text("utf-8"))["features"]
    assert [one["properties"]["corridors"] for one in features] == [
        zone["corridors"] for zone in summary["zones"]
    ]
    with (out / "zones.csv").open(encoding="utf-8", newline="") as file:
        sentences = [row["corridors"] for row in csv.DictReader(file)]
    assert any(
        "8.0 m high" in one and one.endswith("in the way, the air was not seen") for one in sentences
    ), sentences
    rows, _ = zones_within(out / "zones.fgb", (-180.0, -90.0, 180.0, 90.0))
    assert sorted(row["corridors"] for row in rows) == sorted(sentences)
    described = " ".join(
        one.text or ""
        for one in ElementTree.parse(out / "zones.kml").iter()
        if one.tag.endswith("description")
    )
    assert all(one in described for one in sentences)
    page = (out / "map.html").read_text("utf-8")
    assert '"ways in and out", z.corridors' in page
    assert json.dumps(sentences[0]) in page


def test_tiles_change_no_bit_of_them(tmp_path: Path) -> None:
    xyz = walled() + np.array([500_060.0, 4_500_076.0, 0.0])  # lines of tiles of 128 m cross wall and field
    found = [
        survey.run(
            [write(tmp_path / f"{tile_m}.laz", xyz)],
            tmp_path / str(tile_m),
            settings(),
            lambda *_: None,
            MapOptions(corridors=True, tile_m=tile_m),
        )["zones"]
        for tile_m in (128.0, 10_000.0)
    ]
    assert found[0] == found[1]
    assert found[0][0]["corridors"]["blocked"]


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (("mode=source",), "mode=source judges no ways"),
        (("corridor_m=1000", "approach_slope_deg=3", "survey_height_m=100", "cell_m=0.4"), "cells of 0.4 m"),
    ],
)
def test_corridors_that_cannot_be_judged_are_refused_in_one_line(
    given: tuple[str, ...], reason: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=reason) as refused:
        survey.run([], tmp_path / "out", settings(*given), lambda *_: None, MapOptions(corridors=True))
    assert "\n" not in str(refused.value)


def test_the_distance_that_a_refusal_names_is_accepted() -> None:
    asked = ("approach_slope_deg=3", "survey_height_m=100")
    with pytest.raises(UsageError, match="corridor_m to ") as refused:
        check_reach(settings("corridor_m=1000", "cell_m=0.2", *asked))
    most = str(refused.value).split("corridor_m to ")[1].split()[0]
    check_reach(settings(f"corridor_m={most}", "cell_m=0.2", *asked))
