"""Evaluation of a simulated flight against hand-made truth files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio import Affine

from companion.desk.evaluation import (
    Truth,
    area_error,
    read_raster,
    read_truth,
    relative_area_error,
    touchdown,
)
from companion.runtime.errors import CompanionError
from params import load
from slz import SAFE, UNKNOWN, Box, Grid, LocalFrame, TerrainMaps
from slz.terrain.layers import NAMED

HOME = LocalFrame(47.4, 8.5, 400.0)
SIDE_M, CELL_M = 20.0, 0.5
ORIGIN = {"lat_deg": HOME.lat_deg, "lon_deg": HOME.lon_deg, "alt_m": HOME.alt_m}


def write_truth(
    folder: Path,
    origin: Any = ORIGIN,
    touched: tuple[float, float] | None = (2.0, 3.0),
    footing: dict[str, Any] | None = None,
) -> Path:
    """Write ground about the origin that is safe in its eastern half."""
    n = round(SIDE_M / CELL_M)
    safe = np.zeros((n, n), np.uint8)
    safe[:, n // 2 :] = 1
    place = Affine(CELL_M, 0.0, -SIDE_M / 2, 0.0, -CELL_M, SIDE_M / 2)
    shape: dict[str, Any] = {"width": n, "height": n, "count": 1, "dtype": "uint8", "crs": "EPSG:32632"}
    with rasterio.open(folder / "truth.tif", "w", driver="GTiff", transform=place, **shape) as file:
        file.write(safe, 1)
    (folder / "scene.json").write_text(json.dumps({"origin": origin}))
    flight: dict[str, Any] = {} if touched is None else {"touchdown": {"e": touched[0], "n": touched[1]}}
    if footing is not None:
        flight["touchdown"]["footing"] = footing
    (folder / "flight.json").write_text(json.dumps(flight))
    return folder


@pytest.mark.parametrize("origin", [ORIGIN, list(ORIGIN.values())])
def test_the_truth_lies_about_the_scene_s_origin(tmp_path: Path, origin: Any) -> None:
    truth = read_truth(write_truth(tmp_path, origin))
    assert truth.frame == HOME
    east, north = np.array([1.0, -1.0, 9.9, 10.1, 1.0]), np.array([0.0, 0.0, 9.9, 0.0, -10.1])
    assert truth.at(east, north).tolist() == [1, 0, 1, 0, 0]  # outside of the world nothing is safe


@pytest.mark.parametrize("name", ["truth.tif", "scene.json", "flight.json"])
@pytest.mark.parametrize("content", [None, b"nonsense"])
def test_truth_that_is_missing_or_damaged_is_one_line(
    tmp_path: Path, name: str, content: bytes | None
) -> None:
    file = write_truth(tmp_path) / name
    file.unlink() if content is None else file.write_bytes(content)
    with pytest.raises(CompanionError, match="the simulator left no truth in"):
        read_truth(tmp_path)


def flown(folder: Path, touched: tuple[float, float] | None) -> Truth:
    return read_truth(write_truth(folder, touched=touched))


def test_a_touchdown_is_told_with_its_distance_from_the_chosen_point(tmp_path: Path) -> None:
    found = touchdown(flown(tmp_path, (2.0, 3.0)), HOME.lla([5.0, -1.0, 0.0]))
    assert found == {
        "landed": True,
        "touchdown_error_m": pytest.approx(5.0),
        "touchdown_tilt_deg": None,
        "touchdown_safe": True,
        "touchdown_fault": "",
    }


def test_a_touchdown_without_a_chosen_point_has_no_error_and_may_be_unsafe(tmp_path: Path) -> None:
    found = touchdown(flown(tmp_path, (-2.0, 3.0)), None)
    assert found == {
        "landed": True,
        "touchdown_error_m": None,
        "touchdown_tilt_deg": None,
        "touchdown_safe": False,
        "touchdown_fault": "touched unsafe ground",
    }


@pytest.mark.parametrize(
    ("east_m", "fault", "told"),
    [
        (2.0, "", ""),
        (2.0, "stands at 19 degrees on its gear", "stands at 19 degrees on its gear"),
        (-2.0, "stands on its belly", "touched unsafe ground; stands on its belly"),
    ],
)
def test_a_touchdown_is_safe_only_where_its_gear_stands(
    tmp_path: Path, east_m: float, fault: str, told: str
) -> None:
    footing = {"tilt_deg": 19.2, "belly_touches": False, "fault": fault}
    found = touchdown(read_truth(write_truth(tmp_path, touched=(east_m, 3.0), footing=footing)), None)
    assert (found["touchdown_safe"], found["touchdown_fault"]) == (not told, told)
    assert found["touchdown_tilt_deg"] == 19.2


def test_a_vehicle_that_never_came_down_has_not_landed(tmp_path: Path) -> None:
    found = touchdown(flown(tmp_path, None), HOME.lla([5.0, -1.0, 0.0]))
    assert found == {
        "landed": False,
        "touchdown_error_m": None,
        "touchdown_tilt_deg": None,
        "touchdown_safe": False,
        "touchdown_fault": "",
    }


@pytest.mark.parametrize(
    ("areas", "error"),
    [((100.0, 100.0, 100.0), 0.0), ((7078.0, 8316.0, 6654.0), 0.2598), ((50.0, 100.0, 0.0), 2.0)],
)
def test_the_error_of_areas_is_the_share_that_each_has_alone(
    areas: tuple[float, float, float], error: float
) -> None:
    assert relative_area_error(*areas) == pytest.approx(error, abs=1e-4)


@pytest.mark.parametrize("areas", [(0.0, 5.0, 0.0), (5.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
def test_there_is_no_error_of_an_area_that_is_nothing(areas: tuple[float, float, float]) -> None:
    assert relative_area_error(*areas) is None


def test_cells_that_were_called_safe_are_compared_with_the_truth(tmp_path: Path) -> None:
    truth = flown(tmp_path, None)
    grid = Grid(-SIDE_M / 2, -SIDE_M / 2, CELL_M, 40, 40)
    box = Box(0, 40, 0, 40)
    blank = np.full((40, 40), np.nan, np.float32)
    state = np.full((40, 40), SAFE, np.uint8)
    state[:, :10] = UNKNOWN
    maps = TerrainMaps(HOME, grid, box, dict.fromkeys(NAMED, blank), state)
    found = area_error(truth, maps, (), load())
    assert found["area_error"] is None  # there is no zone
    assert found["unsafe_as_safe"] == pytest.approx(1 / 3)
    assert found["recall"] == 1.0


# Truth raster: files of another library are read or refused.


VALUES = np.arange(7 * 5, dtype=np.uint8).reshape(7, 5)


def written(path: Path, **given: Any) -> Path:
    own: dict[str, Any] = {"dtype": "uint8", "crs": "EPSG:32632", **given}
    place = Affine(0.5, 0.0, -3.0, 0.0, -0.5, 9.0)
    with rasterio.open(path, "w", "GTiff", width=5, height=7, count=1, transform=place, **own) as file:
        file.write(VALUES.astype(own["dtype"]), 1)
    return path


@pytest.mark.parametrize("given", [{}, {"compress": "deflate"}, {"compress": "deflate", "blockysize": 2}])
def test_bytes_are_read_plain_or_deflated(tmp_path: Path, given: dict[str, Any]) -> None:
    raster = read_raster(written(tmp_path / "a.tif", **given))
    assert np.array_equal(raster.values, VALUES)
    assert raster[1:] == (-3.0, 9.0, 0.5)


@pytest.mark.parametrize("given", [{"dtype": "float32"}, {"compress": "lzw"}, {"BIGTIFF": "YES"}])
def test_other_rasters_are_refused(tmp_path: Path, given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"does not hold bytes|no little-endian TIFF"):
        read_raster(written(tmp_path / "a.tif", **given))


@pytest.mark.parametrize("size", [0, 6, 20, 40, 200])
def test_a_truncated_file_is_refused(tmp_path: Path, size: int) -> None:
    path = written(tmp_path / "a.tif", compress="deflate")
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(ValueError, match="raster|TIFF|reshape"):
        read_raster(path)
