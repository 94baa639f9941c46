"""Every command of every page is run, or read by the parser that it is for; what is not run has a reason."""

from __future__ import annotations

import argparse
import contextlib
import glob
import importlib.util
import io
import logging
import re
import runpy
import subprocess
import sys
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import typer

import params
from companion.cli import program
from companion.flight.link.transport.mavlink_url import parse_url
from sitl import __main__ as simulator
from tests import REPOSITORY
from tests.unit.docs.shell_commands import Block, ShellCommand, blocks, fragments

COMMANDS = [command for block in blocks() if not block.language for command in block.commands()]
FRAGMENTS = fragments()
GROUP: Any = typer.main.get_command(program.app)
# Programs of others. Nothing of them is run by a test; the reason says what runs it instead.
FOREIGN = {
    "apt": "changes the system: tests/fresh.sh does it in new Debian systems",
    "install.sh": "changes the system, as root",
    "image.sh": "builds a whole image, as root",
    "podman": "needs such an image",
    "systemctl": "needs the installed service",
    "journalctl": "needs the installed service",
    "slz-doctor": "needs the installed service: tests/unit/companion/test_deploy.py runs what it is",
    "nmcli": "changes the network of the computer",
    "curl": "needs an Ouster",
    "my_program": "stands for the reader's own",
    "source": "of the shell: a virtual environment, as tests/unit/test_package.py makes one",
    "sim_vehicle.py": "ArduPilot's: tests/e2e/test_quickstart.py flies it with --arducopter",
}
FOREIGN_TARGETS = {"px4_sitl": "PX4's: tests/e2e/test_quickstart.py flies it with --px4"}
# Blocks that hold no command: drawings, and what a file holds.
PICTURES = {
    "README.md": 1,
    "docs/architecture.md": 4,
    "docs/evidence.md": 1,
    "docs/hardware.md": 1,
    "docs/page.md": 1,
    "docs/survey.md": 1,
}
# The test that runs each command of slz; here its options are read by its own parser. Of calibrate,
# reproduce and nearest that test runs all but the work itself, which takes minutes and has tests of its own.
RUN_BY = {
    "bench": "tests/unit/companion/cli/test_command_output.py",
    "benchmark": "tests/unit/companion/desk/open_benchmark/test_benchmark_command.py",
    "calibrate": "tests/unit/companion/cli/test_command_output.py",
    "demo": "tests/e2e/test_program.py",
    "doctor": "tests/unit/companion/cli/test_command_output.py",
    "evidence": "tests/unit/companion/desk/evidence/test_evidence.py",
    "map": "tests/integration/test_map_command.py",
    "nearest": "tests/unit/companion/cli/test_command_output.py",
    "params": "tests/unit/docs/test_shell_commands.py",
    "replay": "tests/unit/companion/cli/test_command_output.py",
    "reproduce": "tests/unit/companion/cli/test_command_output.py",
    "run": "tests/e2e/test_quickstart.py",
    "sim": "tests/e2e/test_quickstart.py",
}
# Our own modules and targets that take minutes to days; their arguments are read, and nothing is run.
LONG = (
    "tests.bench",
    "tests.campaign",
    "tests.fuzz",
    "tests.soak",
    "tests.search",
    "tests.opinion",
    "sitl.benchmark_scene",
)
UNREAD = {
    "tests.fuzz.with_atheris": "needs atheris, which only x86-64 has",
    "venv": "Python's: tests/unit/test_package.py makes such an environment",
    "build": "PyPI's: tests/unit/test_package.py builds wheel and sdist by the same backend",
}
# Options of slz itself, without a command: tests/unit/test_package.py runs the first, and one of completion.
ALONE = "--version", "--install-completion", "--show-completion"
# What stands for something else on the pages.
PLACEHOLDERS = {
    "NAME=VALUE": "zone_m=300",
    "LAT": "47.4",
    "LON": "8.5",
    "URL": "udpin:127.0.0.1:14550",
    "NAME": "stadium",
    "SEED": "1",
    "N": "1",
    "S": "stadium",
    "X": "lidar",
    "PORT": "8765",
    "HOST:PORT": "127.0.0.1:56401",
    "NAME@HEIGHT,...": "gps_denied@10",
    "FILE": "flight.mcap",
    "FILES": "flight.mcap",
    "FILES...": "flight.mcap",
    "FILE.pcap": "flight.pcap",
    "FLIGHT.tlog": "flight.tlog",
    "$n": "0",
}
OF_OPTIONS = {"--mavlink": "udpin:127.0.0.1:14550", "--lidar": "livox:127.0.0.1:56301"}
FILES = (
    "flight.mcap", "flight.pcap", "flight.tlog", "county/a.laz", "county/b.laz", "autzen_trim.laz",
    "os1.json", "arducopter.json", "simulator.json", "tokens", "mine.toml", "baseline.cpp", "gen.py",
)  # fmt: skip
FOLDERS = "zones", "cloud", "DIR", "out", "BEFORE", "AFTER"


