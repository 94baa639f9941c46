"""Recording of answers: files by content, without run-dependent values."""

from __future__ import annotations

import os
import pickle
import socket
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import laspy
import numpy as np
import pytest
import rasterio
from PIL import Image, PngImagePlugin

from tests import REPOSITORY
from tests.answers import program
from tests.answers.__main__ import main
from tests.answers.decoding import decoded, decoded_folder
from tests.answers.differences import differences
from tests.answers.flown import reports, streams
from tests.answers.mavlink_frames import datagrams
from tests.answers.page import sections
from tests.answers.parts import PARTS
from tests.answers.program import OUTPUT, ProgramError, entry_point, environment
from tests.answers.recorder import Recorder
from tests.answers.reports import plain
from tests.answers.store import Store
from tests.answers.variable import REMOVED, normalised


def paths(one: Path, other: Path) -> list[str]:
    return [found.path for found in differences(decoded(one), decoded(other))]


def geotiff(path: Path, cells: np.ndarray, date: str = "2026:01:01 00:00:00") -> Path:
    own = {"driver": "GTiff", "width": 3, "height": 2, "count": 1, "dtype": cells.dtype, "crs": "EPSG:32633"}
    with rasterio.open(path, "w", transform=rasterio.Affine(1, 0, 5e5, 0, -1, 5e6), **own) as file:
        file.write(cells, 1)
        file.update_tags(TIFFTAG_DATETIME=date)
    return path


def test_a_raster_is_compared_by_cells_and_metadata(tmp_path: Path) -> None:
    cells = np.arange(6, dtype=np.float32).reshape(2, 3)
    one = geotiff(tmp_path / "one.tif", cells)
    assert paths(one, geotiff(tmp_path / "dated.tif", cells, "2027:02:03 04:05:06")) == []
    cells[1, 2] = 7
    assert paths(one, geotiff(tmp_path / "other.tif", cells)) == ["bands.1.cells[1, 2]"]


def test_a_picture_is_compared_by_pixels(tmp_path: Path) -> None:
    pixels = np.zeros((4, 5, 3), np.uint8)
    texts = PngImagePlugin.PngInfo()
    texts.add_text("Software", "a drawing library, version 2")
    Image.fromarray(pixels).save(tmp_path / "one.png")
    Image.fromarray(pixels).save(tmp_path / "same.png", compress_level=1, pnginfo=texts)
    pixels[2, 3, 1] = 1
    Image.fromarray(pixels).save(tmp_path / "other.png")
    assert paths(tmp_path / "one.png", tmp_path / "same.png") == []
    assert paths(tmp_path / "one.png", tmp_path / "other.png") == ["pixels[2, 3, 1]"]


def test_a_cloud_is_compared_by_its_points(tmp_path: Path) -> None:
    for name, height in (("one.laz", 1.0), ("other.laz", 1.5)):
        cloud = laspy.create(point_format=6)
        cloud.x, cloud.y, cloud.z = np.arange(3.0), np.arange(3.0), np.array([0.0, height, 2.0])
        cloud.write(tmp_path / name)
    assert paths(tmp_path / "one.laz", tmp_path / "other.laz") == ["dimensions.Z[1]"]


