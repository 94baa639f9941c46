"""`slz benchmark`: runs, exports, scores and refusals."""

from __future__ import annotations

import csv
import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from companion.cli import program
from companion.desk.open_benchmark.benchmark_case import read_manifest
from companion.desk.open_benchmark.benchmark_run import BenchmarkChoice
from companion.desk.open_benchmark.exchange_folder import write_case
from companion.desk.open_benchmark.leaderboard import better_than_ours, markdown
from companion.desk.open_benchmark.methods import METHODS, OURS, REFERENCE
from tests import REPOSITORY
from tests.unit.companion.desk.open_benchmark.flights_over import case_of

OWN = REPOSITORY / "docs" / "examples" / "own_method.py"
UNCHANGED = {
    "frozen_scenes": 1,
    "frozen_scenes_of_version": 32,
    "other_scenes": [],
    "flights_without_digest": [],
}
Capture = pytest.CaptureFixture[str]


def ended(monkeypatch: pytest.MonkeyPatch, *words: str | Path) -> int:
    monkeypatch.setattr(sys, "argv", ["slz", "benchmark", *map(str, words)])
    with pytest.raises(SystemExit) as left:
        program.main()
    return int(left.value.code or 0)


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    """A folder with one small scene: a level square, half of it said to be unsafe."""
    safe = np.ones((20, 20), np.uint8)
    safe[:, 10:] = 0
    write_case(case_of(safe), tmp_path / "scenes")
    return tmp_path / "scenes"


