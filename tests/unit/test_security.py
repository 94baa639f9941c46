"""Security promises of docs/security.md, checked in the source."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from tests import REPOSITORY

FILES = sorted(
    path for name in ("companion", "slz", "params", "sitl") for path in (REPOSITORY / name).rglob("*.py")
)
# Data that is code when it is read.
CODE_IN_DATA = {"pickle", "cPickle", "dill", "marshal", "shelve", "joblib", "cloudpickle"}
DOWNLOADS = {
    "urllib.request",
    "http.client",
    "requests",
    "httpx",
    "aiohttp",
    "ftplib",
    "smtplib",
    "telnetlib",
}
SHELLS = {"os.system", "os.popen", "subprocess.getoutput", "subprocess.getstatusoutput",
          "asyncio.create_subprocess_shell"}  # fmt: skip
RUNS = {"eval", "exec", "compile", "__import__"}
PROCESSES = {"subprocess", "multiprocessing", "pty"}
# They run this program's own simulator beside it, compile its kernels before, or read what may end a process;
# `slz sim` becomes the simulator.
BESIDE = {
    "companion/desk/demo/demonstration.py",
    "companion/runtime/kernel_compilation.py",
    "companion/desk/reproduce/instrument_data.py",
    "companion/desk/reproduce/survey_recording.py",
    "companion/desk/clouds/laz_reader.py",
}
BECOMES = {"companion/cli/simulator.py"}


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def faults(source: str, file: str) -> list[str]:
    """Return what a file does that none may."""
    tree = ast.parse(source)
    modules = set(imported(tree))
    found = [f"imports {m}" for m in modules if m.split(".")[0] in CODE_IN_DATA or m in DOWNLOADS]
    found += [
        f"imports {m}" for m in modules if m.split(".")[0] in DOWNLOADS - {"urllib.request", "http.client"}
    ]
    if file not in BESIDE:
        found += [f"imports {m}" for m in modules if m.split(".")[0] in PROCESSES]
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            if name in SHELLS or name in RUNS:
                found.append(f"calls {name}")
            if name.startswith(("os.exec", "os.spawn", "os.posix_spawn", "os.fork")) and file not in BECOMES:
                found.append(f"calls {name}")
            for word in node.keywords:
                true = isinstance(word.value, ast.Constant) and word.value.value is True
                if true and word.arg in ("shell", "allow_pickle"):
                    found.append(f"{name}({word.arg}=True)")
    return sorted(set(found))


def test_no_file_unpickles_runs_a_shell_or_downloads() -> None:
    assert len(FILES) > 250
    assert {str(f.relative_to(REPOSITORY)): found for f in FILES
            if (found := faults(f.read_text("utf-8"), str(f.relative_to(REPOSITORY))))} == {}  # fmt: skip


@pytest.mark.parametrize(
    "source",
    ["import pickle", "from urllib.request import urlopen", "from urllib import request", "import requests",
     "import os\nos.system('ls')", "subprocess.run('ls', shell=True)", "import subprocess", "eval('1')",
     "np.load('x', allow_pickle=True)", "os.execv('/bin/sh', [])", "from multiprocessing import Process"],
)  # fmt: skip
def test_each_of_these_would_be_found(source: str) -> None:
    assert faults(source, "companion/flight/app.py")


def test_the_page_loads_nothing_from_elsewhere() -> None:
    for path in (REPOSITORY / "companion/flight/dashboard/static").iterdir():
        if path.suffix in (".html", ".js", ".css"):
            text = path.read_text("utf-8")
            assert not any(
                word in text for word in ('src="http', "src='http", "url(http", "import('http", 'from "http')
            )
