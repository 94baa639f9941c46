"""A scene of the simulator in the exchange format: what is written is what `slz benchmark` judges."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from companion.cli import program
from companion.desk.open_benchmark.exchange_folder import read_case
from sitl import scenes
from sitl.benchmark_scene import main
from sitl.truth.truth import safe_map

EXTENT = (-24.0, -40.0, 0.0, -16.0)  # of landing_site: the pond's east, boulders and crates
OPTIONS = [
    "--scene=landing_site",
    "--seed=3",
    f"--extent={','.join(map(str, EXTENT))}",
    "--speed=12",
    "--point-rate=40000",
    "--density=5",
    "--density=20",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("scenes")
    assert main([*OPTIONS, f"--out={out}"]) == 0
    return out


def test_truth_is_that_of_the_simulator_but_for_the_edge(folder: Path) -> None:
    case = read_case(folder / "landing_site-3")
    own = safe_map(scenes.build("landing_site", 3).world, EXTENT)
    judged = case.truth.safe != 255
    assert judged[10:-10, 10:-10].all()
    assert judged.sum() == 100 * 100
    assert np.array_equal(case.truth.safe[judged], own.safe[judged])
    assert 0.02 < (own.safe[judged] == 0).mean() < 0.9
    np.testing.assert_array_equal(case.truth.slope_deg, own.slope_deg)
    np.testing.assert_array_equal(case.truth.relief_m, own.relief_m)


def test_every_unsafe_cell_has_a_kind_of_what_is_there(folder: Path) -> None:
    truth = read_case(folder / "landing_site-3").truth
    assert ((truth.kind != 255) == (truth.safe == 0)).all()
    scene = scenes.build("landing_site", 3)
    x = EXTENT[0] + (np.arange(120) + 0.5) * 0.2
    y = EXTENT[1] + (np.arange(120) + 0.5) * 0.2
    checked = 0
    for solid in scene.world.solids:
        x0, y0, _, x1, y1, _ = solid.bounds()
        row, col = np.argmin(np.abs(y - (y0 + y1) / 2)), np.argmin(np.abs(x - (x0 + x1) / 2))
        if 10 <= row < 110 and 10 <= col < 110 and truth.safe[row, col] == 0:
            expected = "rock" if solid.name.startswith("boulder") else "block"
            assert truth.kinds[truth.kind[row, col]] in (expected, "water")
            checked += 1
    assert checked > 0
    assert (truth.kind == truth.kinds.index("water")).any()


def test_flights_hold_what_the_lidar_saw_at_their_density(folder: Path) -> None:
    case = read_case(folder / "landing_site-3")
    scene = scenes.build("landing_site", 3)
    for label, flight in case.flights.items():
        assert len(flight) == int(label) * 24 * 24
        assert (np.diff(flight.stamp_s) >= 0).all()
        assert np.array_equal(flight.window, np.floor(flight.stamp_s).astype(int) - int(flight.stamp_s[0]))
        surface, _ = scene.world.surface(*flight.points_m[:, :2].T)
        assert np.median(np.abs(flight.points_m[:, 2] - surface)) < 0.03
        assert (flight.sensors_m[:, 2] > 19.0).all()


def test_the_benchmark_judges_it(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["benchmark", "--scenes", str(folder), "--method", "plane", "--method", "all seen", "--json"]
    monkeypatch.setattr(sys, "argv", ["slz", *words, "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as left:
        program.main()
    assert not left.value.code
    plane, seen = (method["groups"]["20"] for method in json.loads(capsys.readouterr().out)["methods"])
    assert plane["judged"] == 100 * 100
    assert plane["by_kind"]["block"]["unsafe_called_safe"] < 0.2  # it knows nothing of water
    assert seen["by_kind"]["block"]["unsafe_called_safe"] > 0.8
    assert plane["safe_found"] > 0.5


@pytest.mark.parametrize("lidar", ["vlp16", "opal"])
def test_other_lidars_fly_it_too(lidar: str, tmp_path: Path) -> None:
    options = ["--scene=plain", "--extent=-10,-10,10,10", "--speed=20", "--height=15", "--density=2"]
    assert main([*options, f"--lidar={lidar}", "--name=x", f"--out={tmp_path}"]) == 0
    case = read_case(tmp_path / "x")
    assert case.document["lidar"] == lidar
    assert len(case.flights["2"]) == 800


@pytest.mark.parametrize(
    ("option", "complaint"),
    [
        ("--scene=moon", "unknown"),
        ("--lidar=radar", "maps no ground by pulses"),
        ("--lidar=eye", "no LiDAR is named"),
        ("--extent=0,0,4,4", "nothing is left to judge"),
        ("--density=100000", "are needed: more --point-rate"),
        ("--density=0", "must be 1 or more"),
    ],
)
def test_what_cannot_be_flown_or_thinned_is_refused(
    option: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    usual = ["--scene=plain", "--extent=-5,-5,5,5", "--speed=20", "--point-rate=2000", "--density=1"]
    with pytest.raises(SystemExit) as ended:
        main([*usual, option, f"--out={tmp_path}"])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
