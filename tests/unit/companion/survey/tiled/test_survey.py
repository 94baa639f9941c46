"""A tiled survey is refused, resumed and told of as it should be."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from companion import cli, survey
from companion.errors import UsageError
from companion.survey.tiled.engine import engine
from companion.survey.tiled.progress import Progress
from tests.unit.companion.survey import packing
from tests.unit.companion.survey.clouds import field, placed, write
from tests.unit.companion.survey.tiled.ground import parameters, surveyed

UTM = "EPSG:32610"
FIELD = placed(field(), UTM)


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("companion.figures.save_maps", lambda *_: [])


def command(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["slz", "map", *words])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    return int(ended.value.code or 0)


def broken(path: Path) -> Path:
    write(path, FIELD)
    path.write_bytes(path.read_bytes()[:-5000])
    return path


def test_a_broken_file_is_left_out_named_and_told_by_the_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    good, bad = write(tmp_path / "good.laz", FIELD), broken(tmp_path / "bad.laz")
    out = tmp_path / "out"
    code = command(monkeypatch, str(good), str(bad), "--out", str(out), "--json")
    told = capfd.readouterr()
    summary = json.loads(told.out)
    assert code == 2
    assert [one["file"] for one in summary["skipped"]] == [str(bad)]
    assert "bad.laz" in told.err
    assert summary["points"]["read"] == len(FIELD)
    assert len(summary["zones"]) == 1
    assert not (out / ".slz-survey").exists()


def test_only_broken_files_are_one_line_and_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    files = [str(broken(tmp_path / f"{k}.laz")) for k in range(2)]
    assert command(monkeypatch, *files, "--out", str(tmp_path / "out"), "--json") == 2
    told = capfd.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_copc_file_gives_what_its_las_file_gives(tmp_path: Path) -> None:
    las = write(tmp_path / "a.las", FIELD)
    copc = packing.copc(tmp_path / "a.copc.laz", las)
    told = [survey.run([path], tmp_path / path.stem, parameters(), lambda *_: None) for path in (las, copc)]
    assert len(told[0]["zones"]) == 1
    assert told[1]["zones"] == told[0]["zones"]
    maps = [sorted((tmp_path / path.stem).glob("*.tif")) for path in (las, copc)]
    assert len(maps[0]) == 4
    assert [path.read_bytes() for path in maps[1]] == [path.read_bytes() for path in maps[0]]


def test_a_second_run_into_one_folder_is_refused_while_the_first_lasts(tmp_path: Path) -> None:
    path, out, refused = write(tmp_path / "a.laz", FIELD), tmp_path / "out", []

    def meanwhile(what: str, _: float) -> None:
        if what == "done":
            return
        with pytest.raises(UsageError, match="another run writes to it") as caught:
            survey.run([path], out, parameters(), lambda *_: None)
        refused.append(caught.value)

    survey.run([path], out, parameters(), meanwhile)
    assert len(refused) > 3
    assert survey.run([path], out, parameters(), lambda *_: None)["zones"]


def test_work_of_another_survey_is_not_mixed_in(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", FIELD)
    surveyed([path], tmp_path / "work")
    with pytest.raises(UsageError, match="with other parameters: run that one again"):
        surveyed([path], tmp_path / "work", None, None, "relief_m=0.2")
    with pytest.raises(UsageError, match="with other tile_cells"):
        surveyed([path], tmp_path / "work", 100)
    os.utime(path, ns=(1, 1))
    with pytest.raises(UsageError, match="with other files"):
        surveyed([path], tmp_path / "work")


def test_degrees_are_sorted_again_with_the_length_they_have(tmp_path: Path) -> None:
    """The header tells a wrong middle, so the first lattice is not the last one."""
    points = placed(field(), "EPSG:4326")
    points[7, 1] += 0.5
    found = surveyed([write(tmp_path / "a.laz", points, "EPSG:4326")], tmp_path / "work")
    assert found.dropped["stray"] == 1
    assert (found.metric.x_m, found.metric.y_m) == (
        pytest.approx(80_150, rel=2e-3),
        pytest.approx(111_110, rel=2e-3),
    )
    assert found.found[0].zone.area_m2 == pytest.approx(57 * 37 - 6.5 * 6.5, rel=0.03)


def test_the_sources_rules_are_not_tiled(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", FIELD)
    with pytest.raises(UsageError, match="one window in one piece"):
        survey.run(
            [path], tmp_path / "out", parameters("mode=source"), lambda *_: None, survey.Plan(tile_m=9.0)
        )


@pytest.mark.parametrize(
    ("scheduler", "workers", "said"),
    [
        ("tcp://127.0.0.1:1", 2, "exclude each other"),
        (None, 0, "one at least"),
        ("tcp://127.0.0.1:1", None, "no sch"),
    ],
)
def test_an_engine_that_cannot_be_is_one_line(
    monkeypatch: pytest.MonkeyPatch, scheduler: str | None, workers: int | None, said: str
) -> None:
    monkeypatch.setattr("companion.survey.tiled.engine.CONNECT_S", 0.1)
    with pytest.raises(UsageError, match=said), engine(scheduler, workers):
        pass


def test_the_time_left_is_told_and_what_was_done_before_does_not_shorten_it() -> None:
    now = iter(np.arange(0.0, 1000, 10.0))
    told: list[str] = []
    progress = Progress(lambda what, share: told.append(f"{what} {share:.2f}"), lambda: float(next(now)))
    progress.step("sorting", 0.5, 10, done=5)
    progress.at(5)
    progress.at(10)
    progress.step("drawing", 0.5, 10)
    assert told[0] == "sorting 0.00"
    assert told[1] == "sorting 0.25"  # nothing of it is this run's
    assert told[2] == "sorting, 60 s left 0.50"
