"""Trial of a mutant: a fork imports one changed module, uncompiled; no file is changed."""

from __future__ import annotations

import importlib
import importlib.machinery
import importlib.util
import os
import resource
import sys
import traceback
import types
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from pathlib import Path

KILLED, SURVIVED, TOO_LONG = "killed", "survived", "killed by time"
MEMORY_BYTES = 8 << 30
# What every trial needs and no mutant changes: imported once, before the forks.
BEFORE = (
    "_pytest.assertion.rewrite", "companion", "hypothesis.extra.numpy", "laspy", "matplotlib", "numba",
    "numpy", "params", "pydantic", "pymap3d", "pymavlink.dialects.v20.ardupilotmega", "pytest", "rasterio",
    "scipy.ndimage", "scipy.spatial.transform", "scipy.stats", "shapely",
)  # fmt: skip


class ChangedModule(MetaPathFinder):
    """Give one module from a text; everything else is found as ever."""

    def __init__(self, root: Path, path: str, source: str) -> None:
        self.name = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        self._file, self._source = root / path, source

    def find_spec(
        self, fullname: str, path: object = None, target: object = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return the changed module's spec; None for all others."""
        if fullname != self.name:
            return None
        return importlib.util.spec_from_file_location(fullname, self._file, loader=self)  # type: ignore[arg-type]

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> None:
        """Leave the module's making to Python."""

    def exec_module(self, module: types.ModuleType) -> None:
        """Run the changed text."""
        exec(compile(self._source, str(self._file), "exec", dont_inherit=True), module.__dict__)


def prepare() -> None:
    """Import what all trials share.

    Raises
    ------
    RuntimeError
        If the compiler is on: its cache does not see a change in a kernel that another one calls.
    """
    if os.environ.get("NUMBA_DISABLE_JIT") != "1":
        raise RuntimeError("kernels would be compiled or taken from a cache: set NUMBA_DISABLE_JIT=1")
    for name in BEFORE:
        importlib.import_module(name)
    if "slz" in sys.modules:
        raise RuntimeError("slz was imported before the fork: a mutant of it would not be seen")


def _judge(root: Path, path: str, source: str, tests: Sequence[str], limit_s: float) -> int:
    """Run tests on the changed module; return pytest's exit code."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s) + 1, int(limit_s) + 2))
    sys.meta_path.insert(0, ChangedModule(root, path, source))
    os.chdir(root)
    import pytest

    quiet = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--timeout", "0"]
    # Uncompiled, numpy's scalars warn of 0/0; what is imported before the fork is not rewritten.
    quiet += ["-W", "ignore::RuntimeWarning", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    return int(pytest.main([*quiet, *tests]))


def tried(root: Path, path: str, source: str, tests: Sequence[str], limit_s: float, log: Path) -> str:
    """Return what became of a module's text before its tests, whose output is in `log`.

    Raises
    ------
    RuntimeError
        If the tests could not be run though the module could be imported.
    """
    child = os.fork()
    if child == 0:
        code = 9
        try:
            out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
            os.dup2(out, 1)
            os.dup2(out, 2)
            code = _judge(root, path, source, tests, limit_s)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return TOO_LONG
    code = os.WEXITSTATUS(status)
    if code in (4, 5, 9) and "ERROR collecting" not in log.read_text(errors="replace"):
        raise RuntimeError(f"the tests of {path} could not be run (exit code {code}): see {log}")
    return SURVIVED if code == 0 else KILLED
