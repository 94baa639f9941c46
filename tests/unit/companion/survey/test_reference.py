"""Units come from the CRS, never from a guess."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from pyproj import CRS

from companion.errors import UsageError
from companion.survey.reference import from_option, of_header, unit_name

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
    with pytest.raises(UsageError, match=r"0\.304801 m.*1 m.*--crs"):
        of_header(header(CRS("EPSG:32610"), k3072=32610, k3076=9003), tmp_path)


def test_user_defined_keys_ask_for_the_option(tmp_path: Any) -> None:
    with pytest.raises(UsageError, match=r"user-defined.*--crs"):
        of_header(header(None, k3072=32767), tmp_path)


def test_names_of_units_are_those_of_gdal() -> None:
    assert [unit_name(v) for v in (1.0, FOOT, SURVEY_FOOT)] == ["m", "ft", "US survey foot"]
    assert unit_name(0.9143984146) == "0.914398415 m"


def test_a_crs_that_no_library_can_read_is_one_line(tmp_path: Any) -> None:
    def fail(prefer_wkt: bool) -> None:
        raise RuntimeError("unexpected\nend of WKT")

    unreadable = header(None)
    unreadable.parse_crs = fail
    with pytest.raises(
        UsageError, match=r"its CRS cannot be read \(unexpected end of WKT\): name it by --crs"
    ):
        of_header(unreadable, tmp_path)
