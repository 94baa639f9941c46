"""`slz map`: files in; zones and maps out, readable for other programs and consistent."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import laspy
import numpy as np
import pytest
import rasterio
import rasterio.features
import shapely
from pyproj import CRS, Geod
from shapely.geometry import shape

from companion.cli import program
from companion.desk import survey
from companion.runtime.errors import UsageError
from params import load
from tests import REPOSITORY
from tests.unit.companion.desk.survey.clouds import LAT, LON, field, placed, write

AUTZEN = Path(os.environ.get("SLZ_DATA", REPOSITORY.parent / "shared/data")) / "autzen_trim.laz"
needs_autzen = pytest.mark.skipif(not AUTZEN.exists(), reason=f"{AUTZEN} is absent: set SLZ_DATA")
RASTERS = ("dsm", "slope", "roughness", "safe")


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures out: they take longer than all else."""
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])


def quiet(what: str, share: float) -> None:
    assert 0.0 <= share <= 1.0


def mapped(files: list[Path], out: Path, *settings: str, crs: str | None = None) -> dict[str, Any]:
    parameters = load("quadcopter", ["cell_m=0.5", *settings])
    return survey.run(files, out, parameters, quiet, survey.MapOptions(crs))


def raster(path: Path) -> tuple[np.ndarray, Any]:
    """Return a raster's cells and what its header says."""
    with rasterio.open(path) as file:
        names = ("crs", "transform", "units", "descriptions", "dtypes", "nodata", "shape", "bounds")
        return file.read(1), SimpleNamespace(**{name: getattr(file, name) for name in names})


def check_agreement(out: Path, summary: dict[str, Any], crs: str | CRS) -> None:
    """Read every output back and compare them with each other and with the summary."""
    json.dumps(summary, allow_nan=False)
    assert all(Path(path).exists() for path in summary["outputs"])
    layers = {name: raster(out / f"{name}.tif") for name in RASTERS}
    safe, file = layers["safe"]
    for values, other in layers.values():
        assert CRS(other.crs.to_wkt()).equals(CRS(crs), ignore_axis_order=True)
        assert other.transform == file.transform
        assert other.transform.e < 0 < other.transform.a  # north up
        assert values.shape == safe.shape
    assert safe.dtype == np.uint8
    assert file.nodata == 255
    assert set(np.unique(safe)) <= {0, 1, 255}
    assert (safe == 1).sum() == summary["cells"]["safe"]
    for name in ("dsm", "slope", "roughness"):
        assert layers[name][1].dtypes == ("float32",)
        assert np.isnan(layers[name][1].nodata)
    assert np.isnan(layers["slope"][0][safe == 255]).all()

    collection = json.loads((out / "zones.geojson").read_text("utf-8"))
    assert [feature["properties"] for feature in collection["features"]] == summary["zones"]
    geod, every = Geod(ellps="WGS84"), np.zeros(safe.shape, bool)
    for feature in collection["features"]:
        polygon, row = shape(feature["geometry"]), feature["properties"]
        assert polygon.is_valid
        parts = getattr(polygon, "geoms", [polygon])
        assert all(shapely.is_ccw(part.exterior) for part in parts)
        assert geod.geometry_area_perimeter(polygon)[0] == pytest.approx(row["area_m2"], rel=0.021)
        assert polygon.contains(shapely.Point(row["lon"], row["lat"]))
        assert polygon.contains(shapely.Point(row["square_centre"]))
        every |= cells_of(polygon, file)
    assert (safe[every] == 1).all()
    cells = sum(zone["area_m2"] for zone in summary["zones"]) / area_of_cell(file, geod)
    assert every.sum() == pytest.approx(cells, rel=0.042)  # of area 2 % at most, of centres twice that


def cells_of(polygon: shapely.Geometry, file: Any) -> np.ndarray:
    """Return the cells of a raster whose centres lie in a WGS-84 polygon."""
    from pyproj import Transformer

    there = Transformer.from_crs("EPSG:4326", CRS(file.crs.to_wkt()).to_2d(), always_xy=True)
    moved = shapely.transform(polygon, lambda xy: np.column_stack(there.transform(xy[:, 0], xy[:, 1])))
    return rasterio.features.geometry_mask([moved], file.shape, file.transform, invert=True)


