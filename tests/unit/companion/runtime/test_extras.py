"""Extras: what flies needs none of them, and a missing one is one line."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from companion.cli import program
from companion.runtime import extras
from companion.runtime.errors import UsageError
from companion.runtime.program_version import program_version, source_digest
from tests import REPOSITORY

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]
OPTIONAL = sorted(module for modules in extras.PACKAGES.values() for module in modules)
FOLLOWS = {"starlette"}  # fastapi brings it
MODULE_OF = {"pyserial": "serial"}
# Imports what flies and the simulator, with the optional modules hidden, and records a flight's beginning.
FLIES = """
import asyncio, sys
from pathlib import Path

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[2].split(","):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Hidden())
import companion.cli.program, companion.cli.vehicle_run, companion.desk.demo.demonstration
import companion.flight.doctor.consultation, sitl.simulation
from companion.flight.recorder.recorder import Recorder
from params import Parameters


async def record():
    recorder = Recorder(Path(sys.argv[1]), "livox", Parameters(), 0)
    recorder.time_asked(7)
    recorder.close()
    print(recorder.statistics()["written"])

asyncio.run(record())
"""


def names(requirements: Iterable[str]) -> set[str]:
    """Return the names of requirements."""
    return {re.split(r"[\[><=; ]", one)[0] for one in requirements}


def imported(*packages: str) -> set[str]:
    """Return the first names of all modules that packages import."""
    paths = (path for package in packages for path in (REPOSITORY / package).rglob("*.py"))
    lines = re.compile(r"^ *(?:import|from) (\w+)(?:[\w.]* import |[\w.]*(?: as \w+)?$)", re.MULTILINE)
    return {name for path in paths for name in lines.findall(path.read_text("utf-8"))}


def test_the_table_is_that_of_the_distribution() -> None:
    for extra, modules in extras.PACKAGES.items():
        declared = names(PROJECT["optional-dependencies"][extra])
        assert set(modules.values()) - FOLLOWS - {"lazrs"} == declared, extra
    (everything,) = PROJECT["optional-dependencies"]["all"]
    assert everything == f"slz[{','.join(extra for extra in extras.PACKAGES if extra != 'ouster')}]"


def test_every_import_is_installed_by_the_distribution_or_an_extra() -> None:
    own = {"slz", "companion", "params", "sitl", *sys.stdlib_module_names}
    base = {MODULE_OF.get(name, name) for name in names(PROJECT["dependencies"])} | {"llvmlite"}
    assert imported("slz", "companion", "params", "sitl") - own - base <= set(OPTIONAL)


def test_what_flies_imports_no_extra_and_records(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FLIES, str(tmp_path / "flight.mcap"), ",".join(OPTIONAL)],
        cwd=REPOSITORY,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "{'/parameters': 1, '/raw/event': 1}\n"


RUN = ["run", "--mavlink", "udpin:127.0.0.1:14999", "--lidar", "livox:127.0.0.1:56399"]


@pytest.mark.parametrize(
    ("words", "begins", "extra"),
    [
        (["map", "a.laz", "--out", "o"], "slz map: laspy", "survey"),
        (["nearest", "1", "2"], "slz nearest: laspy", "survey"),
        (["replay", "a.mcap"], "slz replay: foxglove-sdk", "record"),
        (["calibrate", "a.mcap"], "slz calibrate: foxglove-sdk", "record"),
        (["reproduce", "--out", "o"], "slz reproduce: matplotlib", "plots"),
        (["demo", "--dashboard", "127.0.0.1:0"], "--dashboard: fastapi", "page"),
        (["demo", "--headless", "--prior", "o"], "--prior: laspy", "survey"),
        ([*RUN, "--out", "o"], "--out: matplotlib", "plots"),
        ([*RUN, "--prior", "o"], "--prior: laspy", "survey"),
        ([*RUN, "--dashboard", "127.0.0.1:0"], "--dashboard: fastapi", "page"),
        ([*RUN, "--foxglove", "0"], "--foxglove: foxglove-sdk", "record"),
        ([*RUN, "--ros2", "zenoh"], "--ros2: rosbags", "ros"),
    ],
)
def test_a_command_without_its_extra_ends_in_one_line(
    words: list[str],
    begins: str,
    extra: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    find = importlib.util.find_spec

    def hidden(name: str, *rest: Any) -> Any:
        return None if name in OPTIONAL else find(name, *rest)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["slz", *words])
    monkeypatch.setattr("importlib.util.find_spec", hidden)
    with pytest.raises(SystemExit) as left:
        program.main()
    assert left.value.code == 2
    assert capfd.readouterr() == (
        "",
        f"slz: {begins}, of the extra {extra}, is not installed: pip install 'slz[{extra}]'\n",
    )
    assert not list(tmp_path.iterdir())


def test_a_module_missed_in_mid_command_is_named_with_its_extra(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def lacks(name: str) -> Any:
        def load(*_: Any, **__: Any) -> None:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

        return load

    monkeypatch.setattr("sys.argv", ["slz", "params"])
    monkeypatch.setattr("params.load", lacks("ouster.sdk.core"))
    with pytest.raises(SystemExit) as left:
        program.main()
    assert left.value.code == 2
    assert "slz params: ouster-sdk, of the extra ouster," in capfd.readouterr().err
    monkeypatch.setattr("params.load", lacks("numpy"))
    with pytest.raises(ModuleNotFoundError):
        program.main()


def test_a_module_that_a_finder_hides_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def hide(name: str, *_: Any) -> Any:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr("importlib.util.find_spec", hide)
    with pytest.raises(UsageError, match=r"^a bag: rosbags, of the extra ros, is not installed"):
        extras.require("ros", "a bag")


# Version of the program: a digest of its source.


def source(root: Path, **files: str) -> Path:
    for name, text in files.items():
        path = root / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return root


def test_it_is_the_release_and_the_digest_of_this_source() -> None:
    release, _, digest = program_version().partition("+")
    assert release[0].isdigit()
    assert digest == source_digest(REPOSITORY)


def test_a_changed_renamed_or_further_file_of_any_package_is_another_version(tmp_path: Path) -> None:
    digests = [
        source_digest(source(tmp_path / str(k), **files))
        for k, files in enumerate(
            [
                {"slz__a": "1", "sitl__b": "2"},
                {"slz__a": "1", "sitl__b": "3"},
                {"slz__a": "1", "sitl__c": "2"},
                {"slz__a": "1", "sitl__b": "2", "params__c": ""},
            ]
        )
    ]
    assert len(set(digests)) == 4


def test_compiled_files_and_the_safety_case_itself_are_left_out(tmp_path: Path) -> None:
    plain = source_digest(source(tmp_path / "a", slz__a="1"))
    more = {"companion__desk__evidence__x": "2", "tests__b": "3"}
    other = source(tmp_path / "b", slz__a="1", **more)
    (other / "slz" / "__pycache__").mkdir()
    (other / "slz" / "__pycache__" / "a.pyc").write_bytes(b"4")
    assert source_digest(other) == plain
