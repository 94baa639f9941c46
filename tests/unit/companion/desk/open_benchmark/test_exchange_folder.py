"""Scenes in files: what is written is read again, by this program and by others."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio

from companion.desk.clouds import cloud
from companion.desk.open_benchmark.exchange_folder import read_case, write_case
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.open_benchmark.flights_over import case_of

SAFE = np.array([[0, 1, 1, 1], [0, 1, 1, 0], [1, 1, 255, 0]], np.uint8)


@pytest.mark.parametrize("form", ["laz", "pcd"])
def test_a_case_is_read_as_it_was_written(tmp_path: Path, form: str) -> None:
    case = case_of(SAFE)
    write_case(case, tmp_path, form)
    again = read_case(tmp_path / "small")
    assert (again.name, again.origin, again.task, again.truth.kinds) == (
        case.name,
        case.origin,
        case.task,
        case.truth.kinds,
    )
    assert again.document == case.document
    for name in ("safe", "kind", "slope_deg", "relief_m"):
        assert np.array_equal(getattr(again.truth, name), getattr(case.truth, name))
    mine, theirs = case.flights["2"], again.flights["2"]
    assert np.allclose(theirs.points_m, mine.points_m, atol=1e-9)
    assert np.array_equal(theirs.window, mine.window)
    assert np.allclose(theirs.sensors_m, mine.sensors_m)
    assert np.allclose(theirs.stamp_s, mine.stamp_s)


def test_truth_is_north_up_in_the_scenes_crs(tmp_path: Path) -> None:
    case = case_of(SAFE)
    write_case(case, tmp_path)
    with rasterio.open(tmp_path / "small" / "truth.tif") as file:
        assert np.array_equal(file.read(1), SAFE[::-1])
        assert (file.transform.c, file.transform.f, file.transform.a, file.transform.e) == (
            -1.0,
            0.75,
            0.5,
            -0.5,
        )
        assert file.crs.is_projected


@pytest.mark.parametrize("form", ["laz", "pcd"])
def test_clouds_are_read_by_slz_map(tmp_path: Path, form: str) -> None:
    case = case_of(SAFE)
    write_case(case, tmp_path, form)
    crs = case.crs.to_wkt() if form == "pcd" else None
    found = cloud.read([tmp_path / "small" / "2" / f"points.{form}"], crs)
    assert np.allclose(found.points, case.flights["2"].points_m, atol=1e-6)


def test_folders_that_are_no_scene_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="it is no scene"):
        read_case(tmp_path)
    write_case(case_of(SAFE), tmp_path)
    file = tmp_path / "small" / "scene.json"
    document = json.loads(file.read_text("utf-8"))
    file.write_text(json.dumps(document | {"format_version": 2}), "utf-8")
    with pytest.raises(UsageError, match="is not of format"):
        read_case(tmp_path / "small")
    document["task"]["grid"]["rows"] = 9
    file.write_text(json.dumps(document), "utf-8")
    with pytest.raises(UsageError, match=r"scene\.json says"):
        read_case(tmp_path / "small")


@pytest.mark.parametrize("name", ["../../../evil<b>", ".hidden", "a/b", "", "a b", "ä"])
def test_names_that_are_none_of_a_folder_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match="cannot be that of a folder"):
        write_case(replace(case_of(SAFE), name=name), tmp_path / "out")
    assert not list(tmp_path.iterdir())
    write_case(case_of(SAFE), tmp_path)
    file = tmp_path / "small" / "scene.json"
    document = json.loads(file.read_text("utf-8"))
    for change in ({"name": name}, {"flights": {name: "2/points.laz"}}):
        file.write_text(json.dumps(document | change), "utf-8")
        with pytest.raises(UsageError, match=r"scene\.json: the name .* cannot be that of a folder"):
            read_case(tmp_path / "small")


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("truth.tif", 7, r"truth\.tif: it has the value 7, not 0, 1 or 255"),
        ("kind.tif", 2, r"kind\.tif: it has the value 2, not the index of one of the 2 kinds"),
        ("kind.tif", 255, r"kind\.tif: it has the value 255, not .* where truth\.tif is 0"),
    ],
)
def test_truths_of_other_values_are_refused(tmp_path: Path, name: str, value: int, complaint: str) -> None:
    write_case(case_of(SAFE), tmp_path)
    with rasterio.open(tmp_path / "small" / name, "r+") as file:
        file.write(np.full((1, *SAFE.shape), value, np.uint8))
    with pytest.raises(UsageError, match=complaint):
        read_case(tmp_path / "small")


@pytest.mark.parametrize("cloud", ["../other/points.laz", "/data/points.laz", "2/../../points.laz"])
def test_clouds_outside_the_folder_are_refused(tmp_path: Path, cloud: str) -> None:
    write_case(case_of(SAFE), tmp_path)
    file = tmp_path / "small" / "scene.json"
    document = json.loads(file.read_text("utf-8"))
    file.write_text(json.dumps(document | {"flights": {"2": cloud}}), "utf-8")
    with pytest.raises(UsageError, match=r"scene\.json: the cloud .* must be inside the scene's folder"):
        read_case(tmp_path / "small")


@pytest.mark.parametrize("form", ["laz", "pcd"])
def test_truncated_clouds_are_one_line(tmp_path: Path, form: str) -> None:
    write_case(case_of(SAFE), tmp_path, form)
    cloud_file = tmp_path / "small" / "2" / f"points.{form}"
    cloud_file.write_bytes(cloud_file.read_bytes()[:-300])
    with pytest.raises(UsageError, match=rf"points\.{form}: .*(truncated|corrupt)") as refused:
        read_case(tmp_path / "small")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("change", [{"footprint_m": 0.0}, {"relief_limit_m": float("nan")}])
def test_tasks_that_mean_nothing_are_refused(tmp_path: Path, change: dict[str, float]) -> None:
    write_case(case_of(SAFE), tmp_path)
    file = tmp_path / "small" / "scene.json"
    document = json.loads(file.read_text("utf-8"))
    file.write_text(json.dumps(document | {"task": document["task"] | change}), "utf-8")
    with pytest.raises(UsageError, match="it must be above 0"):
        read_case(tmp_path / "small")