def test_methods_of_a_file_are_judged_on_scenes_of_a_folder(
    tmp_path: Path, scenes: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    out = tmp_path / "out"
    words = ["--scenes", scenes, "--method-file", OWN, "--method", "all seen", "--out", out, "--json"]
    assert ended(monkeypatch, *words) == 0
    summary = json.loads(capsys.readouterr().out)
    by_name = {method["name"]: method["groups"]["2"] for method in summary["methods"]}
    assert set(by_name) == {"height range", REFERENCE.name}
    assert by_name["height range"]["unsafe_called_safe"] > 0.9  # the truth is made up: the ground is level
    assert by_name["height range"]["by_kind"].keys() == {"wall"}
    assert json.loads((out / "results.json").read_text("utf-8"))["methods"] == summary["methods"]
    page = (out / "index.html").read_text("utf-8")
    assert not re.search(r"(src|href)=|https?:|@import|url\(", page)
    assert "height range" in page
    assert summary["other_scenes"] == ["small"]
    for text in (page, (out / "leaderboard.md").read_text("utf-8")):
        assert "–: Brier: a map without probabilities." in text
        assert "on other scenes than the benchmark" in text
        assert "Other scenes than the frozen ones of version 1: small." in text
        assert "1 scene, " in text
    with (out / "scenes.csv").open(encoding="utf-8", newline="") as file:
        assert [row["method"] for row in csv.DictReader(file)] == ["height range", REFERENCE.name]


def test_exported_truth_scores_as_perfect(
    tmp_path: Path, scenes: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    shutil.copy(scenes / "small" / "truth.tif", tmp_path / "mine.tif")
    words = ["--score", tmp_path / "mine.tif", "--scene", "small", "--scenes", scenes, "--json"]
    assert ended(monkeypatch, *words) == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["unsafe_called_safe"], figures["safe_found"], figures["unknown"]) == (0.0, 1.0, 0.0)
    assert ended(monkeypatch, *words[:-1]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"unsafe called safe, wall\W+0\.0000", shown)
    assert re.search(r"brier\W+– a map without probabilities", shown)


def test_a_scene_of_a_folder_comes_before_the_frozen_one_of_its_name(
    tmp_path: Path, scenes: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    shutil.move(scenes / "small", scenes / "yard")
    shutil.copy(scenes / "yard" / "truth.tif", tmp_path / "mine.tif")
    words = ["--score", tmp_path / "mine.tif", "--scene", "yard", "--scenes", scenes, "--json"]
    assert ended(monkeypatch, *words) == 0
    assert json.loads(capsys.readouterr().out)["as_frozen"] is None


def test_a_frozen_scene_is_exported_with_its_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    words = [
        "--export",
        "--only",
        "kerb-0.1",
        "--density",
        "2",
        "--format",
        "pcd",
        "--out",
        tmp_path,
        "--json",
    ]
    assert ended(monkeypatch, *words) == 0
    written = json.loads(capsys.readouterr().out)
    assert (written["scenes"], written["not_as_frozen"]) == (["kerb-0.1m"], [])
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*") if path.is_file()}
    files = {"scene.json", "truth.tif", "kind.tif", "truth_values.tif", "2/points.pcd", "2/poses.csv"}
    assert names == {f"kerb-0.1m/{name}" for name in files}


@pytest.mark.parametrize(
    ("name", "meant"), [("slz", OURS), ("SLZ paper", "SLZ paper"), ("PX4", "PX4-Avoidance")]
)
def test_a_method_is_chosen_by_its_name_or_by_what_no_other_name_holds(name: str, meant: str) -> None:
    assert [method.name for method in BenchmarkChoice(methods=(name,)).chosen_methods()] == [meant]


def test_scenes_and_methods_are_listed(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    assert ended(monkeypatch, "--list", "--json") == 0
    listed = json.loads(capsys.readouterr().out)
    assert "yard" in listed["scenes"]
    assert [method["name"] for method in listed["methods"]] == [m.name for m in (*METHODS, REFERENCE)]
    assert len(METHODS) >= 8


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "--out DIR is needed"),
        (["--score", "a.tif"], "goes with --scene NAME"),
        (["--score", "a.tif", "--scene", "yard", "--scene", "moon"], "goes with one --scene NAME"),
        (["--score", "a.tif", "--scene", "yard", "--out", "o"], "--score does not go with --out"),
        (["--score", "a.tif", "--scene", "yard", "--export"], "--score does not go with --export"),
        (["--score", "a.tif", "--scene", "yard", "--method", "slz"], "--score does not go with --method"),
        (["--export", "--out", "o", "--method", "slz"], "--export does not go with --method"),
        (["--out", "o", "--scene", "yard"], "--scene NAME goes with --score FILE"),
        (["--score", "a.tif", "--scene", "mars"], "no scene is named 'mars'"),
        (["--out", "o", "--method", "magic"], "'magic' is no method: there are gradient + threshold; plane"),
        (
            ["--out", "o", "--method", "alhat"],
            "'alhat' is of several methods: there are ALHAT, deterministic; ALHAT, probabilistic\n",
        ),
        (["--out", "o", "--only", "mars"], "no scene is named 'mars'"),
        (["--out", "o", "--format", "xyz"], "use laz or pcd"),
        (["--out", "o", "--format", "laz"], "--format goes with --export"),
        (["--score", "a.tif", "--scene", "yard", "--format", "pcd"], "--score does not go with --format"),
        (
            ["--list", "--scenes", "here", "--safe-from", "0"],
            "--list does not go with --scenes and --safe-from",
        ),
        (["--out", "o", "--crs", "EPSG:32633"], "--crs goes with --laz FILE"),
        (["--score", "a.tif", "--scene", "yard", "--crs", "EPSG:32633"], "--crs goes with --laz FILE"),
        (["--out", "o", "--safe-from", "0.9"], "--safe-from goes with --score FILE"),
        (["--out", "o", "--density", "10", "--scenes", "here"], "--density is of the frozen scenes"),
        (["--out", "o", "--scenes", "none"], "holds no folder with a scene.json"),
    ],
)
def test_bad_requests_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture, words: list[str], complaint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert ended(monkeypatch, *words) == 2
    said = capsys.readouterr()
    assert complaint in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        ("1 / 0", "fails at {file}:7: ZeroDivisionError: division by zero (scene small, flight 2)"),
        ("np.linalg.inv(np.zeros((2, 2)))", "fails at {file}:7: LinAlgError: Singular matrix"),
        ("returns.points_m[:] = 0", "method 'm' changes its input at {file}:7, which is read-only"),
        ("returns.sensors_m.sort()", "method 'm' changes its input at {file}:7, which is read-only"),
        ("returns.points_m.flags.writeable = True", "method 'm' fails at {file}:7: ValueError"),
        ("returns.points_m.base.flags.writeable = True", "method 'm' fails at {file}:7"),
        ("raise SystemExit", "method 'm' fails at {file}:7: SystemExit"),
        ("return SafeMap(np.zeros((1, 1), np.uint8))", "its states must be"),
        ("return SafeMap(np.full(task.grid.shape, 7, np.uint8))", "of 0, 1 and 255"),
        ("return SafeMap(np.zeros(task.grid.shape, np.uint8), np.full(task.grid.shape, 2.0))", "of 0 to 1"),
        (
            "return SafeMap(np.zeros(task.grid.shape, np.uint8), np.full(task.grid.shape, np.inf))",
            "of 0 to 1",
        ),
    ],
)
def test_methods_that_fail_end_with_one_line(
    tmp_path: Path, scenes: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture, body: str, complaint: str
) -> None:
    text = (
        "import numpy as np\nfrom companion.desk.open_benchmark.landing_task import SafeMap\n"
        f"class M:\n    name = 'm'\n    source = 's'\n    def judge(self, returns, task):\n        {body}\n"
        "METHOD = M()\n"
    )
    (tmp_path / "m.py").write_text(text, "utf-8")
    words = ["--scenes", scenes, "--method-file", tmp_path / "m.py", "--method", "all seen"]
    assert ended(monkeypatch, *words, "--out", tmp_path / "out") == 1
    said = capsys.readouterr().err
    assert complaint.format(file=tmp_path / "m.py") in said
    assert said.count("\n") == 1


