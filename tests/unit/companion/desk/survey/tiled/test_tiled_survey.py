"""Tiled survey: refusals, resumption and reports."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from distributed import CancelledError, KilledWorker

from companion.cli import program
from companion.desk import survey
from companion.desk.clouds.cloud_source import translated
from companion.desk.clouds.las import Columns, LasSource
from companion.desk.survey.tiled.task_engine import Distributed, Progress, engine
from companion.runtime.errors import CompanionError, UsageError
from tests.unit.companion.desk.survey import packing
from tests.unit.companion.desk.survey.clouds import field, placed, write
from tests.unit.companion.desk.survey.tiled.ground import answer, parameters, surveyed

UTM = "EPSG:32610"
FIELD = placed(field(), UTM)


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])


def command(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["slz", "map", *words])
    with pytest.raises(SystemExit) as ended:
        program.main()
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
    assert {"dsm.tif", "safe.tif"} < {path.name for path in maps[0]}
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


def failing(monkeypatch: pytest.MonkeyPatch, name: str, error: Exception) -> None:
    """Have the points of one file end in an error."""
    whole = LasSource.columns

    def columns(self: LasSource, first: int, stop: int) -> Iterator[Columns]:
        with translated(self.path):
            if self.path.name == name:
                raise error
        yield from whole(self, first, stop)

    monkeypatch.setattr(LasSource, "columns", columns)


def ground_and_tower(folder: Path, crs: str = UTM) -> list[Path]:
    """Write a field, and a tower on it to a file of its own."""
    tower = np.random.default_rng(5).uniform((40, 15, 101), (44, 19, 103), (3000, 3))
    return [
        write(folder / "ground.laz", placed(field(), crs), crs),
        write(folder / "tower.laz", placed(tower, crs), crs),
    ]


@pytest.mark.parametrize("error", [OSError(5, "Input/output error"), MemoryError()])
def test_a_file_that_the_disk_does_not_give_ends_the_survey_which_is_taken_up_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    paths = ground_and_tower(tmp_path)
    with monkeypatch.context() as patch:
        failing(patch, "tower.laz", error)
        with pytest.raises(CompanionError, match=r"tower\.laz: reading it failed.*: run again") as caught:
            surveyed(paths, tmp_path / "work")
    assert not isinstance(caught.value, UsageError)
    found = surveyed(paths, tmp_path / "work")
    assert found.skipped == []
    assert answer(found) == answer(surveyed(paths, tmp_path / "fresh"))


@pytest.mark.parametrize("crs", [UTM, "EPSG:4326"])
def test_what_was_drawn_without_a_file_is_drawn_again_when_the_file_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, crs: str
) -> None:
    paths = ground_and_tower(tmp_path, crs)
    with monkeypatch.context() as patch:
        failing(patch, "tower.laz", ValueError("a bit flipped on the way"))
        without = surveyed(paths, tmp_path / "work")
    assert [one.path.name for one in without.skipped] == ["tower.laz"]
    found, fresh = (surveyed(paths, tmp_path / name) for name in ("work", "fresh"))
    assert found.n_safe < without.n_safe
    assert answer(found) == answer(fresh)
    pictures = [[*one.drawings.rasters, one.drawings.ground] for one in (found, fresh)]
    assert [path.read_bytes() for path in pictures[0]] == [path.read_bytes() for path in pictures[1]]


def test_a_file_that_could_not_be_opened_before_takes_no_other_s_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = ground_and_tower(tmp_path)[::-1]
    before = shutil.copy(paths[0], tmp_path / "copy")
    state = paths[0].stat()
    paths[0].write_bytes(bytes(state.st_size))
    os.utime(paths[0], ns=(state.st_atime_ns, state.st_mtime_ns))
    assert len(surveyed(paths, tmp_path / "work").skipped) == 1
    shutil.copy2(before, paths[0])
    os.utime(paths[0], ns=(state.st_atime_ns, state.st_mtime_ns))
    assert answer(surveyed(paths, tmp_path / "work")) == answer(surveyed(paths, tmp_path / "fresh"))


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


def test_ground_far_from_the_survey_s_edges_is_mapped_as_at_them(tmp_path: Path) -> None:
    """A block whose whole surroundings are of the survey holds the same field as one that is cut off."""
    corner = np.array([3906 * 128.0, 35156 * 128.0, 0.0])  # of a block of 256 cells
    amid_block = field() + corner + np.array([64 - 30, 64 - 20, 0])
    far = corner + np.array([[64 - 180.0, 64 - 180, 100], [64 + 180, 64 + 180, 100]])
    alone, amid = (
        surveyed([write(tmp_path / f"{len(xyz)}.laz", xyz)], tmp_path / str(len(xyz)))
        for xyz in (amid_block, np.vstack([amid_block, far]))
    )
    assert amid.layout.whole.shape == (721, 721)
    assert amid.n_used == alone.n_used + 2
    assert len(amid.found) == len(alone.found) == 1
    assert amid.found[0].zone.cells.tobytes() == alone.found[0].zone.cells.tobytes()
    assert amid.n_safe == alone.n_safe


def test_a_survey_that_ended_as_all_was_done_is_not_done_again(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", FIELD)
    first = surveyed([path], tmp_path / "work")
    before = {file: file.stat().st_mtime_ns for file in (tmp_path / "work").rglob("*") if file.is_file()}
    assert {file.suffix for file in before} >= {".sorted", ".tile", ".zones", ".tif", ".png"}
    assert answer(surveyed([path], tmp_path / "work")) == answer(first)
    assert all(file.stat().st_mtime_ns == at for file, at in before.items())


def test_a_disk_without_room_for_the_points_is_told_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "a.laz", FIELD)
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=6 * len(FIELD)))
    with pytest.raises(UsageError, match=r"0\.0 GB are free.*choose another disk by --out"):
        surveyed([path], tmp_path / "work")
    assert list((tmp_path / "work").iterdir()) == []


def test_a_cloud_in_degrees_across_the_180th_meridian_is_refused_before_it_is_drawn(tmp_path: Path) -> None:
    east = np.random.default_rng(2).uniform((-180, 10, 100), (-179.9997, 10.0004, 100.1), (5000, 3))
    sides = [
        write(tmp_path / f"{k}.laz", points, "EPSG:4326")
        for k, points in enumerate((east, east * (-1, 1, 1)))
    ]
    with pytest.raises(UsageError, match=r"reaches from -180 to 180 in EPSG:4326, as clouds across"):
        surveyed(sides, tmp_path / "work")


@pytest.mark.parametrize(("limit", "most"), [("MOST_CELLS", 1000), ("MOST_LINES", 50)])
def test_maps_of_too_many_cells_are_refused_before_they_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, most: int
) -> None:
    monkeypatch.setattr(f"companion.desk.survey.tiled.tiled_survey.{limit}", most)
    path = write(tmp_path / "a.laz", FIELD)
    with pytest.raises(UsageError, match=r"are too many cells of 0\.5 m: --cell-m [0-9.]+ would do"):
        surveyed([path], tmp_path / "work")
    assert not (tmp_path / "work" / "tiles").exists()


def test_zones_of_a_survey_too_large_for_pictures_are_held_without_their_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "a.laz", FIELD)
    whole = surveyed([path], tmp_path / "work")
    monkeypatch.setattr("companion.desk.survey.tiled.tiled_survey.MOST_HELD", 100)
    (one,) = surveyed([path], tmp_path / "work").found
    assert one.zone.cells.size == 0
    assert one.polygon_m.equals(whole.found[0].polygon_m)
    assert one.zone.area_m2 == whole.found[0].zone.area_m2


def test_a_survey_too_large_for_pictures_has_all_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drawn(*_: object) -> None:
        raise AssertionError("pictures were drawn")

    monkeypatch.setattr("companion.desk.figures.save_maps", drawn)
    monkeypatch.setattr("companion.desk.survey.map_run.MOST_DRAWN", 100)
    told = survey.run([write(tmp_path / "a.laz", FIELD)], tmp_path / "out", parameters(), lambda *_: None)
    assert len(told["zones"]) == 1
    assert {"map.html", "zones.geojson", "safe.tif"} <= {Path(path).name for path in told["outputs"]}


def test_a_cloud_higher_than_any_ground_is_refused_by_name(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", FIELD + np.array([0, 0, 25_000.0]))
    message = rf"a\.laz: none of its {len(FIELD)} points is usable \({len(FIELD)} stray\)"
    with pytest.raises(UsageError, match=message):
        surveyed([path], tmp_path / "work")


def test_a_piece_of_a_file_without_a_usable_point_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = np.repeat([7, 2], [2000, len(FIELD)])
    path = write(tmp_path / "a.laz", np.vstack([FIELD[:2000] + 500.0, FIELD]), classification=kinds)
    monkeypatch.setattr("companion.desk.survey.tiled.plan.PIECE", 2000)
    found = surveyed([path], tmp_path / "work")
    assert (found.n_read, found.n_used, found.dropped["noise"]) == (len(FIELD) + 2000, len(FIELD), 2000)
    assert found.skipped == []
    assert len(found.found) == 1


def test_a_survey_of_one_line_of_points_is_a_row_of_cells_without_a_zone(tmp_path: Path) -> None:
    line = np.column_stack([FIELD[0, 0] + np.arange(0.0, 40, 0.1), *np.full((2, 400), 100.0)])
    found = surveyed([write(tmp_path / "a.laz", line)], tmp_path / "work")
    assert found.layout.whole.shape[0] == 1
    assert found.n_used == 400
    assert found.found == []


def test_the_user_is_told_of_zones_that_were_cut_and_of_coarse_coordinates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("companion.desk.survey.tiled.tiled_zones.MOST_CELLS", 2000)
    monkeypatch.setattr("companion.desk.survey.tiled.tiled_zones.CUT", 64)
    path = tmp_path / "a.pcd"
    path.write_bytes(packing.pcd(FIELD, form="<f4"))
    told = survey.run(
        [path], tmp_path / "out", parameters("cell_m=1.0"), lambda *_: None, survey.MapOptions(UTM)
    )
    assert "32-bit coordinates of this size are 0.5 m apart: store them as 64-bit numbers" in told["warnings"]
    cut = [text for text in told["warnings"] if "are parts of larger ones" in text]
    assert [text.split()[0] for text in cut] == [str(len(told["zones"]))]


def test_the_sources_rules_are_not_tiled(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", FIELD)
    with pytest.raises(UsageError, match="one window in one piece"):
        survey.run(
            [path],
            tmp_path / "out",
            parameters("mode=source"),
            lambda *_: None,
            survey.MapOptions(tile_m=9.0),
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
    monkeypatch.setattr("companion.desk.survey.tiled.task_engine.CONNECT_S", 0.1)
    with pytest.raises(UsageError, match=said), engine(scheduler, workers):
        pass


def test_the_time_left_is_told_and_what_was_done_before_does_not_shorten_it() -> None:
    now = iter(np.arange(0.0, 1000, 10.0))
    told: list[str] = []
    progress = Progress(lambda what, share: told.append(f"{what} {share:.2f}"), lambda: float(next(now)))
    progress.begin_stage("sorting", 0.5, 10, done=5)
    progress.report(5)
    progress.report(10)
    progress.begin_stage("drawing", 0.5, 10)
    assert told[0] == "sorting 0.00"
    assert told[1] == "sorting 0.25"  # nothing of it is this run's
    assert told[2] == "sorting, 60 s left 0.50"


@pytest.mark.parametrize(
    ("passed_s", "left"),
    [(80, "80 s"), (100, "2 min"), (5300, "88 min"), (9000, "2.5 h"), (200_000, "2.3 days")],
)
def test_the_time_left_is_told_in_two_figures(passed_s: float, left: str) -> None:
    now = iter([0.0, 0.0, passed_s])
    told: list[str] = []
    progress = Progress(lambda what, _: told.append(what), lambda: next(now))
    progress.begin_stage("sorting", 1.0, 2)
    progress.report(1)
    assert told == ["sorting", f"sorting, {left} left"]


@pytest.mark.parametrize(
    ("error", "kind", "said"),
    [
        (CancelledError("key"), CompanionError, "the scheduler is gone"),
        (KilledWorker("task", "worker", 10), CompanionError, "workers died again and again at one task"),
        (UsageError("a.laz: its zones.csv cannot be written"), UsageError, "cannot be written"),
    ],
)
def test_what_became_of_workers_is_one_line(
    monkeypatch: pytest.MonkeyPatch, error: Exception, kind: type[Exception], said: str
) -> None:
    class Failed:
        def result(self) -> None:
            raise error

    client = SimpleNamespace(
        submit=lambda *_, **__: Failed(), scheduler_info=lambda n_workers: {"workers": {"one": {}}}
    )
    monkeypatch.setattr("distributed.as_completed", list)
    with pytest.raises(kind, match=said) as caught:
        list(Distributed(client).each(abs, [1, 2]))
    assert "\n" not in str(caught.value)
