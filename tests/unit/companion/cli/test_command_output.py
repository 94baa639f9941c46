"""Command line: what each command prints."""

from __future__ import annotations

import json
import logging
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from rich.logging import RichHandler

from companion.cli import console
from params import Parameters
from tests.unit.companion.cli.command_line import RUN, Capture, ended, refusal
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.survey.clouds import field, placed, write
from tests.unit.companion.flight.dashboard.test_background_picture import small

REFUSED = """
import json, sys
from companion.cli import program
codes = []
for words in json.loads(sys.argv[1]):
    sys.argv[1:] = words
    try:
        program.main()
    except SystemExit as left:
        codes.append(left.code)
print(codes, "slz loaded" if "slz" in sys.modules else "slz not loaded")
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flight")
    flights.write_tlog(folder / "flight.tlog")
    flights.write_pcap(folder / "lidar.pcap")
    return folder


def test_replay_tells_the_zones_as_a_table_or_as_json(flown: Path, capsys: Capture) -> None:
    words = ["replay", str(flown / "flight.tlog"), "--points", str(flown / "lidar.pcap")]
    words += ["--set", "cell_m=0.5", "--set", "zone_m=200"]
    assert ended(*words) == 0
    table = capsys.readouterr().out
    assert ended(*words, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["windows"] >= 4
    assert f"{told['windows']} windows" in table
    assert "as in flight" not in table  # another program's recording holds no zones to compare
    assert told["zones"]


def test_replay_takes_the_system_that_is_named(flown: Path, capfd: Capture) -> None:
    words = ["replay", str(flown / "flight.tlog"), "--points", str(flown / "lidar.pcap"), "--system"]
    assert ended(*words, "7") == 2
    assert "no autopilot of system 7; of others: system 1 (quadrotor)" in capfd.readouterr().err
    assert ended(*words, "0") == 2
    assert "'--system'" in capfd.readouterr().err


@pytest.mark.parametrize("command", ["run", "doctor"])
def test_run_and_doctor_hand_the_named_system_on(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from companion.flight.doctor import consultation

    named: list[object] = []
    monkeypatch.setattr(
        "companion.cli.vehicle_run.run", lambda *_, **given: named.append(given["system"]) or {}
    )
    monkeypatch.setattr(consultation, "examine", lambda *given: named.append(given[-1]) or [])
    words = ["--mavlink", "udpin:127.0.0.1:0", "--lidar", "livox:127.0.0.1:0", "--state-dir", str(tmp_path)]
    assert ended(command, *words, "--system", "42") == 0
    assert ended(command, *words) == 0
    assert named == [42, None]


@pytest.mark.parametrize("as_json", [False, True])
def test_calibrate_prints_what_to_correct(
    as_json: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    summary = {
        "file": "a.mcap",
        "correction": {"roll_deg": 0.5123, "pitch_deg": -0.25, "yaw_deg": None, "delay_ms": 14.9},
        "standard_error": {"roll_deg": 0.01, "pitch_deg": 0.02, "yaw_deg": None, "delay_ms": 0.4},
        "not_shown": ["yaw_deg"], "before_m": 0.12, "after_m": 0.03, "planes": 400, "returns": 90_000,
        "parameters": {"lidar_roll_deg": 0.512, "lidar_delay_ms": 14.9},
    }  # fmt: skip
    monkeypatch.setattr("companion.desk.calibrate.calibration.run", lambda *_: summary)
    assert ended("calibrate", str(tmp_path / "a.mcap"), *(["--json"] if as_json else [])) == 0
    out = capsys.readouterr().out
    if as_json:
        assert json.loads(out) == summary
    else:
        assert "0.5123" in out or "0.512" in out
        assert "yaw" in out


@pytest.mark.parametrize(("ok", "code"), [(True, 0), (False, 1)])
@pytest.mark.parametrize("as_json", [False, True])
def test_doctor_ends_with_1_where_something_needed_is_wrong(
    ok: bool, code: int, as_json: bool, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    from companion.flight.doctor import consultation

    monkeypatch.setattr(consultation, "examine", lambda *_: [])
    monkeypatch.setattr(consultation, "document", lambda _found: {"ok": ok, "findings": []})
    monkeypatch.setattr(consultation, "table", lambda _found: "the findings")
    words = ["doctor", "--mavlink", "udpin:127.0.0.1:0", "--lidar", "livox:127.0.0.1:0"]
    assert ended(*words, *(["--json"] if as_json else [])) == code
    out = capsys.readouterr().out
    assert json.loads(out)["ok"] is ok if as_json else "the findings" in out


ZONE = {
    "id": 7, "area_m2": 412.4, "certainty": 0.93, "slope_deg": 2.345, "square_side_m": 12.0,
    "lat": 46.1234567, "lon": -122.7654321, "distance_m": 87.6, "bearing_deg": 271.2,
}  # fmt: skip


SAID: dict[str, Any] = {"warnings": [], "why_no_zones": ""}


@pytest.mark.parametrize(
    ("told", "words", "code"),
    [
        ({"identical": 5, "different": 0}, [], 0),
        ({"identical": 4, "different": 1}, [], 1),
        ({"identical": 4, "different": 1}, ["--json"], 1),
        ({"identical": 4, "different": 1}, ["--set", "zone_m=200"], 0),  # other parameters, other zones
        ({"identical": 4, "different": 1}, ["--from", "2"], 0),  # another beginning, other zones
        ({"identical": 0, "different": 0, "source": "flight.tlog"}, [], 0),
    ],
)
def test_replay_ends_with_1_where_the_same_flight_has_other_zones(
    told: dict[str, Any], words: list[str], code: int, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    summary = {"windows": 5, "zones": [ZONE], "cut": "", "lost_messages": 0, **SAID, **told}
    monkeypatch.setattr("companion.desk.replay.replay_run.run", lambda *_: summary)
    assert ended("replay", "a.mcap", *words) == code
    out = capsys.readouterr().out
    if "--json" in words:
        assert json.loads(out) == summary
        return
    assert "46.1234567" in out
    assert ("as in flight" in out) == ("source" not in told)


def test_replay_says_what_the_recording_lacks(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    lacking = {"cut": "it ends within a chunk", "lost_messages": 3}
    said = {"warnings": ["9 of 99 returns have no poses around them"], "why_no_zones": "no window was mapped"}
    summary = {"windows": 0, "identical": 0, "different": 0, "zones": [], **lacking, **said}
    monkeypatch.setattr("companion.desk.replay.replay_run.run", lambda *_: summary)
    assert ended("replay", "a.mcap", "--json") == 0
    told = capsys.readouterr()
    assert json.loads(told.out) == summary
    lost = [
        "slz: a.mcap: 9 of 99 returns have no poses around them",
        "slz: a.mcap: no zone: no window was mapped",
    ]
    assert told.err.splitlines() == lost
    assert ended("replay", "a.mcap") == 0
    assert capsys.readouterr().err.splitlines() == [
        *lost,
        "slz: a.mcap: it is not whole: it ends within a chunk",
        "slz: a.mcap: 3 messages were lost in flight",
    ]


def test_replay_on_the_page_shows_the_file_there(monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> None:
    shown: list[Any] = []
    monkeypatch.setattr("companion.desk.replay.replay_page.show", lambda *given: shown.append(given))
    assert ended("replay", "a.mcap", "--dashboard", "127.0.0.1:0", "--speed", "2") == 0
    ((file, _settings, front, _beside, speed, _handled),) = shown
    assert (file, speed) == (Path("a.mcap"), 2.0)
    assert str(front.address) in capfd.readouterr().err


def test_a_key_or_a_background_of_a_page_that_nobody_opens_is_refused(capfd: Capture, tmp_path: Path) -> None:
    line = refusal(capfd, "replay", "a.mcap", "--dashboard-token", str(tmp_path / "tokens"))
    assert "--dashboard-token goes with --dashboard" in line
    picture = small(tmp_path / "a.tif", [90])
    assert "--background goes with --dashboard" in refusal(
        capfd, "replay", "a.mcap", "--background", str(picture)
    )


@pytest.mark.parametrize("command", [RUN, ["demo"], ["replay", "a.mcap"]])
def test_a_background_that_is_none_is_refused_before_anything_begins(
    capfd: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    monkeypatch.delattr("companion.runtime.kernel_compilation.is_first")  # which every start asks
    (tmp_path / "photo.tif").write_bytes(b"no picture")
    line = refusal(capfd, *command, "--background", str(tmp_path / "photo.tif"))
    assert f"{tmp_path / 'photo.tif'}: it cannot be read as GeoTIFF" in line


def test_map_tells_zones_and_what_it_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def found(_files: object, _out: object, parameters: Parameters, *_: object) -> dict[str, Any]:
        cells_m.append(parameters.cell_m)
        skipped = [{"file": "b.las", "reason": "b.las: it is truncated"}]
        return {"zones": [ZONE], "no_zone": None, "skipped": skipped}

    cells_m: list[float] = []
    cloud = write(tmp_path / "a.las", placed(field(5.0), "EPSG:32610"))
    monkeypatch.setattr("companion.desk.survey.run", found)
    assert ended("map", str(cloud), "--out", str(tmp_path)) == 2
    out, err = capsys.readouterr()
    assert "1 zones, maps in" in out.replace("\n", " ")
    assert "46.1234567" in out
    assert "slz: left out: b.las: it is truncated" in err
    assert ended("map", str(cloud), "--out", str(tmp_path), "--cell-m", "0.25") == 2
    assert cells_m == [0.5, 0.25]


def test_map_tells_why_there_is_no_zone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    cloud = write(tmp_path / "a.las", placed(field(5.0), "EPSG:32610"))
    answer = {"zones": [], "no_zone": "all is too steep", "skipped": []}
    monkeypatch.setattr("companion.desk.survey.run", lambda *_: answer)
    assert ended("map", str(cloud), "--out", str(tmp_path)) == 0
    assert capsys.readouterr().out.endswith("no zone: all is too steep\n")


def test_map_refuses_what_it_cannot_map_in_one_line_before_any_kernel_is_loaded(tmp_path: Path) -> None:
    points = placed(field(5.0), "EPSG:32610")
    good, other = write(tmp_path / "a.las", points), write(tmp_path / "b.las", points, "EPSG:32611")
    nowhere = write(tmp_path / "c.laz", points, None)
    (tmp_path / "README.md").write_text("no cloud")
    (tmp_path / "empty.laz").touch()
    cloud, source = str(good), ["--set", "mode=source"]
    refused = {
        "README.md: it is not a cloud of a kind that is supported": [str(tmp_path / "README.md")],
        "absent.las: no such file": ["absent.las"],
        "empty.laz: it is empty": [str(tmp_path / "empty.laz")],
        "it is a folder: name the clouds in it, such as": [str(tmp_path)],
        "none of 2 files can be used": [str(tmp_path / "README.md"), str(tmp_path)],
        "it is given twice": [cloud, cloud],
        "c.laz: it names no CRS": [str(nowhere)],
        "differs from EPSG:32610": [cloud, str(other)],
        "--crs 'EPSG:1' is unknown": [cloud, "--crs", "EPSG:1"],
        "--vertical-unit 'miles'": [cloud, "--vertical-unit", "miles"],
        "a.las is a file: name a folder": [cloud, "--out", cloud],
        "celm": [cloud, "--set", "celm=1"],
        "--tile-m 0": [cloud, "--tile-m", "0"],
        "--workers 0": [cloud, "--workers", "0"],
        "exclude each other": [cloud, "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"],
        "--corridors: mode=source": [cloud, "--corridors", *source],
        "leave --tile-m": [cloud, "--tile-m", "9", *source],
    }
    given = [["map", "--out", str(tmp_path / "out"), *words] for words in refused.values()]
    ran = subprocess.run(
        [sys.executable, "-c", REFUSED, json.dumps(given)], check=False, capture_output=True, text=True
    )
    missed = [pair for pair in zip(refused, ran.stderr.splitlines(), strict=True) if pair[0] not in pair[1]]
    assert missed == []
    assert (ran.returncode, ran.stdout) == (0, f"{[2] * len(refused)} slz not loaded\n")
    assert not (tmp_path / "out").exists()


def test_nearest_tells_a_table_or_that_there_is_none(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    answers: list[dict[str, Any]] = [
        {"zones": [ZONE, {**ZONE, "id": 9, "slope_deg": None}]},
        {"zones": [], "no_zone": "none here"},
    ]
    monkeypatch.setattr("companion.desk.survey.nearest_zones.nearest", lambda *_: answers[0])
    assert ended("nearest", "46.1", "-122.8", "--json") == 0
    assert json.loads(capsys.readouterr().out) == answers[0]
    assert ended("nearest", "46.1", "-122.8") == 0
    first, second = (line for line in capsys.readouterr().out.splitlines() if "412" in line)
    assert "2.3" in first
    assert "2.3" not in second  # a slope that nobody measured is not told
    answers.pop(0)
    assert ended("nearest", "46.1", "-122.8") == 0
    assert capsys.readouterr().out == "no zone: none here\n"


def test_reproduce_tells_where_the_page_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    summary = {"files": ["results.json", "index.html"]}
    monkeypatch.setattr("companion.desk.reproduce.run", lambda *_: summary)
    assert ended("reproduce", "--out", str(tmp_path)) == 0
    assert capsys.readouterr().out == "see index.html\n"
    assert ended("reproduce", "--out", str(tmp_path), "--json") == 0
    assert json.loads(capsys.readouterr().out) == summary


def test_bench_tells_the_times_of_windows_and_stages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    summary = {"windows": 8, "points_per_s": 123_456, "ms": {"p50": 1.25}, "stage_ms": {"slope": 0.5}}
    monkeypatch.setattr("companion.desk.benchmark.run", lambda _case: summary)
    words = ["bench", "--points", str(tmp_path / "a.f64"), "--cell-m", "1", "--zone-m", "200"]
    words += ["--min-square-m", "5", "--min-boundary", "20"]
    assert ended(*words) == 0
    out = capsys.readouterr().out
    assert re.search(r"p50\W+1\.250", out)
    assert re.search(r"slope\W+0\.500", out)
    assert ended(*words, "--json") == 0
    assert json.loads(capsys.readouterr().out) == summary


def test_on_a_terminal_the_log_is_coloured_and_elsewhere_plain(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    asked: list[dict[str, Any]] = []
    monkeypatch.setattr(logging, "basicConfig", lambda **how: asked.append(how))
    monkeypatch.setattr("companion.desk.calibrate.calibration.run", lambda *_: {})
    for terminal in (True, False):
        monkeypatch.setattr(console, "err", Console(stderr=True, force_terminal=terminal))
        assert ended("calibrate", "a.mcap", "--json") == 0
    on_terminal, elsewhere = asked
    assert isinstance(on_terminal["handlers"][0], RichHandler)
    assert "handlers" not in elsewhere
    assert "%(asctime)s" in elsewhere["format"]


def test_doctor_examines_a_signed_link_with_its_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture
) -> None:
    from companion.flight.doctor import consultation

    given: list[Any] = []
    monkeypatch.setattr(consultation, "examine", lambda *args: given.append(args[4]) or [])
    monkeypatch.setattr(consultation, "document", lambda _found: {"ok": True, "findings": []})
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    words = ["doctor", "--mavlink", "udpin:127.0.0.1:0", "--lidar", "livox:127.0.0.1:0", "--json"]
    assert ended(*words) == 0
    assert ended(*words, "--mavlink-key", str(key), "--state-dir", str(tmp_path)) == 0
    unsigned, signed = given
    assert unsigned is None
    assert signed.secret == bytes(range(32))
    key.chmod(0o644)
    capfd.readouterr()
    assert "others may use it" in refusal(capfd, *words, "--mavlink-key", str(key))