def test_text_is_compared_by_lines_and_other_files_by_bytes(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x,y\n1,2\n")
    (tmp_path / "b.fgb").write_bytes(b"\xff\x00")
    found = decoded_folder(tmp_path)
    assert found["a.csv"] == ["x,y", "1,2"]
    assert found["b.fgb"].tolist() == [255, 0]


def test_arrays_of_a_survey_are_kept_as_digests(tmp_path: Path) -> None:
    for name, last in (("one", 3.0), ("other", 4.0)):
        np.savez(tmp_path / name, points=np.array([1.0, 2.0, last]), count=np.arange(2))
    assert decoded(tmp_path / "one.npz")["points"].startswith("float64[3] ")
    assert paths(tmp_path / "one.npz", tmp_path / "other.npz") == ["points"]


def test_cells_of_a_page_have_paths(tmp_path: Path) -> None:
    table = "| scene | median | zones |\n|---|---|---|\n| 1 hill | 7 | 3 |\n"
    page = f"# Title\ntext\n\n## Time per window\n\n{table}"
    (tmp_path / "index.md").write_text(page)
    (tmp_path / "other.md").write_text(page.replace("3 |", "4 |"))
    assert paths(tmp_path / "index.md", tmp_path / "other.md") == ["Time per window[3].1 hill.zones"]
    tree = normalised("reproduce/files/index.md", decoded(tmp_path / "index.md"), {})
    assert tree["Time per window"][3] == {"1 hill": {"median": REMOVED, "zones": "3"}}
    assert tree["Title"] == ["text", ""]


def test_headings_and_columns_of_one_name_are_numbered() -> None:
    page = sections("## A\n| x | y | y |\n|---|---|---|\n| 1 | 2 | 3 |\n## A\nb")
    assert page["A"][2] == {"1": {"y": "2", "y (2)": "3"}}
    assert page["A (2)"] == ["b"]


def test_an_answer_may_be_left_out_as_a_whole() -> None:
    assert normalised("reproduce/files/time_per_window.png", {"pixels": np.zeros(2)}, {}) == REMOVED


def test_times_and_temporary_folders_are_left_out(tmp_path: Path) -> None:
    tree = {"latency_ms": {"p50": 3.0}, "maps": {"dsm": f"{tmp_path}/dsm.png"}, "ms": {"median": 1.0}}
    assert normalised("flights/plain/answer", tree, {tmp_path: "WORK"}) == {
        "latency_ms": REMOVED,
        "maps": {"dsm": "WORK/dsm.png"},
        "ms": {"median": 1.0},
    }
    assert normalised("bench/a/default", tree, {})["ms"] == {"median": REMOVED}
    assert normalised("flights/plain/reports", [{"stage_ms": {"zones": 1.0}, "n_used": 4}], {}) == [
        {"stage_ms": REMOVED, "n_used": 4}
    ]


class Colour(Enum):
    """An enumeration."""

    RED = 1


@dataclass
class Inner:
    """A dataclass with an array."""

    cells: np.ndarray
    _hidden: int = 0


def test_a_report_becomes_plain_values() -> None:
    tree = plain({"zones": (Inner(np.zeros(2)),), "state": Colour.RED, "n": np.int64(3), "of": object()})
    other = plain(Inner(np.array([0.0, -0.0])))
    assert tree["zones"][0]["cells"].startswith("float64[2] ")
    assert tree["zones"][0] != other
    assert list(other) == ["cells"]
    assert (tree["state"], tree["n"], tree["of"]) == ("RED", 3, "object")


def test_the_probe_notes_datagrams_of_every_process(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        code = (
            "import socket; s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\n"
            f"for data in (b'\\xfdone', b'two', b'\\xfdthree'): s.sendto(data, {listener.getsockname()})"
        )
        for _ in range(2):
            command = [sys.executable, "-c", code]
            subprocess.run(command, env=environment(tmp_path / "state", tmp_path), check=True)
    found = streams(tmp_path)
    assert list(found) == ["process_0.mavlink_0", "process_1.mavlink_0"]
    assert datagrams(found["process_1.mavlink_0"]) == [b"\xfdone", b"two", b"\xfdthree"]


def test_the_probe_notes_what_the_pipeline_returns(tmp_path: Path) -> None:
    code = "import slz; slz.Pipeline.process.__name__ == 'watched' or exit(1)"
    command = [sys.executable, "-c", code]
    subprocess.run(command, env=environment(tmp_path / "state", tmp_path), check=True)
    (file,) = tmp_path.glob("*.reports")
    file.write_bytes(pickle.dumps({"n_used": 1}) + pickle.dumps({"n_used": 2}))
    assert reports(tmp_path) == [{"n_used": 1}, {"n_used": 2}]


def test_the_program_is_the_one_that_pyproject_names(tmp_path: Path) -> None:
    module = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["scripts"]["slz"].split(
        ":"
    )[0]
    assert f"from {module} import" in entry_point()
    own = environment(tmp_path)
    assert own["PYTHONPATH"].split(os.pathsep) == [str(REPOSITORY)]
    assert OUTPUT not in own


def test_what_was_recorded_before_a_program_failed_is_kept_and_the_part_is_marked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(recorder: Recorder) -> None:
        recorder.add("first", {"x": 1})
        raise ProgramError("exit code 1")

    monkeypatch.setitem(PARTS, "parameters", failing)
    assert main(["record", "--out", str(tmp_path), "--part", "parameters"]) == 1
    assert "parameters: failed: exit code 1" in capsys.readouterr().err
    store = Store(tmp_path)
    assert list(store.digests) == ["parameters/first"]
    assert store.manifest["parts"]["parameters"] == {"failed": True}


def test_clouds_that_are_absent_are_left_out_with_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tests.answers.parts.clouds.DATA", tmp_path / "nowhere")
    assert main(["record", "--out", str(tmp_path / "out"), "--part", "map"]) == 0
    assert "left out: lake: " in capsys.readouterr().out
    assert len(Store(tmp_path / "out").manifest["parts"]["map"]["skipped"]) > 1


def test_a_program_that_prints_no_json_has_failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "entry_point", lambda: "print('words')")
    with pytest.raises(ProgramError, match="no JSON"):
        program.slz(["params"], tmp_path)
    monkeypatch.setattr(program, "entry_point", lambda: "raise SystemExit(3)")
    with pytest.raises(ProgramError, match="exit code 3"):
        program.slz(["params"], tmp_path)