class ReadError(BaseException):
    """Stops a program once its arguments are read."""


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the pages name."""
    for name in FOLDERS:
        (tmp_path / name).mkdir()
    for name in FILES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def filled(words: tuple[str, ...]) -> list[str]:
    """Return words as a user would type them, patterns expanded as by a shell."""
    out: list[str] = []
    for word in (w.strip("[]") for w in words):
        option = out[-1] if out else ""
        if word in ("…", "..."):
            out += [OF_OPTIONS[option]] if option in OF_OPTIONS else []
        elif "*" in word:
            out += sorted(glob.glob(word))
        else:
            out.append(PLACEHOLDERS.get(word, word))
    return out


def read_by_slz(words: list[str]) -> None:
    """Let a command of slz read its words by its own parser."""
    if words[0] == "sim":
        read_only(lambda: simulator.main(words[1:]))
    else:
        GROUP.get_command(typer.Context(GROUP), words[0]).make_context(words[0], words[1:])


def read_by_module(module: str, words: list[str]) -> None:
    """Let a module read its words as Python's `-m` would."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [module, *words])
        for name in (module, f"{module}.__main__"):  # another test may have imported it
            if not hasattr(sys.modules.get(name), "__path__"):
                patch.delitem(sys.modules, name, raising=False)
        patch.setattr(logging, "disable", lambda _level: None)  # it would last for all tests that follow
        read_only(lambda: runpy.run_module(module, run_name="__main__"))


def read_only(run: Callable[[], object]) -> None:
    """Run a program until it has read its arguments; it exits on what it does not know."""
    parse = argparse.ArgumentParser.parse_args

    def stop(parser: Any, *args: Any, **names: Any) -> Any:
        parse(parser, *args, **names)
        raise ReadError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, "parse_args", stop)
        with pytest.raises(ReadError):
            run()