def test_a_method_file_that_ends_the_program_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    (tmp_path / "m.py").write_text("import sys\nsys.exit(0)\n", "utf-8")
    assert ended(monkeypatch, "--method-file", tmp_path / "m.py", "--out", tmp_path / "out") == 2
    assert "m.py: it fails (SystemExit: 0)" in capsys.readouterr().err


def figures(missed: float, found: float, ms: float) -> dict[str, object]:
    kinds = {"pole": {"unsafe": 10, "unsafe_called_safe": missed}}
    shares = {"unsafe_called_safe": missed, "safe_is_unsafe": missed / 2, "safe_found": found, "unknown": 0.0}
    return {**shares, "by_kind": kinds, "brier": None, "reliability": [], "operating_curve": [], "ms": ms}


def test_the_page_says_where_another_method_wins_and_not_where_one_finds_nothing() -> None:
    groups = {
        OURS: figures(0.05, 0.9, 100.0),
        "other": figures(0.02, 0.8, 20.0),
        "timid": figures(0.0, 0.1, 1.0),
    }
    document = {
        "version": 1,
        "timing": "",
        "scenes": 1,
        "seconds": 1.0,
        "machine": "",
        "not_as_frozen": ["yard"],
        **UNCHANGED,
        "methods": [{"name": name, "source": "", "groups": {"20": of}} for name, of in groups.items()],
    }
    lines = better_than_ours(document)
    assert "20 pulses/m²: unsafe called safe: other 2.00 %, ours 5.00 %" in lines
    assert "20 pulses/m²: unsafe called safe, pole: other 2.00 %, ours 5.00 %" in lines
    assert "20 pulses/m²: time: other 20 ms, ours 100 ms" in lines
    assert not any("safe found" in line or "timid" in line for line in lines)
    page = markdown(document)
    assert "| timid | 0.00 |" in page
    assert "| other | **2.00** |" in page
    assert "Not as frozen on this machine: yard." in page


def test_methods_that_find_less_than_half_come_after_the_others_and_the_reference_last() -> None:
    groups = {
        REFERENCE.name: figures(0.9, 1.0, 1.0),
        "nothing": figures(0.0, 0.0, 1.0),
        "timid": figures(0.01, 0.499, 1.0),
        OURS: figures(0.05, 0.9, 100.0),
        "half": figures(0.06, 0.5, 20.0),
    }
    methods = [{"name": name, "source": "", "groups": {"20": of}} for name, of in groups.items()]
    document = {"version": 1, "timing": "", "scenes": 1, "seconds": 1.0, "machine": "", "not_as_frozen": []}
    document |= UNCHANGED
    rows = re.findall(r"^\| ([^|]+) \|", markdown(document | {"methods": methods}), re.MULTILINE)
    expected = [OURS, "half", "nothing", "timid", REFERENCE.name]
    assert [row for row in rows if row in groups] == 2 * expected  # both tables


def test_names_of_others_are_shown_as_they_are() -> None:
    name, source = "a|b <script>", "[click](javascript:x) `<img>`\n# big"
    methods = [{"name": name, "source": source, "groups": {"x|y": figures(0.1, 0.9, 1.0)}}]
    document = {"version": 1, "timing": "", "scenes": 2, "seconds": 1.0, "machine": "", "not_as_frozen": []}
    page = markdown(document | UNCHANGED | {"methods": methods})
    assert "| a\\|b &lt;script&gt; | **10.0** |" in page
    assert r"- a\|b &lt;script&gt;: \[click\](javascript:x) \`&lt;img&gt;\` # big" in page
    assert "<" not in page
    assert "2 scenes, " in page


def test_a_scene_that_differs_from_the_manifest_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    other = {name: entry | {"truth_sha256": "0"} for name, entry in read_manifest().items()}
    monkeypatch.setattr("companion.desk.open_benchmark.benchmark_case.read_manifest", lambda: other)
    words = ["--only", "plane-0", "--density", "1", "--out", tmp_path / "out"]
    assert ended(monkeypatch, "--export", *words) == 0
    assert "not as frozen on this machine: plane-0deg" in " ".join(capsys.readouterr().out.split())
    truth = tmp_path / "out" / "plane-0deg" / "truth.tif"
    assert ended(monkeypatch, "--score", truth, "--scene", "plane-0deg", "--json") == 0
    assert json.loads(capsys.readouterr().out)["as_frozen"] is False
