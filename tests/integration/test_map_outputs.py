"""`slz map`: KML, classified points and the GeoTIFF layout, as their readers see them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import laspy
import numpy as np
import pytest
import rasterio
from pyproj import CRS
from rasterio.enums import ColorInterp

from companion.desk import survey
from companion.desk.survey.kml import NAMESPACE
from params import load
from tests.unit.companion.desk.survey import packing
from tests.unit.companion.desk.survey.clouds import field, placed, write

UTM = "EPSG:32610"
POINTS = placed(field(), UTM)
SAFE, UNSAFE, UNKNOWN = 64, 65, 66


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures out: they take longer than all else."""
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])


def mapped(files: list[Path], out: Path, *settings: str, crs: str | None = None) -> dict[str, Any]:
    parameters = load("quadcopter", ["cell_m=0.5", *settings])
    return survey.run(files, out, parameters, lambda *_: None, survey.MapOptions(crs, classified=True))


def state_of(out: Path, points: np.ndarray) -> np.ndarray:
    """Return what safe.tif says where points lie; 255 outside."""
    with rasterio.open(out / "safe.tif") as file:
        found = [int(v[0]) for v in file.sample(points[:, :2], masked=False)]
    return np.array(found)


def check_classes(out: Path, name: str, points: np.ndarray) -> laspy.LasData:
    las = laspy.read(out / name)
    kinds = np.asarray(las.classification)
    wanted = np.choose(np.minimum(state_of(out, points), 2), [UNSAFE, SAFE, UNKNOWN])
    off_edges = (
        np.abs(points[:, :2] / 0.5 % 1 - 0.5).max(axis=1) < 0.49
    )  # the file's quantum may change cells
    assert (kinds[off_edges] == wanted[off_edges]).all()
    assert set(np.unique(kinds)) <= {SAFE, UNSAFE, UNKNOWN}
    assert (kinds == SAFE).mean() > 0.5
    return las


def test_classified_points_keep_scaled_dimensions(tmp_path: Path) -> None:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 1e-3), np.floor(POINTS.min(axis=0))
    header.add_crs(CRS(UTM))
    scale, offset, no_data = np.array([0.01]), np.array([-5.0]), np.array([-32768])
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams("Reflectance", np.int16, "dB", offset, scale, no_data),
            laspy.ExtraBytesParams("Normal", "3i2", "", np.zeros(3), np.full(3, 1e-4)),
        ]
    )
    las = laspy.LasData(header)
    las.x, las.y, las.z = POINTS.T
    raw = np.random.default_rng(4).integers(-32768, 32768, (len(POINTS), 4))
    las.points.array["Reflectance"], las.points.array["Normal"] = raw[:, 0], raw[:, 1:]
    las.write(tmp_path / "a.laz")
    mapped([tmp_path / "a.laz"], tmp_path / "out")
    new = laspy.read(tmp_path / "out" / "classified.laz")
    np.testing.assert_array_equal(new.points.array["Reflectance"], raw[:, 0])
    np.testing.assert_array_equal(new.points.array["Normal"], raw[:, 1:])
    np.testing.assert_allclose(new["Reflectance"], raw[:, 0] * 0.01 - 5)
    records = new.header.vlrs.get("ExtraBytesVlr")[0].extra_bytes_structs
    (kept,) = [one for one in records if one.format_name() == "Reflectance"]
    assert (kept.scale[0], kept.offset[0], kept.no_data[0]) == (0.01, -5, -32768)


def test_the_kml_holds_what_the_geojson_holds(tmp_path: Path) -> None:
    summary = mapped([write(tmp_path / "field.laz", POINTS)], tmp_path / "out")
    space = {"k": NAMESPACE}
    root = Xml.parse(tmp_path / "out" / "zones.kml").getroot()
    assert root.tag == f"{{{NAMESPACE}}}kml"
    styles = {style.get("id") for style in root.iterfind(".//k:Style", space)}
    colours = [element.text or "" for element in root.iterfind(".//k:color", space)]
    assert all(re.fullmatch("[0-9a-f]{8}", colour) for colour in colours)
    folders = root.findall(".//k:Folder", space)
    assert len(folders) == len(summary["zones"]) == 1
    for folder, row in zip(folders, summary["zones"], strict=True):
        zone, point = folder.findall("k:Placemark", space)
        assert (zone.findtext("k:styleUrl", "", space))[1:] in styles
        rings = zone.findall(".//k:outerBoundaryIs", space), zone.findall(".//k:innerBoundaryIs", space)
        assert [len(ring) for ring in rings] == [1, 1]  # the block is a hole
        for ring in (*rings[0], *rings[1]):
            places = [tuple(map(float, p.split(","))) for p in "".join(ring.itertext()).split()]
            assert places[0] == places[-1]
            assert all(abs(lon - row["lon"]) < 1e-3 and abs(lat - row["lat"]) < 1e-3 for lon, lat in places)
        lon, lat = map(float, "".join(point.findtext(".//k:coordinates", "", space)).split(","))
        assert (lon, lat) == (pytest.approx(row["lon"], abs=1e-8), pytest.approx(row["lat"], abs=1e-8))
        table = Xml.fromstring(point.findtext("k:description", "", space))
        told = {cells[0].text: cells[1].text for cells in table}
        assert told["area"] == f"{row['area_m2']} m²"


