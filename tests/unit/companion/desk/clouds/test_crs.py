"""Units from the CRS, never from a guess."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from pyproj import CRS

from companion.desk.clouds.crs import from_option, of_header
from companion.desk.clouds.unit_statements import unit_name
from companion.runtime.errors import UsageError

FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937


@pytest.mark.parametrize(
    ("text", "unit_m", "vertical_m", "source"),
    [
        ("EPSG:32610", 1.0, 1.0, "horizontal unit"),
        ("EPSG:2992", FOOT, FOOT, "horizontal unit"),
        ("EPSG:2225", SURVEY_FOOT, SURVEY_FOOT, "horizontal unit"),
        ("EPSG:2992+5703", FOOT, 1.0, "crs"),
        ("EPSG:32610+6360", 1.0, SURVEY_FOOT, "crs"),
        ("EPSG:32610+8228", 1.0, FOOT, "crs"),
        ("EPSG:4326", None, 1.0, "metre"),
        ("EPSG:4979", None, 1.0, "crs"),
        ("EPSG:31467", 1.0, 1.0, "horizontal unit"),  # its axes are listed north first
    ],
)
def test_units_of_a_crs(text: str, unit_m: float | None, vertical_m: float, source: str) -> None:
    reference = from_option(text)
    assert reference.unit_m == (None if unit_m is None else pytest.approx(unit_m, rel=1e-12))
    assert reference.vertical_m == pytest.approx(vertical_m, rel=1e-12)
    assert reference.vertical_from == source


@pytest.mark.parametrize("vertical", ["", " +vunits=us-ft"])
def test_a_crs_bound_to_a_shift_has_the_units_of_the_one_within(vertical: str) -> None:
    text = "+proj=utm +zone=32 +ellps=intl +towgs84=-87,-98,-121 +units=ft +type=crs"
    reference = from_option(text + vertical)
    assert reference.unit_m == FOOT
    assert not reference.horizontal.is_bound
    assert reference.vertical_m == pytest.approx(SURVEY_FOOT if vertical else FOOT, rel=1e-12)
    assert reference.vertical_from == ("crs" if vertical else "horizontal unit")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("EPSG:4978", "projected or geographic"),
        ("EPSG:5703", "projected or geographic"),
        ("EPSG:2053", "south and west"),
        ("EPSG:32610+5715", "do not count upwards"),
        ("feet", "EPSG:2992"),
    ],
)
def test_a_crs_that_maps_no_ground_is_refused(text: str, word: str) -> None:
    with pytest.raises(UsageError, match=word):
        from_option(text)


def header(crs: CRS | None, **keys: int) -> Any:
    """Return what a LAS header gives: a parsed CRS and GeoTIFF keys."""
    entries = [SimpleNamespace(id=int(k[1:]), value_offset=v, tiff_tag_location=0) for k, v in keys.items()]
    record = SimpleNamespace(record_id=34735, geo_keys=entries)
    return SimpleNamespace(vlrs=[record], evlrs=None, parse_crs=lambda prefer_wkt: crs)


def test_geotiff_keys_name_the_vertical_unit(tmp_path: Any) -> None:
    reference = of_header(header(CRS("EPSG:32610"), k3072=32610, k4099=9003), tmp_path)
    assert reference.vertical_m == SURVEY_FOOT
    assert reference.vertical_from == "geokeys"


def test_geotiff_keys_name_the_vertical_crs(tmp_path: Any) -> None:
    reference = of_header(header(CRS("EPSG:2992"), k3072=2992, k4096=5703), tmp_path)
    assert reference.vertical_m == 1.0
    assert reference.name == "EPSG:2992+5703"


def test_a_file_that_states_two_units_is_refused(tmp_path: Any) -> None:
    with pytest.raises(UsageError, match=r"is m by .*UTM zone 10N.*US survey foot by .*9003: .*--crs"):
        of_header(header(CRS("EPSG:32610"), k3072=32610, k3076=9003), tmp_path)


def test_user_defined_keys_ask_for_the_option(tmp_path: Any) -> None:
    with pytest.raises(UsageError, match=r"user-defined.*--crs"):
        of_header(header(None, k3072=32767), tmp_path)


def test_names_of_units_are_those_of_gdal() -> None:
    assert [unit_name(v) for v in (1.0, FOOT, SURVEY_FOOT)] == ["m", "ft", "US survey foot"]
    assert unit_name(0.9143984146) == "0.914398415 m"
    assert [unit_name(v) for v in (math.radians(1), math.radians(0.9))] == ["degree", "grad"]


def test_a_crs_that_no_library_can_read_is_one_line(tmp_path: Any) -> None:
    def fail(prefer_wkt: bool) -> None:
        raise RuntimeError("unexpected\nend of WKT")

    unreadable = header(None)
    unreadable.parse_crs = fail
    with pytest.raises(
        UsageError, match=r"its CRS cannot be read \(unexpected end of WKT\): name it by --crs"
    ):
        of_header(unreadable, tmp_path)


NAVD_M, NAVD_FT = 5703, 6360


def wkt_header(text: str, **keys: int) -> Any:
    """Return a header with a CRS as WKT beside GeoTIFF keys."""
    crs = CRS.from_wkt(text)
    found = header(crs, **keys)
    found.vlrs.append(SimpleNamespace(record_id=2112, string=text))
    return found


def wkt(code: str) -> str:
    return str(CRS.from_user_input(code).to_wkt("WKT1_GDAL"))


FEET_BY_NAME = wkt("EPSG:26915+6360")
METRES_IN_FEET_CODE = FEET_BY_NAME.replace('UNIT["US survey foot",0.304800609601219', 'UNIT["metre",1')
UTM = CRS("EPSG:26915")
CONTRADICTIONS = {
    "code us-ft, key m": (header(UTM, k3072=26915, k4096=6360, k4099=9001), ("6360", "9001")),
    "code m, key ft": (header(UTM, k3072=26915, k4096=5703, k4099=9002), ("5703", "9002")),
    "wkt us-ft, key m": (wkt_header(FEET_BY_NAME, k3072=26915, k4099=9001), ("ftUS", "9001")),
    "wkt us-ft, code m": (wkt_header(FEET_BY_NAME, k3072=26915, k4096=5703), ("ftUS", "5703")),
    "wkt m, its own code us-ft": (wkt_header(METRES_IN_FEET_CODE), ("ftUS", "EPSG:6360")),
    "three-dimensional m, key ft": (wkt_header(CRS(4979).to_wkt(), k4099=9002), ("WGS 84", "9002")),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_heights_of_two_units_are_refused_naming_both(tmp_path: Any, name: str) -> None:
    file, (one, other) = CONTRADICTIONS[name]
    with pytest.raises(UsageError, match="unit of heights") as caught:
        of_header(file, tmp_path)
    said = str(caught.value)
    assert one in said
    assert other in said
    assert said.endswith("name the unit of heights by --vertical-unit")
    settled = of_header(file, tmp_path, vertical_unit="us-ft")
    assert (settled.vertical_m, settled.vertical_from) == (SURVEY_FOOT, "option")
    vertical = settled.vertical
    assert vertical is None or vertical.axis_info[0].unit_conversion_factor == pytest.approx(SURVEY_FOOT)


@pytest.mark.parametrize(
    ("file", "one", "other"),
    [
        (wkt_header(wkt("EPSG:26915+5703"), k3072=26915, k4096=5714), "North American", "5714"),
        (header(UTM, k3072=26915, k4096=5703, k4098=5102), "North American", "5102"),
        (header(UTM, k3072=26915, k4096=5103, k4098=5102), "North American", "5102"),
        (wkt_header(wkt("EPSG:26915+5703"), k3072=26915, k4096=5030), "North American", "an ellipsoid"),
        (wkt_header(wkt("EPSG:26915"), k3072=32615), "North American Datum 1983", "32615"),
        (wkt_header(wkt("EPSG:26915"), k3072=26914), "zone 15N", "26914"),
        (header(UTM, k3072=26915, k2048=4326), "North American Datum 1983", "4326"),
        (header(UTM, k3072=26915, k2050=6326), "North American Datum 1983", "6326"),
        (wkt_header(wkt("EPSG:4269"), k2048=4326), "North American Datum 1983", "4326"),
        (wkt_header(wkt("EPSG:4269"), k2048=4269, k2054=9105), "NAD83", "9105"),
    ],
)
def test_two_datums_or_projections_are_refused_naming_both(
    tmp_path: Any, file: Any, one: str, other: str
) -> None:
    with pytest.raises(UsageError, match="--crs") as caught:
        of_header(file, tmp_path)
    assert one in str(caught.value)
    assert other in str(caught.value)
    settled = of_header(file, tmp_path, from_option("EPSG:26915+5703"))
    assert settled.name == "EPSG:26915+5703"


def test_what_agrees_is_no_contradiction(tmp_path: Any) -> None:
    esri = CRS("EPSG:26915").to_wkt("WKT1_ESRI")
    file = wkt_header(
        esri, k3072=26915, k2048=4269, k2050=6269, k3076=9001, k4096=6360, k4098=5103, k4099=9003
    )
    reference = of_header(file, tmp_path)
    assert reference.vertical_m == pytest.approx(SURVEY_FOOT, rel=1e-12)
    assert reference.vertical is not None
    assert reference.vertical.to_epsg() == 6360
    rounded = wkt("EPSG:2225").replace("0.304800609601219", "0.3048006")
    assert of_header(wkt_header(rounded, k3072=2225, k3076=9003), tmp_path).unit_m == 0.3048006


@pytest.mark.parametrize(
    ("code", "unit", "metres", "vertical"),
    [
        (5103, 9001, 1.0, 5703),
        (5103, 9002, FOOT, 8228),
        (5103, 9003, SURVEY_FOOT, 6360),
        (5103, None, 1.0, 5703),
        (5102, 9001, 1.0, 7968),
        (5102, 9003, SURVEY_FOOT, 5702),
        (5101, 9001, 1.0, 5701),
        (5104, 9001, 1.0, 5736),
        (5105, 9001, 1.0, 5705),
        (5106, 9001, 1.0, 5611),
        (5030, 9002, FOOT, None),
        (5019, None, 1.0, None),
    ],
)
def test_vertical_codes_of_the_first_geotiff_are_read(
    tmp_path: Any, code: int, unit: int | None, metres: float, vertical: int | None
) -> None:
    keys = {"k3072": 26915, "k4096": code} | ({} if unit is None else {"k4099": unit})
    reference = of_header(header(UTM, **keys), tmp_path)
    assert reference.vertical_m == pytest.approx(metres, rel=1e-12)
    found = reference.vertical
    assert (None if found is None else found.datum) == (None if vertical is None else CRS(vertical).datum)
    assert found is None or found.axis_info[0].unit_conversion_factor == pytest.approx(metres)


def test_a_datum_without_a_unit_is_asked_for_where_x_and_y_are_feet(tmp_path: Any) -> None:
    file = header(CRS("EPSG:2992"), k3072=2992, k4096=5103)
    with pytest.raises(UsageError, match=r"North American Vertical Datum 1988.*--vertical-unit"):
        of_header(file, tmp_path)
    assert of_header(file, tmp_path, vertical_unit="m").vertical_m == 1.0


@pytest.mark.parametrize(("keys", "says"), [({"k4096": 9999}, "9999"), ({"k4099": 32767}, "32767")])
def test_an_unknown_code_of_heights_asks_for_their_unit(
    tmp_path: Any, keys: dict[str, int], says: str
) -> None:
    with pytest.raises(UsageError, match=f"{says}.*--vertical-unit"):
        of_header(header(UTM, k3072=26915, **keys), tmp_path)
    assert of_header(header(UTM, k3072=26915, **keys), tmp_path, vertical_unit="ft").vertical_m == FOOT


def test_a_horizontal_option_leaves_the_heights_to_the_file(tmp_path: Any) -> None:
    """EPSG:2225 is in feet; the file says that its heights are metres."""
    file = header(UTM, k3072=26915, k4096=5703)
    reference = of_header(file, tmp_path, from_option("EPSG:2225"))
    assert (reference.name, reference.vertical_m) == ("EPSG:2225+5703", 1.0)
    contradicting, _ = CONTRADICTIONS["code us-ft, key m"]
    with pytest.raises(UsageError, match="--vertical-unit"):
        of_header(contradicting, tmp_path, from_option("EPSG:26915"))


def test_vertical_code_counts_beside_a_crs_without_a_code(tmp_path: Any) -> None:
    text = CRS.from_proj4("+proj=tmerc +lon_0=-93 +ellps=GRS80 +units=us-ft").to_wkt("WKT1_GDAL")
    assert of_header(wkt_header(text, k4096=5703), tmp_path).vertical_m == 1.0


def test_the_unit_of_heights_by_option() -> None:
    reference = from_option("EPSG:2992", "m")
    assert (reference.unit_m, reference.vertical_m, reference.vertical_from) == (FOOT, 1.0, "option")
    assert from_option("EPSG:32610+6360", "us-ft").vertical_m == SURVEY_FOOT
    with pytest.raises(UsageError, match="US survey foot .* but m by --vertical-unit: leave one of them out"):
        from_option("EPSG:32610+6360", "m")
    with pytest.raises(UsageError, match="--vertical-unit 'yd': write m, ft, us-ft"):
        from_option("EPSG:32610", "yd")


def test_a_key_of_ellipsoidal_heights_makes_the_crs_three_dimensional(tmp_path: Any) -> None:
    for crs, keys in (
        (CRS(4326), {"k2048": 4326, "k4096": 4979}),
        (CRS(32633), {"k3072": 32633, "k4096": 4979}),
        (CRS(32633), {"k3072": 32633, "k4096": 5030, "k4099": 9001}),
    ):
        reference = of_header(header(crs, **keys), tmp_path)
        assert len(reference.crs.axis_info) == 3
        assert reference.vertical is None
        assert reference.vertical_m == 1.0
        assert reference.horizontal.equals(crs)
    reference = of_header(header(CRS(32633), k3072=32633, k4096=5030, k4099=9002), tmp_path)
    assert len(reference.crs.axis_info) == 2  # PROJ has no such axis in feet
    assert reference.vertical_m == FOOT


@pytest.mark.parametrize(("crs", "key"), [(CRS(4979), 4979), (CRS(4326), 4326)])
def test_a_key_of_geocentric_coordinates_is_refused_by_name(tmp_path: Any, crs: CRS, key: int) -> None:
    with pytest.raises(UsageError, match="geocentric, not x east and y north: reproject it"):
        of_header(header(crs, k1024=3, k2048=key), tmp_path)


def test_three_dimensional_codes_give_their_horizontal_part(tmp_path: Any) -> None:
    for code in (4979, 9518, 5972):
        reference = of_header(header(CRS(code), k1024=2), tmp_path)
        assert len(reference.horizontal.axis_info) == 2
        assert reference.vertical_from == "crs"
        assert reference.name == f"EPSG:{code}"
