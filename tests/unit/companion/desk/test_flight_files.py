"""Page and GeoJSON of a demonstration flight."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from companion.desk.clouds.cloud import GeoreferencedCloud
from companion.desk.clouds.crs import from_option
from companion.desk.demo import flight_files
from companion.desk.demo.flight_files import FlownMap, Moment, Said, Timeline
from companion.desk.survey.cloud_survey import survey
from params import load
from tests.unit.companion.desk.survey.clouds import field, placed
from tests.unit.companion.desk.test_demonstration import SAFE


@pytest.fixture(scope="module")
def flown() -> FlownMap:
    points = placed(field(), "EPSG:32610")
    cloud = GeoreferencedCloud(points, None, from_option("EPSG:32610"), len(points), {})
    found = survey(cloud, load("quadcopter", ["cell_m=0.5"]))
    best = found.maps.frame.lla(found.report.zones[0].best.enu_m)
    lat, lon, alt = (float(v) for v in best)
    log = Timeline(
        [
            Moment(0.0, "idle", None, None),
            *(Moment(k, "descend", 9.0 - k, (lat, lon, alt)) for k in (1.0, 2.0)),
        ],
        [Said(2.0, 4, "SLZ: </script><b>landed")],
    )
    contact = {"lat": lat, "lon": lon, "alt": alt}
    told = {"lat": lat, "lon": lon, "alt_m": alt, "zone": found.report.zones[0].id}
    marks = flight_files.points({"chosen": told, "touchdown": told}, contact)
    return FlownMap(found.maps, found.report, found.parameters, log, marks)


def test_a_flight_leaves_a_page_that_loads_nothing_and_a_geojson(flown: FlownMap, tmp_path: Path) -> None:
    zone = flown.report.zones[0].id
    summary = SAFE | {"chosen": {"zone": zone}}
    files = flight_files.write(tmp_path, flown, summary)
    assert set(files) == {"page", "geojson"}  # nothing was recorded
    page = Path(files["page"]).read_text("utf-8")
    assert not re.search(r"(src|href)=|https?:|@import|url\(", page)
    shown = json.loads(re.findall(r'<script id="flight"[^>]*>(.*?)</script>', page)[0])
    assert (shown["verdict"], shown["landed_in"]) == ("landed on safe ground", zone)
    assert [one["id"] for one in shown["zones"]] == [one.id for one in flown.report.zones]
    assert shown["points"]["chosen point"] == pytest.approx(shown["zones"][0]["at"], abs=0.02)
    assert shown["texts"] == [[2.0, 4, "SLZ: </script><b>landed"]]
    assert [moment[1] for moment in shown["moments"]] == ["idle", "descend", "descend"]
    features = json.loads(Path(files["geojson"]).read_text("utf-8"))["features"]
    kinds = [one["properties"]["kind"] for one in features]
    marks = ["chosen point", "touchdown, estimated", "touchdown, true"]
    of_both_maps = len(flown.report.near.zones) + len(flown.report.far.zones)
    assert kinds == ["zone"] * of_both_maps + ["flown path", *marks]
    lon, lat, _ = features[-1]["geometry"]["coordinates"]
    assert flown.maps.frame.enu_m(lat, lon, 0.0)[:2] == pytest.approx(
        flown.report.zones[0].best.enu_m[:2], abs=0.1
    )


def test_files_of_an_earlier_flight_are_removed_and_without_a_map_there_are_none(tmp_path: Path) -> None:
    for name in ("flight.html", "flight.geojson", "flight.mcap", "mine.txt"):
        (tmp_path / name).write_text("old")
    flight_files.remove(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    assert flight_files.write(tmp_path, None, SAFE) == {}