@pytest.mark.parametrize("form", [3, 6])
def test_classified_points_keep_all_but_their_class(tmp_path: Path, form: int) -> None:
    path = tmp_path / "field.laz"
    header = laspy.LasHeader(point_format=form, version="1.4")
    header.scales, header.offsets = np.array([0.01, 0.01, 0.001]), np.array([400_000.0, 4_000_000.0, 0])
    header.add_crs(CRS(UTM))
    header.add_extra_dim(laspy.ExtraBytesParams("height", np.float32))
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    las = laspy.LasData(header)
    las.x, las.y, las.z = POINTS.T
    las.intensity = np.arange(len(POINTS)) % 1000
    las.gps_time = np.linspace(1e8, 1e8 + 9, len(POINTS))
    las.classification = np.where(np.arange(len(POINTS)) == 7, 7, 2)
    las["height"] = POINTS[:, 2]
    if form < 6:
        las.scan_angle_rank = np.full(len(POINTS), -15)
    las.write(path)
    summary = mapped([path], tmp_path / "out")
    assert str(tmp_path / "out" / "classified.laz") in summary["outputs"]
    new = check_classes(tmp_path / "out", "classified.laz", np.asarray(laspy.read(path).xyz))
    for axis in ("X", "Y", "Z", "intensity", "gps_time", "height"):
        np.testing.assert_array_equal(new[axis], las[axis])
    assert list(new.header.scales) == [0.01, 0.01, 0.001]
    assert list(new.header.offsets) == [400_000, 4_000_000, 0]
    assert new.header.parse_crs().equals(CRS(UTM), ignore_axis_order=True)
    assert new.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD
    assert new.header.point_format.id == {1: 6, 3: 7}.get(form, form)
    np.testing.assert_array_equal(new["source_class"], las.classification)
    if form < 6:
        assert (np.asarray(new.scan_angle) == -2500).all()


def test_points_of_other_kinds_get_classes_too(tmp_path: Path) -> None:
    feet = placed(field(), "EPSG:2992", 0.3048)
    holed = feet.copy()
    holed[5] = np.nan
    holed[9, :2] = -1e12  # far astray, and more than LAS can hold
    pcd, xyz = tmp_path / "a.pcd", tmp_path / "b.xyz"
    pcd.write_bytes(packing.pcd(holed, "binary_compressed"))
    xyz.write_bytes(packing.text(feet[:50] + np.array([0.5, 0.5, 0])))
    summary = mapped([pcd, xyz], tmp_path / "out", crs="EPSG:2992")
    assert summary["points"]["dropped"]["not_finite"] == 1
    las = laspy.read(tmp_path / "out" / "classified-1-a.laz")
    np.testing.assert_allclose(las.xyz, np.delete(feet, [5, 9], axis=0), atol=0.002)
    assert las.header.parse_crs().to_epsg() == 2992
    assert len(laspy.read(tmp_path / "out" / "classified-2-b.laz")) == 50
    assert (np.asarray(las.classification) == SAFE).mean() > 0.5


def test_the_rasters_are_cloud_optimized_and_keep_what_is_unknown(tmp_path: Path) -> None:
    wide = np.concatenate([POINTS, POINTS + np.array([240.0, 100, 0])])  # 600 cells, mostly unknown
    mapped([write(tmp_path / "wide.laz", wide)], tmp_path / "out")
    for name in ("dsm", "slope", "roughness", "safe"):
        with rasterio.open(tmp_path / "out" / f"{name}.tif") as file:
            assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
            assert file.driver == "GTiff"
            assert file.block_shapes == [(256, 256)]
            overviews = file.overviews(1)
            assert overviews[0] == 2
            whole = file.read(1)
            small = file.read(1, out_shape=tuple(math.ceil(side / 2) for side in whole.shape))
            if name == "safe":
                assert file.nodata == 255
                assert file.dtypes == ("uint8",)
                assert file.colorinterp == (ColorInterp.palette,)
                table = file.colormap(1)
                assert (table[0], table[1]) == ((215, 48, 31, 255), (27, 120, 55, 255))  # red, green
                assert table[255][3] == 0  # unknown is transparent
                assert set(np.unique(small)) == set(np.unique(whole)) == {0, 1, 255}
            else:
                assert math.isnan(file.nodata)
                assert np.isnan(small).mean() == pytest.approx(np.isnan(whole).mean(), abs=0.02)
                assert np.nanmax(small) <= np.nanmax(whole)
