"""`slz bench`: its report on a small flight, and on bad input."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from companion.cli import program
from companion.desk.benchmark import Case
from companion.runtime.errors import UsageError
from params import Parameters

ARGUMENTS = [  # of a small flight
    "--cell-m",
    "1",
    "--zone-m",
    "60",
    "--min-square-m",
    "5",
    "--min-boundary",
    "20",
    "--mode",
    "source",
]


def flight(path: Path, seconds: int = 3) -> Path:
    """Level ground of 40 x 40 m with a step, 8000 returns a second, a few beyond the zone."""
    rng = np.random.default_rng(0)
    t = np.sort(rng.uniform(10.25, 10.25 + seconds, 8000 * seconds))
    xy = rng.uniform(-20, 20, (len(t), 2))
    xy[::1000] = 45.0
    z = np.where(xy[:, 0] > 10, 1.5, 0.0)
    np.column_stack([t, xy, z]).astype("<f8").tofile(path)
    return path


def said(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["slz", "bench", *arguments])
    with pytest.raises(SystemExit) as exit_:
        program.main()
    return int(exit_.value.code or 0)


def test_times_zones_and_windows_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    points = flight(tmp_path / "points.bin")
    assert said(monkeypatch, "--points", str(points), *ARGUMENTS, "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["windows"] == 4  # 10.25 to 11, to 12, to 13, to 13.25
    assert summary["points"] == 24_000
    assert 0 < summary["ms"]["median"] <= summary["ms"]["p99"] <= summary["ms"]["max"]
    assert summary["points_per_s"] > 0
    assert summary["stage_ms"]
    assert "cells" not in summary
    ids = [zone["id"] for zone in summary["zones"]]
    assert ids == sorted(ids)
    assert len(ids) == 2  # below and above the step
    for zone in summary["zones"]:
        assert zone["area_m2"] == zone["safe"] + zone["unsafe"] + zone["uncertain"]
        assert zone["n_filtered"] <= zone["n_boundary"]


def test_only_so_many_windows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    points = flight(tmp_path / "points.bin")
    assert said(monkeypatch, "--points", str(points), *ARGUMENTS, "--windows", "2", "--json") == 0
    assert json.loads(capsys.readouterr().out)["windows"] == 2


@pytest.mark.parametrize("odd", ["missing", "empty", "cut", "times", "mode"])
def test_bad_input_is_one_line_and_exit_2(
    odd: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    points = tmp_path / "points.bin"
    if odd != "missing":
        flight(points, 1)
    if odd in ("empty", "cut"):
        points.write_bytes(points.read_bytes()[: 0 if odd == "empty" else 77])
    if odd == "times":
        np.full((5, 4), np.nan).tofile(points)
    own = ["--mode", "fast"] if odd == "mode" else []
    assert said(monkeypatch, "--points", str(points), *ARGUMENTS, *own) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("slz: ")


def test_the_rules_of_the_source_are_set_in_its_mode_only(tmp_path: Path) -> None:
    source, default = (
        Case(tmp_path, 1.0, 60.0, 5.0, 20, mode).parameters() for mode in ("source", "default")
    )
    assert source.safe_slope_deg == 4.0
    assert default.safe_slope_deg == Parameters().safe_slope_deg
    with pytest.raises(UsageError, match="--mode 'ours': use source or default"):
        Case(tmp_path, 1.0, 60.0, 5.0, 20, "ours").parameters()


def test_default_mode_counts_the_cells_that_were_hit_derived_and_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    points = flight(tmp_path / "points.bin")
    assert said(monkeypatch, "--points", str(points), *ARGUMENTS[:-1], "default", "--json") == 0
    cells = json.loads(capsys.readouterr().out)["cells"]
    assert 0 < cells["hit"] <= 40 * 40 + 8 < cells["derived"] <= 4 * 60 * 60
    assert 0 <= cells["changed"] < cells["derived"]
