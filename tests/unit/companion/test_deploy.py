"""Installation on a vehicle: files where the service expects them, and idempotence."""

from __future__ import annotations

import configparser
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.program import app
from tests import REPOSITORY

DEPLOY = REPOSITORY / "deploy"


def install(root: Path) -> str:
    script = [str(DEPLOY / "install.sh"), "--root", str(root)]
    return subprocess.run(script, check=True, capture_output=True, text=True).stdout


def test_a_second_run_changes_nothing_and_keeps_what_was_set(tmp_path: Path) -> None:
    assert install(tmp_path).count("wrote") == 5
    mine = tmp_path / "etc/slz/slz.env"
    mine.write_text("SLZ_MAVLINK=/dev/ttyUSB7,57600\n")
    assert install(tmp_path) == ""
    assert mine.read_text() == "SLZ_MAVLINK=/dev/ttyUSB7,57600\n"
    (tmp_path / "etc/systemd/system/slz.service").write_text("old")
    assert install(tmp_path) == "wrote /etc/systemd/system/slz.service\n"


@pytest.mark.parametrize(
    ("script", "words"),
    [("install.sh", ["--root"]), ("install.sh", ["--frobnicate"]), ("image.sh", ["mips"])],
)
def test_bad_usage_is_one_line(script: str, words: list[str], tmp_path: Path) -> None:
    done = subprocess.run([str(DEPLOY / script), *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert f"{script}:" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_doctor_of_the_service_gets_its_user_and_the_last_urls(tmp_path: Path) -> None:
    (tmp_path / "slz.env").write_text(
        '# of a test\nSLZ_MAVLINK=udpin:0.0.0.0:1\nSLZ_MAVLINK="/dev/ttyAMA0,921600"\n'
        "SLZ_LIDAR=livox:0.0.0.0:56301?sensor=192.168.1.142\nSLZ_OPTIONS=--land auto --system 1\n"
    )
    (tmp_path / "runuser").write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    (tmp_path / "runuser").chmod(0o755)
    own = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "SLZ_ENV": str(tmp_path / "slz.env")}
    command = [str(DEPLOY / "slz-doctor"), "--seconds", "5"]
    words = subprocess.run(command, env=own, capture_output=True, text=True, check=True).stdout.splitlines()
    assert words[:2] == ["-u", "slz"]
    urls = ["--mavlink", "/dev/ttyAMA0,921600", "--lidar", "livox:0.0.0.0:56301?sensor=192.168.1.142"]
    assert words[words.index("doctor") :] == ["doctor", *urls, "--seconds", "5"]
    unit = (DEPLOY / "slz.service").read_text()
    assert all(word in unit for word in words if "=" in word and word.partition("=")[0].isupper())


def test_the_service_names_variables_and_options_that_there_are() -> None:
    unit = configparser.RawConfigParser(strict=False)
    unit.optionxform = str  # type: ignore[method-assign,assignment]
    unit.read(DEPLOY / "slz.service")
    command = unit["Service"]["ExecStart"]
    told = (DEPLOY / "slz.env").read_text()
    for name in re.findall(r"\$\{?(SLZ_\w+)", command):
        assert re.search(rf"^{name}=", told, re.MULTILINE)
    known = CliRunner().invoke(app, ["run", "--help"], env={"COLUMNS": "200"}).output
    for option in re.findall(r"--[a-z-]+", command + told):
        assert option in known


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_systemd_understands_the_unit() -> None:
    unit = DEPLOY / "slz.service"
    done = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True)
    complaints = [line for line in done.stderr.splitlines() if "slz.service" in line]
    assert [line for line in complaints if "is not executable" not in line] == []


def test_slimming_deletes_tests_and_dialects_that_no_flight_loads(tmp_path: Path) -> None:
    packages = tmp_path / "lib" / "python3.11" / "site-packages"
    kept = ["pymavlink/dialects/v20/ardupilotmega.py", "numpy/_core/tests/_natype.py", "scipy/tests.py"]
    gone = ["pymavlink/dialects/v20/storm32.py", "pymavlink/dialects/v10/all.py", "scipy/a/tests/test_b.py"]
    gone += ["pymavlink/dialects/v09/all.py", "numpy/tests/test_a.py"]
    for name in kept + gone:
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).write_text("x")
    for _ in range(2):
        subprocess.run([sys.executable, str(DEPLOY / "slim.py"), str(tmp_path)], check=True)
        assert sorted(p.relative_to(packages).as_posix() for p in packages.rglob("*.py")) == sorted(kept)
    done = subprocess.run(
        [sys.executable, str(DEPLOY / "slim.py"), str(packages)], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (2, "slim.py: name one virtual environment\n")
