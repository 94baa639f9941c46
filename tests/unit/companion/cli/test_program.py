"""Command line: refusals, their texts and exit codes."""

from __future__ import annotations

import io
import json
import re
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import params
from companion.cli import program, vehicle_run
from companion.desk import figures
from companion.flight.dashboard.page import PageEndpoint
from companion.runtime.event import Event
from params import Parameters
from tests import REPOSITORY
from tests.ports import free_port
from tests.unit.companion.cli.command_line import RUN, Capture, ended, refusal
from tests.unit.companion.desk.survey.clouds import field, placed, write

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
