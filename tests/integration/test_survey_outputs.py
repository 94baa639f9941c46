"""Outputs of `slz map` for other programs: FlatGeobuf, CSV, the offline page; and nearest zones."""

from __future__ import annotations

import base64
import csv
import html
import io
import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import rasterio
import shapely
from pyproj import Geod
from rasterio._err import CPLE_AppDefinedError
from shapely.geometry import shape

from companion.cli import program
from companion.desk import survey
from companion.desk.survey.flatgeobuf import write_flatgeobuf, zones_within
from companion.desk.survey.nearest_zones import nearest
from companion.runtime.errors import UsageError
from tests.e2e.chromium import Chromium
from tests.unit.companion.desk.survey.clouds import LAT, LON, field, placed, write
from tests.unit.companion.desk.survey.tiled.ground import CORNER, parameters, points

GEOD = Geod(ellps="WGS84")


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("outputs")
    xyz = points(100_000)
    apart = np.abs(xyz[:, 1] - CORNER[1] - 13) > 3  # a narrow zone in the south, which is not the best
    path = write(folder / "a.laz", xyz[apart])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("companion.desk.figures.save_maps", lambda *_: [])
        told = survey.run([path], folder / "out", parameters(), lambda *_: None)
    return folder / "out", told


def test_every_output_names_what_its_heights_are_counted_from(out: tuple[Path, dict[str, Any]]) -> None:
    folder, told = out
    datum = told["vertical_datum"]
    assert datum
    assert json.loads((folder / "zones.geojson").read_text("utf-8"))["vertical_datum"] == datum
    assert json.dumps(datum) in (folder / "map.html").read_text("utf-8")
    rows, _ = zones_within(folder / "zones.fgb", (-180, -90, 180, 90))
    with (folder / "zones.csv").open(encoding="utf-8") as file:
        rows += csv.DictReader(file)
    assert {row["vertical_datum"] for row in rows} == {datum}
    marks = (folder / "zones.kml").read_text("utf-8").split("<Placemark>")[1:]
    assert all(datum in html.unescape(mark) and ">clampToGround<" in mark for mark in marks)
    for path in folder.glob("*.tif"):
        with rasterio.open(path) as file:
            assert file.tags()["VERTICAL_DATUM"] == datum


def test_flatgeobuf_geojson_and_table_say_the_same(out: tuple[Path, dict[str, Any]]) -> None:
    folder, told = out
    features = json.loads((folder / "zones.geojson").read_text("utf-8"))["features"]
    rows, outlines = zones_within(folder / "zones.fgb", (-180, -90, 180, 90))
    with (folder / "zones.csv").open(encoding="utf-8") as file:
        table = {int(row["id"]): row for row in csv.DictReader(file)}
    assert len(rows) == len(features) == len(table) == len(told["zones"]) >= 2
    theirs = {
        row["id"]: (row, shapely.from_wkb(outline)) for row, outline in zip(rows, outlines, strict=True)
    }
    for feature in features:
        row, outline = theirs[feature["id"]]
        assert outline.equals(shape(feature["geometry"]))
        for name, value in row.items():
            assert value == feature["properties"][name]
            assert table[row["id"]][name] == ("" if value is None else str(value))


