"""Command line: refusals, their texts and exit codes."""

from __future__ import annotations

import io
import json
import logging
import re
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console
from rich.logging import RichHandler

import params
from companion.cli import console, program, vehicle_run
from companion.desk import figures
from companion.flight.dashboard.page import PageEndpoint
from companion.runtime.event import Event
from params import Parameters
from tests import REPOSITORY
from tests.ports import free_port
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
RUN = ["run", "--mavlink", "udpin:127.0.0.1:0", "--lidar", "livox:127.0.0.1:0"]
Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the test run's own arguments and logging as they are."""
    monkeypatch.setattr(sys, "argv", ["slz"])
    monkeypatch.setattr(logging, "basicConfig", lambda **_: None)


def ended(*words: str) -> int:
    """Run the command line and return its exit code."""
    sys.argv[1:] = words
    with pytest.raises(SystemExit) as left:
        program.main()
    return int(left.value.code or 0)


def refusal(capfd: Capture, *words: str) -> str:
    """Run the command line, which must end with exit code 2 and one line on stderr; return the line."""
    assert ended(*words) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("slz: ")
    assert err.count("\n") == 1
    return err


# ---- any command ---------------------------------------------------------------------------------------


def test_a_terminal_without_some_characters_shows_question_marks(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(program, "app", lambda *_, **__: print("12 m², 3°"))
    assert ended("map") == 0
    out.flush()
    assert out.buffer.getvalue() == b"12 m?, 3?\n"  # type: ignore[attr-defined]


def test_kernels_that_no_folder_takes_are_one_line(monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> None:
    def demo(*_: object, **__: object) -> int:
        raise RuntimeError("cannot cache function 'minimum': no locator available for file 'minimum.py'")

    monkeypatch.setattr(program, "app", demo)
    assert "set NUMBA_CACHE_DIR" in refusal(capfd, "demo")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["fly"], "'fly'"),
        (["--fast"], "--fast"),
        (["demo", "--fast"], "no such option: --fast"),
        (["demo", "--seed", "-1"], "invalid value for '--seed'"),
        (["demo", "--seed", "one"], "invalid value for '--seed'"),
        (["run", "--lidar", "livox:127.0.0.1:0"], "missing option '--mavlink' ('slz run --help' shows"),
        (["map", "--out", "maps"], "missing argument"),
        (["params", "surplus"], "surplus"),
    ],
)
def test_bad_arguments_are_one_line_and_exit_code_2(capfd: Capture, words: list[str], complaint: str) -> None:
    assert complaint in refusal(capfd, *words)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--mavlink", "carrier:pigeon", "--lidar", "livox:127.0.0.1:{free}"], "carrier"),
        (["--mavlink", "udpin:127.0.0.1:{free}", "--lidar", "sonar:127.0.0.1:1"], "sonar"),
        (["--mavlink", "udpin:127.0.0.1:{taken}", "--lidar", "livox:127.0.0.1:{free}"], "in use"),
        (["--mavlink", "udpin:127.0.0.1:{free}", "--lidar", "livox:127.0.0.1:{taken}"], "in use"),
        ([*RUN[1:], "--set", "celm=1"], "celm"),
        ([*RUN[1:], "--set", "cell_m=-1"], "cell_m"),
        ([*RUN[1:], "--land", "now"], "--land"),
        ([*RUN[1:], "--set", "odometry=autopilot"], "led a vehicle away"),
        ([*RUN[1:], "--set", "SLZ_MODE=source"], "calls unsafe ground safe"),
    ],
)
def test_a_flight_that_cannot_begin_is_refused_in_one_line(
    capfd: Capture, words: list[str], complaint: str
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        taken, free = other.getsockname()[1], free_port()
        given = [word.format(taken=taken, free=free) for word in words]
        assert complaint in refusal(capfd, "run", *given)


@pytest.mark.parametrize("command", [RUN, ["demo", "--headless"]])
@pytest.mark.parametrize("line", ['odometry = "autopilot"', 'mode = "source"'])
def test_a_profile_with_a_value_that_must_not_fly_is_refused(
    command: list[str], line: str, tmp_path: Path, capfd: Capture
) -> None:
    profile = tmp_path / "mine.toml"
    profile.write_text(line)
    words = [*command, "--profile", str(profile)]
    if command is RUN:
        words += ["--state-dir", str(tmp_path)]
    assert "must not fly" in refusal(capfd, *words)


def test_help_is_shown_when_asked_for_and_when_nothing_is(capfd: Capture) -> None:
    assert ended("--help") == 0
    asked = capfd.readouterr()
    assert ended() == 2
    assert asked == capfd.readouterr()
    assert "demo" in asked.out
    assert asked.err == ""
    assert ended("map", "--help") == 0
    assert "--min-square-m" in capfd.readouterr().out
    assert ended("demo", "--help") == 0
    shown = capfd.readouterr().out
    assert "[default: stadium]" in shown
    assert "lidar+radar" in shown


# ---- slz run -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("below", ["", "deeper/maps"])
def test_run_refuses_a_folder_that_is_a_file_before_it_starts(
    tmp_path: Path, capfd: Capture, below: str
) -> None:
    file = tmp_path / "maps"
    file.write_text("in the way")
    assert f"--out {file / below}" in refusal(capfd, *RUN, "--out", str(file / below))


def test_a_ros_node_needs_zenoh_and_a_topic_a_node(capfd: Capture) -> None:
    assert "--ros2 'dds' is not understood" in refusal(capfd, *RUN, "--ros2", "dds")
    topic = ["run", "--mavlink", f"udpin:127.0.0.1:{free_port()}", "--lidar", "ros2:/points"]
    assert "needs --ros2" in refusal(capfd, *topic)


def test_run_refuses_a_folder_that_cannot_be_written(capfd: Capture) -> None:
    assert "--out /proc/self/maps-of-the-flight" in refusal(
        capfd, *RUN, "--out", "/proc/self/maps-of-the-flight"
    )
    assert "--out /proc cannot be written" in refusal(capfd, *RUN, "--out", "/proc")


def test_run_refuses_a_key_that_others_may_read(capfd: Capture, tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text("correct horse\n")
    key.chmod(0o644)
    line = refusal(capfd, *RUN, "--state-dir", str(tmp_path), "--mavlink-key", str(key))
    assert "others may use it (mode 644)" in line


def test_run_refuses_a_state_that_is_broken_or_cannot_be_written(capfd: Capture, tmp_path: Path) -> None:
    (tmp_path / "parameters.toml").write_text("final_height_m = 1000\n")
    line = refusal(capfd, *RUN, "--state-dir", str(tmp_path))
    assert "parameters.toml: parameter final_height_m = 1000 is refused" in line
    assert "--state-dir" in refusal(capfd, *RUN, "--state-dir", "/proc/self/maps/state")


class Flown:
    """A companion whose flight is over at once."""

    def __init__(self, *_: Any, **__: Any) -> None:
        self.summary = {"landed": True}
        self.on_ready: Event[[]] = Event()

    async def run(self) -> None: ...

    def stop(self) -> None: ...


def test_a_picture_that_cannot_be_drawn_loses_no_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(vehicle_run, "Companion", Flown)
    monkeypatch.setattr(figures, "draw_flight", fail)
    assert ended(*RUN, "--out", str(tmp_path / "maps"), "--json") == 0
    assert json.loads(capfd.readouterr().out) == {"landed": True}
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert "No space left" in record.getMessage()


def test_a_flight_without_maps_draws_nothing(tmp_path: Path) -> None:
    unmapped: Any = SimpleNamespace(maps=None, parameters=Parameters())
    assert figures.draw_flight(unmapped, tmp_path) == {}


# ---- slz map -------------------------------------------------------------------------------------------


def test_a_truncated_cloud_is_one_line(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", placed(field(2.0), "EPSG:32610"))
    path.write_bytes(path.read_bytes()[:-300])
    done = subprocess.run(
        [sys.executable, "-m", "companion.cli", "map", str(path), "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert done.stderr.startswith(f"slz: {path}: it is truncated")


def test_a_log_that_no_terminal_shows_is_plain_lines(tmp_path: Path) -> None:
    path = write(tmp_path / "a.las", placed(field(5.0), "EPSG:32610"))
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "companion.cli",
            "map",
            str(path),
            "--out",
            str(tmp_path / "out"),
            "--json",
        ],
        capture_output=True,
        text=True,
        timeout=100,
    )
    (line, *_) = done.stderr.splitlines()
    assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} WARNING companion\.desk\.survey\.map_run: ", line)
    assert [logged.split("map_run: ")[1] for logged in done.stderr.splitlines()] == json.loads(done.stdout)[
        "warnings"
    ]


# ---- slz demo ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--scene", "moon", "stadium"),
        ("--sensor", "camera", "use lidar"),
        ("--speedup", "inf", "a number from 0 to 1000"),
        ("--speedup", "nan", "a number from 0 to 1000"),
        ("--speedup", "-1", "a number from 0 to 1000"),
        ("--intruder", "tank@5", "car@15"),
        ("--intruder", "car@nan", "up to 200 m"),
        ("--intruder", "car@1e9", "up to 200 m"),
        ("--intruder", "car@9,car@8", "each once"),
        ("--intruder", "car@high", "up to 200 m"),
        ("--point-rate", "0", "from 1000 to 2000000"),
        ("--point-rate", "nan", "from 1000 to 2000000"),
        ("--point-rate", "inf", "from 1000 to 2000000"),
        ("--point-rate", "1e12", "from 1000 to 2000000"),
        ("--point-rate", "9600", "divides 10^9"),
        ("--point-rate", "30000", "25000 or 31250"),
        ("--limit-s", "nan", "from 1 to 86400"),
        ("--limit-s", "0", "from 1 to 86400"),
        ("--limit-s", "inf", "from 1 to 86400"),
    ],
)
def test_demo_refuses_what_means_nothing_before_anything_starts(
    tmp_path: Path, capfd: Capture, option: str, value: str, words: str
) -> None:
    out = tmp_path / "maps"
    line = refusal(capfd, "demo", "--out", str(out), option, value)
    assert option in line
    assert words in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "live", "page"),
    [
        ([], True, True),
        (["--headless"], False, False),
        (["--headless", "--dashboard", "127.0.0.1:0"], False, True),
    ],
)
def test_demo_serves_the_page_unless_it_is_headless_and_nobody_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture, words: list[str], live: bool, page: bool
) -> None:
    def flown(*_: object, live: bool, front: PageEndpoint | None) -> dict[str, object]:
        shown.append((live, front is not None))
        return {"landed": True, "touchdown_safe": True}

    shown: list[tuple[bool, bool]] = []
    monkeypatch.setattr("companion.desk.demo.demonstration.fly", flown)
    assert ended("demo", "--json", "--out", str(tmp_path), *words) == 0
    assert shown == [(live, page)]
    assert ("the pilot's page: http://127.0.0.1:" in capfd.readouterr().err) == page