def area_of_cell(file: Any, geod: Geod) -> float:
    from pyproj import Transformer

    there = Transformer.from_crs(CRS(file.crs.to_wkt()).to_2d(), "EPSG:4326", always_xy=True)
    a, e = file.transform.a, file.transform.e
    x, y = (file.bounds.left + file.bounds.right) / 2, (file.bounds.bottom + file.bounds.top) / 2
    lon, lat = there.transform([x, x + a, x + a, x], [y, y, y + e, y + e])
    return abs(geod.polygon_area_perimeter(lon, lat)[0])


@pytest.mark.parametrize(
    ("crs", "height_m", "square_m"),
    [
        ("EPSG:32610", 1.0, 36.5),
        ("EPSG:2992", 0.3048, 36.5),
        ("EPSG:2225+5703", 1.0, 36.5),
        ("EPSG:32610+6360", 1200 / 3937, 36.5),
        ("EPSG:3857", 1.0, 36.5),
        ("EPSG:4326", 1.0, 36.5),
        ("EPSG:5070", 1.0, 29.7),  # its grid is turned by 16 degrees here
    ],
)
@pytest.mark.usefixtures("undrawn")
def test_the_same_ground_has_the_same_zone_in_any_crs(
    tmp_path: Path, crs: str, height_m: float, square_m: float
) -> None:
    path = write(tmp_path / "field.laz", placed(field(), crs, height_m), crs)
    summary = mapped([path], tmp_path / "out")
    check_agreement(tmp_path / "out", summary, crs)
    assert summary["crs"] == crs
    assert summary["epsg"] == (None if "+" in crs else int(crs.removeprefix("EPSG:")))
    (zone,) = summary["zones"]
    # The footprint of 2 m and the outermost cell of 0.5 m keep off the edges, the footprint off the block.
    assert zone["area_m2"] == pytest.approx(57 * 37 - 6.5 * 6.5, rel=0.03)
    assert zone["slope_deg"] < 1.0
    assert zone["square_side_m"] == pytest.approx(square_m, abs=1.5)
    assert zone["elevation_m"] == pytest.approx(100, abs=0.05)
    assert zone["lat"] == pytest.approx(LAT + 20 / 111_100, abs=3e-5)
    assert zone["lon"] == pytest.approx(LON + 41 / 80_200, abs=6e-5)


@pytest.mark.usefixtures("undrawn")
def test_the_surface_is_in_the_units_of_the_file(tmp_path: Path) -> None:
    path = write(tmp_path / "field.las", placed(field(), "EPSG:2992", 0.3048), "EPSG:2992")
    summary = mapped([path], tmp_path / "out")
    height, file = raster(tmp_path / "out" / "dsm.tif")
    assert file.units == ("ft",)
    assert "ft" in file.descriptions[0]
    assert np.nanmedian(height) == pytest.approx(100 / 0.3048, abs=0.1)
    assert file.transform.a == pytest.approx(0.5 / 0.3048)
    assert any("taken in ft" in warning for warning in summary["warnings"])


@pytest.mark.usefixtures("undrawn")
def test_a_stray_point_is_dropped_counted_and_told(tmp_path: Path) -> None:
    points = placed(field(), "EPSG:32610")
    points[7, :2] -= 400_000
    summary = mapped([write(tmp_path / "field.las", points)], tmp_path / "out")
    assert summary["points"]["dropped"] == {"stray": 1}
    assert summary["cells"]["cols"] < 125
    assert any("far from all others" in warning for warning in summary["warnings"])


@pytest.mark.usefixtures("undrawn")
def test_water_without_returns_is_no_landing_zone(tmp_path: Path) -> None:
    points = placed(field(), "EPSG:32610")
    kind = np.where(points[:, 0] > np.median(points[:, 0]), 9, 2)
    summary = mapped([write(tmp_path / "field.las", points, classification=kind)], tmp_path / "out")
    assert sum(zone["area_m2"] for zone in summary["zones"]) < 57.5 * 37.5 / 2


