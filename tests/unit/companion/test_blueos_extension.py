"""BlueOS extension: labels by the rules of BlueOS-Extensions-Repository and Kraken, and its start script."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from companion.cli.program import app
from tests import REPOSITORY

FOLDER = REPOSITORY / "deploy" / "blueos"
# blueos_repository/extension/models.py and README.md of BlueOS-Extensions-Repository.
TYPES = {"device-integration", "example", "theme", "other", "tool", "education"}
MOST_TAGS = 10
# core/services/helper/main.py of BlueOS: of its own services, or not looked at.
TAKEN = {22, 80, 81, 2748, 2770, 5201, 5555, 5777, 6020, 6021, 6030, 6040, 7000, 7777, 8000, 8081, 8088, 8554}
TAKEN |= {9000, 9002, 9090, 9100, 9101, 9110, 9111, 9120, 9134, 9150, 9152, 27353}


def instructions() -> list[str]:
    """Return the lines of the Containerfile, continued ones joined."""
    return (FOLDER / "Containerfile").read_text().replace("\\\n", "").splitlines()


def pairs(instruction: str) -> dict[str, str]:
    """Return NAME=value of all instructions of a kind; arguments replaced in them but in single quotes."""
    found: dict[str, str] = {}
    for line in instructions():
        name, _, rest = line.partition(" ")
        if name == instruction:
            for word in shlex.split(rest):
                key, _, value = word.partition("=")
                found[key] = value if "='" in rest else _replaced(value)
    return found


def _replaced(value: str) -> str:
    return value.replace("${SITE}", "https://slz.example")


LABELS = pairs("LABEL")


def label(name: str) -> Any:
    return json.loads(LABELS[name])


def test_every_label_has_the_form_that_blueos_reads() -> None:
    assert LABELS["version"] == version("slz")
    assert re.fullmatch(r"\d+\.\d+\.\d+", LABELS["version"])
    assert LABELS["type"] in TYPES
    assert re.fullmatch(r"core >= \d+\.\d+", LABELS["requirements"])
    assert LABELS["readme"].startswith("https://")
    assert "{tag}" in LABELS["readme"]
    tags = label("tags")
    assert 0 < len(tags) <= MOST_TAGS
    assert [tag for tag in tags if not (tag.replace("-", "").isalnum() and tag == tag.lower())] == []
    for author in label("authors"):
        assert set(author) == {"name", "email"}
    assert {"name"} <= set(label("company")) <= {"name", "about", "email"}
    links = label("links")
    assert {"website", "documentation", "support"} <= set(links)
    assert all(isinstance(link, str) for link in links.values())


def test_the_container_gets_its_port_its_folder_and_no_more() -> None:
    asked = label("permissions")
    host = asked["HostConfig"]
    assert set(asked) == {"ExposedPorts", "Env", "HostConfig"}
    assert set(host) == {"NetworkMode", "CapAdd", "Binds"}
    assert host["Binds"] == ["/usr/blueos/extensions/slz:/data:rw"]
    given = dict(line.split("=", 1) for line in asked["Env"])
    assert given == pairs("ENV")
    port = int(given["SLZ_PAGE"].rpartition(":")[2])
    assert asked["ExposedPorts"] == {f"{port}/tcp": {}}
    assert f"EXPOSE {port}/tcp" in instructions()
    assert port not in TAKEN


@pytest.fixture
def start(tmp_path: Path) -> Any:
    """Run start.sh with stand-ins for the programs that need root; return what slz is started with."""
    programs = tmp_path / "bin"
    programs.mkdir()
    stand_ins = {
        "install": 'for last; do case "$last" in /*) mkdir -p "$last";; esac; done',
        "chown": ":",
        "setpriv": '[ "$1" = --dump ] || { printf "%s\\n" "$@"; env >> "$SLZ_DATA/env"; }',
    }
    for name, text in stand_ins.items():
        (programs / name).write_text(f"#!/bin/sh\n{text}\n")
        (programs / name).chmod(0o755)
    own = {**os.environ, **pairs("ENV"), "PATH": f"{programs}:{os.environ['PATH']}"}

    def run(*words: str, **more: str) -> list[str]:
        environment = {**own, "SLZ_DATA": str(tmp_path / "data"), **more}
        command = [str(FOLDER / "start.sh"), *words]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return done.stdout.splitlines()

    return run


def test_the_start_makes_tokens_once_and_runs_slz_with_options_that_there_are(
    start: Any, tmp_path: Path
) -> None:
    tokens = tmp_path / "data" / "tokens"
    first = start()
    made = tokens.read_text()
    assert re.fullmatch(r"operator [0-9a-f]{24}\nviewer   [0-9a-f]{24}\n", made)
    assert tokens.stat().st_mode & 0o777 == 0o600
    assert made.splitlines()[0] in first
    second = start(SLZ_OPTIONS="--land ask --profile helicopter")
    assert tokens.read_text() == made
    assert not any("operator" in line for line in second)
    command = second[second.index("slz") + 1 :]
    assert command[:3] == ["run", "--mavlink", "tcp:127.0.0.1:5777"]
    assert command[-4:] == ["--land", "ask", "--profile", "helicopter"]
    assert command[command.index("--dashboard-token") + 1] == str(tokens)
    known = CliRunner().invoke(app, ["run", "--help"], env={"COLUMNS": "200"}).output
    assert [word for word in command if word.startswith("--") and word not in known] == []
    assert "--reuid=slz" in second
    assert f"XDG_STATE_HOME={tmp_path / 'data'}" in (tmp_path / "data" / "env").read_text().splitlines()


def test_the_start_passes_words_on_to_slz(start: Any) -> None:
    started = start("doctor", "--seconds", "5")
    assert started[started.index("slz") + 1 :] == ["doctor", "--seconds", "5"]