def shown(name: str) -> str:
    """Return the help of a command of slz; `slz sim` becomes the simulator's process."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
        if name == "sim":
            simulator.main(["--help"])
        else:
            program.app([name, "--help"], standalone_mode=False)
    return out.getvalue()


def of_program(*names: str) -> list[ShellCommand]:
    return [command for command in COMMANDS if command.program in names]


def is_long(module: str) -> bool:
    return module.startswith(LONG)


def test_every_block_is_of_commands_or_a_picture() -> None:
    known = {"slz", "make", "python", "python3", "pytest", "pip", *FOREIGN}

    def strange(block: Block) -> int:
        return sum(command.program not in known for command in block.commands())

    pictures: dict[str, int] = {}
    for block in (b for b in blocks() if not b.language):
        if not any(command.program in known for command in block.commands()):
            pictures[block.page] = pictures.get(block.page, 0) + 1
        elif not block.page.startswith("docs/architecture"):
            assert strange(block) == 0, block
    assert {page: count for page, count in pictures.items() if page in PICTURES} == pictures
    assert {program for program in FOREIGN if not of_program(program)} == set()


def test_options_of_slz_itself_are_some() -> None:
    named = {option for param in typer.main.get_command(program.app).params for option in param.opts}
    assert set(ALONE) <= named


def test_the_pages_have_not_lost_their_commands() -> None:
    assert len(COMMANDS) > 90
    assert len(FRAGMENTS) > 150


@pytest.mark.parametrize("command", of_program("slz"), ids=str)
def test_a_command_of_slz_is_read_by_its_parser(command: ShellCommand, desk: Path) -> None:
    words = filled(command.words)
    if words[0] in ALONE:
        return
    if words[0] == "run":  # what a page leaves out
        words += [w for name, url in OF_OPTIONS.items() if name not in words for w in (name, url)]
    read_by_slz(words)
    for before, after in pairwise(words):
        if before == "--mavlink":
            parse_url(after)
        if before == "--set":
            params.load("quadcopter", [after])


@pytest.mark.parametrize("command", [c for c in FRAGMENTS if c.program == "slz"], ids=str)
def test_a_command_of_slz_in_a_text_is_one_with_the_options_named(command: ShellCommand) -> None:
    name, *words = command.words
    if name == "COMMAND" or name in ALONE:
        return
    assert name in RUN_BY
    options = [word for word in words if word.startswith("--") and word != "--help"]
    if name != "sim":
        sub = GROUP.get_command(typer.Context(GROUP), name)
        assert set(options) <= {option for param in sub.params for option in param.opts}
        return
    assert set(options) <= set(re.findall(r"--[a-z][a-z-]*", shown(name)))


@pytest.mark.parametrize("name", sorted(RUN_BY))
def test_each_command_of_slz_shows_its_help_and_another_test_runs_it(name: str) -> None:
    assert "--help" in shown(name)
    text = (REPOSITORY / RUN_BY[name]).read_text("utf-8")
    assert re.search(rf'["\'( ]{name}["\', ]', text), RUN_BY[name]


def test_every_command_of_slz_has_a_test_that_runs_it() -> None:
    assert set(GROUP.commands) == set(RUN_BY)


def test_slz_params_prints_the_table() -> None:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert not program.app(["params"], standalone_mode=False)
    assert all(row.mavlink in out.getvalue() for row in params.rows())


MAKES = [command for command in (*COMMANDS, *FRAGMENTS) if command.program == "make"]


@pytest.mark.parametrize("words", sorted({c.words for c in MAKES if c.words[0] not in FOREIGN_TARGETS}))
def test_make_has_the_target_and_uses_the_variables(words: tuple[str, ...]) -> None:
    text = (REPOSITORY / "Makefile").read_text("utf-8")
    target, *variables = words
    assert re.search(rf"^{target}:", text, re.MULTILINE)
    assert f" {target}" in re.search(r"^\.PHONY: (.*)$", text, re.MULTILINE)[0]  # type: ignore[index]
    for name in (variable.partition("=")[0] for variable in variables):
        assert re.search(rf"\$[({{]{name}\b|\$\(if \$\({name}\)", text), name
    dry = subprocess.run(
        ["make", "-n", "-o", "setup", *words], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert dry.returncode == 0, dry.stderr


PYTHON = of_program("python", "python3")


@pytest.mark.parametrize("command", [c for c in PYTHON if c.module not in ("", "pytest", *UNREAD)], ids=str)
def test_a_module_reads_the_arguments_of_the_page(command: ShellCommand, desk: Path) -> None:
    assert is_long(command.module), "run it here, or say why not"
    read_by_module(command.module, filled(command.words[2:]))


@pytest.mark.parametrize(
    "command",
    [f for f in FRAGMENTS if f.module and f.module not in ("pytest", "http.server", *UNREAD)],
    ids=str,
)
def test_a_module_named_in_a_text_exists(command: ShellCommand) -> None:
    assert importlib.util.find_spec(command.module) is not None


def pytest_words() -> list[tuple[str, ...]]:
    ours = [c.words for c in of_program("pytest")]
    return ours + [c.words[2:] for c in (*PYTHON, *FRAGMENTS) if c.module == "pytest"]


@pytest.mark.parametrize("words", sorted(set(pytest_words())), ids=" ".join)
def test_what_pytest_is_told_exists(words: tuple[str, ...], pytestconfig: pytest.Config) -> None:
    markers = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["tool"]["pytest"][
        "ini_options"
    ]
    known = {marker.partition(":")[0] for marker in markers["markers"]}
    for before, word in zip(("", *words), words, strict=False):
        if before == "-m":
            assert word in known
        elif word.startswith("--"):
            assert pytestconfig.getoption(word, default=Ellipsis) is not Ellipsis
        elif "/" in word:
            assert (REPOSITORY / word).exists(), word


@pytest.mark.parametrize(
    "command", [c for c in (*PYTHON, *FRAGMENTS) if c.program.startswith("python") and not c.module], ids=str
)
def test_a_line_or_file_of_python_is_one(command: ShellCommand) -> None:
    if command.words[0] == "-c":
        code = compile(command.words[1], str(command), "exec")
        for line in re.findall(r"from ([\w.]+) import (\w+)", command.words[1]):
            assert hasattr(importlib.import_module(line[0]), line[1])
        assert code
    elif not command.words[0].startswith("$"):  # of the shared folder, which a checkout has not
        compile((REPOSITORY / command.words[0]).read_text("utf-8"), command.words[0], "exec")


def test_files_of_the_repository_that_commands_name_exist() -> None:
    for command in COMMANDS:
        for path in re.findall(r"\b((?:params|deploy|tests|docs)/[\w./-]+\.\w+)", " ".join(command.words)):
            assert (REPOSITORY / path).exists(), command
    assert (REPOSITORY / "deploy/install.sh").stat().st_mode & 0o100