@pytest.mark.usefixtures("undrawn")
def test_a_cloud_too_sparse_yields_no_zone_and_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "field.las", placed(field(5.0), "EPSG:32610"))
    summary = mapped([path], tmp_path / "out")
    assert summary["zones"] == []
    assert summary["cells"]["safe"] == 0
    assert any("--cell-m" in warning for warning in summary["warnings"])


@pytest.mark.usefixtures("undrawn")
def test_coverage_that_somebody_set_is_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "field.las", placed(field(1.0), "EPSG:32610"))
    assert mapped([path], tmp_path / "out")["coverage_m"] > 1.0
    assert mapped([path], tmp_path / "out", "coverage_m=1.0")["coverage_m"] == 1.0


@pytest.mark.usefixtures("undrawn")
def test_source_rules_write_the_same_files(tmp_path: Path) -> None:
    path = write(tmp_path / "field.las", placed(field(), "EPSG:32610"))
    mapped([path], tmp_path / "out", "mode=source")
    assert raster(tmp_path / "out" / "roughness.tif")[1].units == ("degree",)


def test_a_folder_that_is_a_file_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "field.las", placed(field(2.0), "EPSG:32610"))
    with pytest.raises(UsageError, match=f"{path} is a file"):
        mapped([tmp_path / "absent.las"], path / "out")


@pytest.mark.parametrize("before", [False, True])
def test_a_signal_while_results_are_written_leaves_none_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], before: bool
) -> None:
    path = write(tmp_path / "field.las", placed(field(2.0), "EPSG:32610"))
    out = tmp_path / "maps" / "of the field"
    if before:
        out.mkdir(parents=True)
        (out / "zones.geojson").write_text("of an earlier run")

    def terminated(*_: Any) -> list[Path]:
        os.kill(os.getpid(), signal.SIGTERM)
        return []

    monkeypatch.setattr("companion.desk.figures.save_maps", terminated)
    monkeypatch.setattr("threading.Timer", lambda *_: SimpleNamespace(start=lambda: None))
    monkeypatch.setattr(sys, "argv", ["slz", "map", str(path), "--out", str(out), "--json"])
    with pytest.raises(SystemExit) as ended:
        program.main()
    assert ended.value.code == 143
    assert capfd.readouterr().out == ""
    if before:
        assert [(file.name, file.read_text()) for file in out.iterdir()] == [
            ("zones.geojson", "of an earlier run")
        ]
    else:
        assert not (tmp_path / "maps").exists()


def test_the_command_prints_one_object_and_errors_take_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "field.las", placed(field(), "EPSG:32610"))
    monkeypatch.setattr(sys, "argv", ["slz", "map", str(path), "--out", str(tmp_path / "out"), "--json"])
    with pytest.raises(SystemExit) as ended:
        program.main()
    assert ended.value.code == 0
    assert len(json.loads(capfd.readouterr().out)["zones"]) == 1

    monkeypatch.setattr(sys, "argv", ["slz", "map", "absent.laz", "--out", str(tmp_path / "out"), "--json"])
    with pytest.raises(SystemExit) as ended:
        program.main()
    assert ended.value.code == 2
    assert capfd.readouterr() == ("", "slz: absent.laz: no such file\n")


@needs_autzen
def test_autzen_in_feet_has_its_fields(tmp_path: Path) -> None:
    summary = mapped([AUTZEN], tmp_path)
    _, file = raster(tmp_path / "safe.tif")
    with laspy.open(AUTZEN) as cloud:
        check_agreement(tmp_path, summary, cloud.header.parse_crs())
    assert file.crs.linear_units_factor[1] == pytest.approx(0.3048)
    assert file.bounds.left == pytest.approx(636_001.76, abs=2)
    assert file.bounds.top == pytest.approx(849_497.90, abs=2)
    largest = max(summary["zones"], key=lambda zone: zone["area_m2"])
    assert largest["area_m2"] > 15_000
    assert largest["slope_deg"] < 3
    assert largest["elevation_m"] == pytest.approx(130.5, abs=1)
    assert (largest["lat"], largest["lon"]) == pytest.approx((44.0504, -123.0725), abs=2e-3)
