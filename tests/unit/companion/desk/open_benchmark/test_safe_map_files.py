"""Safe maps and zones of other programs: read on the scene's grid, or refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyproj import Transformer
from rasterio import Affine
from rasterio.windows import Window

from companion.desk.open_benchmark.benchmark_case import BenchmarkCase
from companion.desk.open_benchmark.landing_task import SafeMap
from companion.desk.open_benchmark.safe_map_files import read_safe_map
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.open_benchmark.flights_over import case_of

SAFE = np.array([[0, 1, 1, 1], [0, 1, 1, 0], [1, 1, 255, 0]], np.uint8)  # row 0 in the south
CASE = case_of(SAFE)
CELL = 0.5
SPARSE = {"tiled": True, "SPARSE_OK": True, "BIGTIFF": "YES"}
LOCAL = CASE.crs.to_wkt()


def write_raster(
    path: Path,
    values: np.ndarray,
    crs: Any = LOCAL,
    west: float = -1.0,
    north: float = 0.75,
    cell: float = CELL,
    nodata: float | None = 255,
) -> Path:
    """Write values, row 0 in the south, as a GeoTIFF north up."""
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=values.shape[1],
        height=values.shape[0],
        count=1,
        dtype=values.dtype.name,
        crs=crs,
        transform=Affine(cell, 0, west, 0, -cell, north),
        nodata=nodata,
    ) as file:
        file.write(values[::-1], 1)
    return path


def read(path: Path, case: BenchmarkCase = CASE) -> SafeMap:
    return read_safe_map(path, case)


def test_a_map_on_the_grid_is_read_cell_by_cell(tmp_path: Path) -> None:
    answer = read(write_raster(tmp_path / "a.tif", SAFE))
    assert np.array_equal(answer.state, SAFE)
    assert answer.probability is None


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=10)
@given(st.integers(1, 5), st.integers(0, 3), st.integers(0, 3))
def test_finer_and_larger_maps_say_the_same(tmp_path: Path, finer: int, west: int, north: int) -> None:
    fine = np.repeat(np.repeat(SAFE, finer, axis=0), finer, axis=1)
    fine = np.pad(fine, ((0, north), (west, 0)), constant_values=1)
    cell = CELL / finer
    path = write_raster(
        tmp_path / "a.tif", fine, west=-1.0 - west * cell, north=0.75 + north * cell, cell=cell
    )
    assert np.array_equal(read(path).state, SAFE)


def test_probabilities_are_safe_from_a_limit_on_and_nan_is_unknown(tmp_path: Path) -> None:
    values = np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4)
    values[0, 1] = np.nan
    path = write_raster(tmp_path / "a.tif", values, nodata=None)
    answer = read_safe_map(path, CASE, safe_from=0.8)
    assert np.array_equal(answer.probability, values, equal_nan=True)
    assert np.array_equal(answer.state == 1, values >= 0.8)
    assert answer.state[0, 1] == 255


def test_the_limit_is_compared_in_the_precision_of_the_map(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", np.full((3, 4), 0.9, np.float32), nodata=None)
    assert (read_safe_map(path, CASE, safe_from=0.9).state == 1).all()
    assert (read_safe_map(path, CASE, safe_from=0.91).state == 0).all()


@pytest.mark.parametrize("limit", [0.0, -0.1, 1.01, float("nan"), 1e-50])
def test_limits_that_call_everything_or_nothing_safe_are_refused(tmp_path: Path, limit: float) -> None:
    path = write_raster(tmp_path / "a.tif", SAFE)
    with pytest.raises(UsageError, match="--safe-from .*: a probability above 0"):
        read_safe_map(path, CASE, safe_from=limit)


@pytest.mark.parametrize("internal", [True, False])
@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_masked_cells_are_unknown(tmp_path: Path, internal: bool, kind: type) -> None:
    path = write_raster(tmp_path / "a.tif", np.ones((3, 4), kind), nodata=None)
    shown = np.array([[255, 255, 0, 0], [255, 0, 0, 255], [255, 255, 255, 255]], np.uint8)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=internal), rasterio.open(path, "r+") as file:
        file.write_mask(shown[::-1])
    assert np.array_equal(read(path).state, np.where(shown, 1, 255))


@pytest.mark.parametrize("nodata", [None, 255])
def test_cells_under_a_transparent_alpha_are_unknown(tmp_path: Path, nodata: int | None) -> None:
    path, shown = tmp_path / "a.tif", np.full((3, 4), 255, np.uint8)
    shown[0, 1:] = 0
    place = {"crs": LOCAL, "transform": Affine(CELL, 0, -1.0, 0, -CELL, 0.75)}
    size = {"width": 4, "height": 3, "count": 2, "dtype": "uint8", "nodata": nodata}
    with rasterio.open(path, "w", driver="GTiff", ALPHA="YES", **size, **place) as file:
        file.write(np.stack([np.ones((3, 4), np.uint8), shown[::-1]]))
    assert np.array_equal(read(path).state, np.where(shown, 1, 255))


def test_a_map_in_another_crs_lies_at_the_same_place(tmp_path: Path) -> None:
    to_utm = Transformer.from_crs(CASE.crs, "EPSG:32632", always_xy=True)
    x, y = to_utm.transform(0.0, 0.0)
    turned = np.full((40, 40), 1, np.uint8)
    turned[:, :20] = 0  # west of the scene's middle
    path = write_raster(tmp_path / "a.tif", turned, "EPSG:32632", x - 4, y + 4, 0.2)
    assert np.array_equal(read(path).state, np.tile([0, 0, 1, 1], (3, 1)))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"crs": None}, "no CRS"),
        ({"west": 500.0}, "does not overlap scene small"),
        ({"crs": "EPSG:32632"}, "does not overlap scene small"),
        ({"west": 0.0}, "less than half"),
        ({"values": np.full((3, 4), 7, np.uint8)}, "0 is unsafe, 1 safe"),
        ({"values": np.full((3, 4), 2.5, np.float32)}, "a probability is 0 to 1"),
        ({"values": np.full((3, 4), 255, np.uint8)}, "it is empty"),
        ({"values": np.full((3, 4), np.nan, np.float32)}, "it is empty"),
    ],
)
def test_unusable_rasters_are_refused(tmp_path: Path, change: dict[str, Any], complaint: str) -> None:
    path = write_raster(tmp_path / "a.tif", **({"values": SAFE} | change))
    with pytest.raises(UsageError, match=complaint) as refused:
        read(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("how", "complaint"),
    [
        ({"dtype": "complex64"}, "write whole numbers or floats"),
        ({"transform": Affine(CELL, 0, -1.0, CELL, 0, 0.75)}, "its cells have no area"),
        (
            {"transform": Affine(1e-5, 0, -1.0, 0, -1e-5, 0.75), "width": 200_000, "height": 150_000},
            "resample",
        ),
    ],
)
def test_rasters_that_are_no_map_of_values_are_refused(
    tmp_path: Path, how: dict[str, Any], complaint: str
) -> None:
    place = {"crs": LOCAL, "transform": Affine(CELL, 0, -1.0, 0, -CELL, 0.75)}
    size = {"width": 4, "height": 3, "count": 1, "dtype": "uint8"}
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", **SPARSE, **(size | place | how)):
        pass
    with pytest.raises(UsageError, match=complaint):
        read(tmp_path / "a.tif")


def test_scaled_values_are_refused(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", SAFE)
    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets = (0.01,), (0.5,)
    with pytest.raises(UsageError, match=r"scale 0\.01 and offset 0\.5"):
        read(path)


def test_of_a_map_of_a_country_only_the_scene_is_read(tmp_path: Path) -> None:
    n = 60_000
    place = {"crs": LOCAL, "transform": Affine(CELL, 0, -n * CELL / 2, 0, -CELL, n * CELL / 2)}
    size = {"width": n, "height": n, "count": 1, "dtype": "float64"}
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", **SPARSE, **size, **place) as file:
        file.write(np.ones((1, 2, 2)), window=Window(n // 2, n // 2, 2, 2))  # south-east of the middle
    corner = np.zeros((4, 4), np.uint8)
    corner[:2, 2:] = 1
    assert np.array_equal(read(tmp_path / "a.tif", case_of(np.ones((4, 4), np.uint8))).state, corner)


def square(west: float, south: float, east: float, north: float) -> dict[str, Any]:
    """Return a zone given in the scene's metres, as RFC 7946 has it: longitude and latitude."""
    to_wgs84 = Transformer.from_crs(CASE.crs, "EPSG:4326", always_xy=True)
    corners = [(west, south), (east, south), (east, north), (west, north), (west, south)]
    ring = [to_wgs84.transform(*corner) for corner in corners]
    return {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}


