"""Agreement of a flown survey with the world below it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sitl import flown_survey, scenes
from sitl.flown_survey import Lines, fly, main

EXTENT = (-20.0, -20.0, 20.0, 20.0)


def test_returns_lie_on_the_surface_below_the_lines() -> None:
    scene = scenes.build("plain", 1)
    parts = list(fly(scene, Lines(EXTENT, height_m=15.0, speed_ms=10.0), 1, 20_000))
    points = np.concatenate([part.points_enu_m for part in parts])
    stamps = np.concatenate([part.stamp_ns for part in parts])
    assert (np.diff(stamps) >= 0).all()
    assert stamps[-1] < 15e9  # three lines of 40 m and two ways of 13 m, at 10 m/s
    near = (np.abs(points[:, 0]) < 18) & (np.abs(points[:, 1]) < 18)
    surface, _ = scene.world.surface(points[near, 0], points[near, 1])
    assert np.median(np.abs(points[near, 2] - surface)) < 0.03
    hit, _, _ = np.histogram2d(points[near, 0], points[near, 1], bins=18)
    assert (hit > 0).all()


def test_the_vehicle_keeps_its_height_over_the_highest_thing_in_its_swath() -> None:
    scene = scenes.build("dense", 1)
    lines = Lines((-60.0, -60.0, 0.0, -40.0), 12.0, 20.0, 20.0)
    for sensor in (part.sensor_enu_m for part in fly(scene, lines, 1, 2_000)):
        x, y = np.meshgrid(np.arange(-8, 9.0), np.arange(-8, 9.0))
        surface, _ = scene.world.surface(sensor[0] + x, sensor[1] + y)
        assert sensor[2] > np.nanmax(surface) + 11


def test_a_climb_is_gained_steadily_from_the_first_line_to_the_last() -> None:
    scene = scenes.build("plain", 1)
    plain, climbing = (
        np.array([part.sensor_enu_m for part in fly(scene, Lines(EXTENT, 15.0, 20.0, 20.0, climb), 1, 2_000)])
        for climb in (0.0, 30.0)
    )
    gained = (climbing - plain)[:, 2]
    assert gained[0] < 1.0
    assert gained[-1] > 29.0
    np.testing.assert_allclose(np.diff(gained), np.mean(np.diff(gained)), atol=0.1)


def test_the_file_holds_cloud_and_truth(tmp_path: Path) -> None:
    out = tmp_path / "survey.npz"
    options = ["--scene=plain", "--extent=-20,-20,20,20", "--speed=20", "--point-rate=5000", "--cell=0.5"]
    assert main([*options, f"--out={out}"]) == 0
    with np.load(out) as data:
        assert data["count"].sum() == len(data["points_enu_m"]) == len(data["stamp_ns"])
        assert len(data["sensor_enu_m"]) == len(data["count"])
        assert data["safe"].shape == data["slope_deg"].shape == (80, 80)
        assert "lake" in json.loads(str(data["regions"]))
        assert "bright" not in data


def test_with_surface_the_file_holds_brightness_lost_rays_and_the_true_kinds_too(tmp_path: Path) -> None:
    options = ["--scene=ponds", "--extent=-20,-20,20,20", "--speed=20", "--point-rate=20000", "--cell=0.5"]
    for name, more in (("plain", []), ("surface", ["--surface"])):
        assert main([*options, *more, f"--out={tmp_path / name}.npz"]) == 0
    with np.load(tmp_path / "plain.npz") as plain, np.load(tmp_path / "surface.npz") as data:
        for name in plain:
            np.testing.assert_array_equal(data[name], plain[name])
        assert data["bright"].shape == data["stamp_ns"].shape
        assert 0.0 < np.median(data["bright"]) < 1.0
        assert len(data["lost_count"]) == len(data["count"])
        ends, origins = data["lost_enu_m"], data["lost_origin_enu_m"]
        assert data["lost_count"].sum() == len(ends) == len(origins) == len(data["lost_weight"])
        np.testing.assert_allclose(np.linalg.norm(ends - origins, axis=1), 100.0, rtol=1e-4)
        assert (ends[:, 2] < origins[:, 2] - 8.7).all()  # 5 degrees and more below the horizon
        names = json.loads(str(data["surface_names"]))
        assert data["surface"].shape == data["roof_height_m"].shape == (80, 80)
        assert (data["surface"] == names["WATER"])[20:60, 65:].all()  # pond-2 is east of 10 m
        assert (data["surface"] == names["BARE"])[20:60, 35:45].all()  # the dam


def test_lost_rays_are_thinned_and_weigh_as_many_as_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ["--scene=ponds", "--extent=-20,-20,20,20", "--speed=20", "--point-rate=20000", "--surface"]
    for thinning in (1, 11):
        monkeypatch.setattr(flown_survey, "THINNING", thinning)
        assert main([*options, f"--out={tmp_path / str(thinning)}.npz"]) == 0
    with np.load(tmp_path / "1.npz") as every, np.load(tmp_path / "11.npz") as data:
        n = len(every["lost_enu_m"])
        assert n > 10_000
        assert len(data["lost_enu_m"]) < n / 10
        assert data["lost_weight"].sum() == pytest.approx(n, rel=0.03)
        rays = set(map(bytes, every["lost_enu_m"]))
        assert all(bytes(ray) in rays for ray in data["lost_enu_m"])


@pytest.mark.parametrize(
    ("option", "complaint"),
    [("--scene=moon", "unknown"), ("--extent=1,2,3", "write X0,Y0,X1,Y1"), ("--extent=0,0,9e9,1", "within")],
)
def test_what_cannot_be_flown_is_refused(
    option: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([option, f"--out={tmp_path / 'x.npz'}"])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