def test_one_number_names_a_zone_in_every_output_and_is_its_rank(out: tuple[Path, dict[str, Any]]) -> None:
    folder, told = out
    ranks = list(range(1, len(told["zones"]) + 1))
    features = json.loads((folder / "zones.geojson").read_text("utf-8"))["features"]
    with (folder / "zones.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    for zones in (told["zones"], [feature["properties"] for feature in features], table):
        assert [(int(zone["id"]), int(zone["rank"])) for zone in zones] == [(k, k) for k in ranks]
    assert [feature["id"] for feature in features] == ranks
    assert [zone["id"] for zone in survey_of(folder / "map.html")["zones"]] == ranks
    kml = (folder / "zones.kml").read_text("utf-8")
    names = [name for k in ranks for name in (f"Zone {k}", f"Zone {k}", f"Landing point {k}")]
    assert re.findall("<name>(.*? [0-9]+)</name>", kml) == names
    named = [re.findall("zone ([0-9]+)", zone["why"]) for zone in told["zones"]]
    assert any(named)
    assert all(ids in ([], [str(k)]) for k, ids in enumerate(named))
    for feature, zone in zip(features, told["zones"], strict=True):
        assert shape(feature["geometry"]).contains(shapely.Point(zone["lon"], zone["lat"]))
        assert nearest(folder, zone["lat"], zone["lon"])["zones"][0]["id"] == zone["id"]


def place(data: dict[str, Any], right: float, down: float) -> np.ndarray:
    """Return longitude and latitude between the corners of the page's picture."""
    corners = np.array(data["corners"]).reshape(2, 2, 2)
    return np.array([1 - down, down]) @ (np.array([1 - right, right]) @ corners)


def survey_of(page: Path) -> dict[str, Any]:
    """Return what a page says of its survey."""
    found = re.search(r'<script id="survey"[^>]*>(.*?)</script>', page.read_text("utf-8"), re.DOTALL)
    assert found is not None
    return dict(json.loads(found[1]))


def test_the_page_needs_no_network_and_holds_every_zone(out: tuple[Path, dict[str, Any]]) -> None:
    folder, told = out
    page = (folder / "map.html").read_text("utf-8")
    assert not re.search(r"""(src|href)\s*=\s*["']?\s*(https?:)?//|@import|fetch\(|XMLHttpRequest""", page)
    assert "__" not in re.sub(r"base64,[^\"]*", "", page)
    data = survey_of(folder / "map.html")
    assert [zone["id"] for zone in data["zones"]] == [zone["id"] for zone in told["zones"]]
    for zone, row in zip(data["zones"], told["zones"], strict=True):
        area = sum(
            0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
            for x, y in (np.array(ring).reshape(-1, 2).T for ring in zone["rings"])
        )
        assert area == pytest.approx(row["area_m2"], rel=0.03)  # holes run the other way
        east, north = zone["at"]
        lon, lat = place(data, east / data["width"], 1 - north / data["height"])
        assert GEOD.inv(lon, lat, row["lon"], row["lat"])[2] < 0.1
    png = re.search(r"base64,([^\"]*)", page)
    assert png is not None
    picture = matplotlib.image.imread(io.BytesIO(base64.b64decode(png[1])))
    assert picture.shape[:2] == (told["cells"]["rows"], told["cells"]["cols"])


NUMBERED = "document.querySelector('#more div').getBoundingClientRect().top"
SIZES = ((1440, 860, False), (320, 640, True), (390, 844, True), (844, 390, True))
FITTED = """Math.abs(
    1.05 * view.k - Math.min(canvas.clientWidth / S.width, canvas.clientHeight / S.height)) < 1e-9"""
CONTROLS = """[...document.querySelectorAll('#map > :not(canvas)')]
    .map(e => e.getBoundingClientRect()).map(b => [b.left, b.top, b.right, b.bottom])"""
DRAWN = "canvas.width === canvas.clientWidth * devicePixelRatio && innerWidth === {}"


def test_the_page_fits_its_window_and_opens_the_zone_whose_mark_is_tapped(
    out: tuple[Path, dict[str, Any]], tmp_path: Path, chromium: Path
) -> None:
    folder, _ = out
    with Chromium(chromium) as browser:
        browser.open((folder / "map.html").as_uri())
        browser.until("labels.length > 3")
        for width, height, phone in SIZES:
            browser.size(width, height, phone=phone)
            browser.until(DRAWN.format(width))
            assert browser.script(FITTED)
            assert browser.script("innerWidth >= document.body.scrollWidth")
            assert browser.script("(e => e.clientWidth >= e.scrollWidth)(document.getElementById('list'))")
            marks = browser.script("labels.map(l => [l.z.id, l.box])")
            boxes = shapely.box(*np.transpose([*(box for _, box in marks), *browser.script(CONTROLS)]))
            assert shapely.union_all(boxes).area == pytest.approx(shapely.area(boxes).sum())
            for zone, (west, north, _, _) in marks:
                browser.click(west + 1, north + 1)  # beside a narrow zone
                assert browser.script("chosen.id") == zone
            assert browser.script(f"0 <= {NUMBERED} && {NUMBERED} < innerHeight")
        assert browser.script("document.querySelector('#more div').textContent") == f"zone{zone}"
        browser.script("choose(S.zones[5], false)")
        assert "behind zone 5" in browser.script("document.getElementById('more').innerText")
        browser.click_on("#in")
        scale = browser.script("view.k")
        browser.size(800, 700)
        browser.until(DRAWN.format(800))
        assert browser.script("view.k") == scale  # what the user looks at stays
        steep = field() + field()[:, :1] * (0, 0, np.tan(np.radians(25)))
        path = write(tmp_path / "a.laz", placed(steep, "EPSG:32610"))
        reason = survey.run([path], tmp_path, parameters(), lambda *_: None)["no_zone"]
        browser.open((tmp_path / "map.html").as_uri())
        browser.until("document.body.innerText.includes('100% of what is unsafe is steeper than 10 degrees')")
        shown = browser.script("document.body.innerText")
        assert f"No zone: {reason}." in shown
        assert all(kind in shown for kind in ("unsafe: steep", "unknown: too few returns", "may be water"))
        assert browser.errors == []


def test_outlines_of_too_many_corners_are_thinned_on_the_page_and_stay_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    xyz = points(60_000)
    path = write(tmp_path / "a.laz", xyz)
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])
    survey.run([path], tmp_path / "all", parameters(), lambda *_: None)
    every = survey_of(tmp_path / "all" / "map.html")["zones"]
    corners = sum(len(ring) // 2 for zone in every for ring in zone["rings"])
    monkeypatch.setattr("companion.desk.survey.survey_page.MOST_CORNERS", corners // 4)
    survey.run([path], tmp_path / "few", parameters(), lambda *_: None)
    few = survey_of(tmp_path / "few" / "map.html")["zones"]
    assert sum(len(ring) // 2 for zone in few for ring in zone["rings"]) < corners / 2
    for whole, thin in zip(every, few, strict=True):
        outer, thinned = (shapely.Polygon(np.reshape(zone["rings"][0], (-1, 2))) for zone in (whole, thin))
        assert thinned.area == pytest.approx(outer.area, rel=0.1)
        assert thinned.bounds == pytest.approx(outer.bounds, abs=2.5)
    rows = [(tmp_path / name / "zones.geojson").read_bytes() for name in ("all", "few")]
    assert rows[0] == rows[1]  # the files hold all corners


def test_a_page_across_the_date_line_has_corners_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])
    xyz = field() + np.array([180_206.0 - 30, 8_140_143 - 20, 0])
    survey.run([write(tmp_path / "a.laz", xyz, "EPSG:32701")], tmp_path, parameters(), lambda *_: None)
    lon = np.array(survey_of(tmp_path / "map.html")["corners"])[:, 0]
    assert lon == pytest.approx(180.0, abs=1e-3)
    assert lon.min() < 180 < lon.max()


def test_the_nearest_zones_are_those_that_trying_all_finds(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    rows, shapes = [], []
    for number in range(1, 401):
        lon, lat = LON + rng.normal(0, 0.05), LAT + rng.normal(0, 0.04)
        ring = shapely.Point(lon, lat).buffer(rng.uniform(1e-4, 1e-3), 4)
        rows.append({"id": number, "rank": number, "lat": lat, "lon": lon, "why": "", "obstacles": 0}
            | {"boundary_points": 50, "corner_points": 9, "slope_deg": None, "area_m2": 9.0, "certainty": 1.0}
            | dict.fromkeys(("roughness", "square_side_m", "elevation_m"), 1.0)
            | dict.fromkeys(("point_certainty", "point_slope_deg", "clearance_m"), 1.0)
            | dict.fromkeys(("surface_probability", "water", "raised_m"), 1.0)
            | {"surface": "bare ground", "headings": "any", "blocked_by": "", "areas": ""})  # fmt: skip
        shapes.append(shapely.MultiPolygon([ring]))
    write_flatgeobuf(tmp_path / "zones.fgb", shapes, rows)
    for _ in range(5):
        lon, lat = LON + rng.normal(0, 0.06), LAT + rng.normal(0, 0.05)
        away = {row["id"]: GEOD.inv(lon, lat, row["lon"], row["lat"])[2] for row in rows}
        around = {k: shapes[k - 1].contains(shapely.Point(lon, lat)) for k in away}
        order = sorted(away, key=lambda k: (not around[k], away[k]))
        assert [zone["id"] for zone in nearest(tmp_path, lat, lon)["zones"]] == order[:10]
        inside = nearest(tmp_path, lat, lon, 3000, 1000)["zones"]
        assert [zone["id"] for zone in inside] == [k for k in order if away[k] <= 3000]
        for zone in inside:
            assert zone["distance_m"] == pytest.approx(away[zone["id"]], abs=0.01)
            held = shapes[zone["id"] - 1].contains(shapely.Point(lon, lat))
            assert zone["holds"] == held
            assert zone["slope_deg"] is None
    assert nearest(tmp_path, -LAT, LON, 1000)["zones"] == []


def test_a_zone_that_holds_the_place_comes_first_however_far_its_landing_point_is(
    out: tuple[Path, dict[str, Any]],
) -> None:
    folder, told = out
    zones = {row["id"]: row for row in told["zones"]}
    features = json.loads((folder / "zones.geojson").read_text("utf-8"))["features"]
    for feature in features:
        row, outline = zones[feature["id"]], shape(feature["geometry"])
        lon, lat = max(
            (
                np.array(
                    outline.exterior.coords
                    if outline.geom_type == "Polygon"
                    else outline.geoms[0].exterior.coords
                )
            ).tolist(),
            key=lambda at: math.hypot(at[0] - row["lon"], at[1] - row["lat"]),
        )
        inside = shapely.Point(lon, lat).buffer(2e-5).intersection(outline).representative_point()
        first = nearest(folder, inside.y, inside.x, 1.0)["zones"][0]
        assert (first["id"], first["holds"]) == (row["id"], True)
        assert first["distance_m"] > 1


@pytest.mark.parametrize("size", [0, 500, 1500])
def test_a_damaged_index_is_one_line(out: tuple[Path, dict[str, Any]], tmp_path: Path, size: int) -> None:
    folder, told = out
    (tmp_path / "zones.fgb").write_bytes((folder / "zones.fgb").read_bytes()[:size])
    best = told["zones"][0]
    with pytest.raises(UsageError, match="it is damaged") as caught:
        nearest(tmp_path, best["lat"], best["lon"])
    assert "\n" not in str(caught.value)


def test_a_disk_that_fills_up_while_a_map_is_packed_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise CPLE_AppDefinedError(3, 1, "TIFFAppendToStrip:Write error at scanline 0")

    monkeypatch.setattr("rasterio.shutil.copy", full)
    path = write(tmp_path / "a.laz", points(20_000))
    with pytest.raises(UsageError, match="cannot be written: TIFFAppendToStrip"):
        survey.run([path], tmp_path / "out", parameters(), lambda *_: None)
    assert not (tmp_path / "out").exists()


def test_the_command_takes_western_longitudes(
    out: tuple[Path, dict[str, Any]], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    folder, told = out
    best = told["zones"][0]
    words = [str(best["lat"]), str(best["lon"]), "--survey", str(folder), "--json"]
    monkeypatch.setattr(sys, "argv", ["slz", "nearest", *words])
    with pytest.raises(SystemExit) as ended:
        program.main()
    assert ended.value.code == 0
    zone = json.loads(capfd.readouterr().out)["zones"][0]
    assert zone["id"] == best["id"]
    assert zone["distance_m"] < 0.01
    assert zone["holds"]


@pytest.mark.parametrize(
    ("lat", "lon", "radius_m", "said"),
    [
        (91, 0, None, "no position"),
        (0, 0, -1, "--radius-m"),
        (0, math.nan, None, "no position"),
        (0, 0, 1, "no zones.fgb"),
    ],
)
def test_a_question_that_cannot_be_answered_is_one_line(
    tmp_path: Path, lat: float, lon: float, radius_m: float | None, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        nearest(tmp_path, lat, lon, radius_m)


@pytest.mark.parametrize("most", [0, -3])
def test_no_zone_at_all_is_nothing_to_ask_for(tmp_path: Path, most: int) -> None:
    with pytest.raises(UsageError, match=f"--most {most}: one at least"):
        nearest(tmp_path, LAT, LON, most=most)