def collection(*features: dict[str, Any], **more: Any) -> str:
    return json.dumps({"type": "FeatureCollection", "features": features, **more})


def test_cells_inside_zones_are_safe_and_holes_are_not(tmp_path: Path) -> None:
    path = tmp_path / "zones.geojson"
    whole = square(-1.0, -0.75, 1.0, 0.75)
    hole = square(-0.5, -0.25, 0.0, 0.25)["geometry"]["coordinates"][0]
    whole["geometry"]["coordinates"].append(hole)
    path.write_text(collection(whole), "utf-8")
    expected = np.ones((3, 4), np.uint8)
    expected[1, 1] = 0
    assert np.array_equal(read(path).state, expected)
    with pytest.raises(UsageError, match="have no probabilities"):
        read_safe_map(path, CASE, safe_from=0.5)


def test_polygons_of_collections_are_zones(tmp_path: Path) -> None:
    west, east = square(-1.0, -0.75, 0.0, 0.75), square(0.0, -0.75, 1.0, 0.75)
    geometry = {
        "type": "GeometryCollection",
        "geometries": [east["geometry"], {"type": "Point", "coordinates": [8, 47]}],
    }
    deeper = {"type": "GeometryCollection", "geometries": [geometry]}
    path = tmp_path / "zones.geojson"
    path.write_text(collection(west, {"type": "Feature", "properties": {}, "geometry": deeper}), "utf-8")
    assert (read(path).state == 1).all()