@pytest.mark.parametrize(("landed", "safe", "code"), [(True, True, 0), (True, False, 1), (False, False, 1)])
def test_demo_ends_with_1_unless_it_landed_on_safe_ground(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture, landed: bool, safe: bool, code: int
) -> None:
    summary = {"landed": landed, "touchdown_safe": safe}
    monkeypatch.setattr("companion.desk.demo.demonstration.fly", lambda *_, **__: summary)
    monkeypatch.setattr(
        "companion.desk.demo.flight_files.table", lambda told: f"how it ended: {told['touchdown_safe']}"
    )
    assert ended("demo", "--headless") == code
    assert f"how it ended: {safe}" in capsys.readouterr().out


# ---- slz sim -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("given", [["--help"], ["--", "--help"], ["--seed", "2", "--wind=3"]])
def test_sim_hands_its_arguments_on(monkeypatch: pytest.MonkeyPatch, given: list[str]) -> None:
    calls: list[list[str]] = []
    monkeypatch.setattr("os.execv", lambda _, words: calls.append(words[1:]))
    assert ended("sim", *given) == 0
    assert calls == [["-m", "sitl", *(word for word in given if word != "--")]]


# ---- slz params ----------------------------------------------------------------------------------------


def test_params_are_listed_whole_in_a_pipe(capfd: Capture) -> None:
    assert ended("params") == 0
    listed = capfd.readouterr().out
    for row in params.rows():
        (line,) = (line for line in listed.splitlines() if line.startswith(f"│ {row.name} "))
        assert row.mavlink in line
        assert row.sentence in line


@pytest.mark.parametrize(
    "file", sorted((REPOSITORY / "params" / "autopilot").iterdir()), ids=lambda f: f.stem
)
def test_params_prints_the_files_of_the_autopilot(file: Path, capfd: Capture) -> None:
    assert file.name in params.AUTOPILOT_FILES
    assert ended("params", "--autopilot", file.stem) == 0
    assert capfd.readouterr().out == file.read_text("utf-8")
    assert ended("params", "--autopilot", file.name, "--json") == 0
    assert json.loads(capfd.readouterr().out) == {"file": file.name, "text": file.read_text("utf-8")}


def test_params_names_the_files_of_the_autopilot(capfd: Capture) -> None:
    assert ended("params", "--autopilot", "ardupilot") == 2
    there = "arducopter, arducopter_odometry, px4, px4_odometry, px4_sih"
    assert capfd.readouterr() == ("", f"slz: no parameter file 'ardupilot': there are {there}\n")


# ---- what a command prints ------------------------------------------------------------------------


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