def test_a_zone_of_the_whole_world_calls_every_cell_safe(tmp_path: Path) -> None:
    ring = [[-180, -90], [180, -90], [180, 90], [-180, 90], [-180, -90]]
    path = tmp_path / "zones.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}), "utf-8")
    assert (read(path).state == 1).all()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "it is empty"),
        ("zones", "no readable GeoJSON"),
        ("[1, 2]", "no readable GeoJSON"),
        (collection(), "holds no polygon"),
        (collection(square(90, 90, 95, 95)), "does not overlap"),
        (collection(square(0.0, 0.25, 0.5, 0.75)), "does not overlap"),  # its cell is not judged
        (collection(square(0, 0, 1, 1), crs={"properties": {"name": "EPSG:0"}}), "member crs is unknown"),
        (collection(square(0, 0, 1, 1), crs={"properties": {"name": "EPSG:5773"}}), "no east and north"),
        ("[" * 100_000, "no readable GeoJSON"),
    ],
)
def test_unusable_zones_are_refused(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "zones.geojson"
    path.write_text(text, "utf-8")
    with pytest.raises(UsageError, match=complaint) as refused:
        read(path)
    assert "\n" not in str(refused.value)


def test_files_of_other_kinds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read(tmp_path / "none.tif")
    (tmp_path / "map.png").write_bytes(b"PNG")
    with pytest.raises(UsageError, match="a safe map is a GeoTIFF"):
        read(tmp_path / "map.png")
    (tmp_path / "map.tif").write_bytes(b"PNG")
    with pytest.raises(UsageError, match="no readable GeoTIFF"):
        read(tmp_path / "map.tif")
