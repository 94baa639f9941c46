"""Cache of compiled kernels: valid only for the current sources, including called kernels."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import slz.kernels
from slz.kernels.source_stamp import sources_of
from tests import REPOSITORY

HELPER = """
from slz.kernels.jit import kernel_for_any_types


@kernel_for_any_types
def helped(x):
    return x + {added}
"""
CALLER = """
from slz.kernels.jit import kernel
from slz.kernels.between import passed_on


@kernel
def called(x: float) -> float:
    return passed_on(x)
"""
BETWEEN = CALLER.replace("between import passed_on", "helper import (\n    helped,\n)").replace(
    "passed_on(x)", "helped(x)"
).replace("def called", "def passed_on")  # fmt: skip
ASKED = """
from slz.kernels.caller import called
print(called(1.0), sum(called.stats.cache_misses.values()))
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """Return the kernels of a program of three files, each of which calls the next."""
    kernels = tmp_path / "slz" / "kernels"
    kernels.mkdir(parents=True)
    for folder in (kernels, kernels.parent):
        (folder / "__init__.py").touch()
    for name in ("jit", "source_stamp"):
        (kernels / f"{name}.py").write_bytes((Path(slz.kernels.__path__[0]) / f"{name}.py").read_bytes())
    (kernels / "helper.py").write_text(HELPER.format(added=1))
    (kernels / "between.py").write_text(BETWEEN)
    (kernels / "caller.py").write_text(CALLER)
    return kernels


def asked(program: Path, ask: str = ASKED) -> tuple[float, int]:
    """Return what the kernel answers in a new process, and how often it had to be compiled for that."""
    own = {"PYTHONPATH": str(program.parents[1]), "NUMBA_DISABLE_JIT": "0"}
    own["NUMBA_CACHE_DIR"] = str(program.parents[1] / "cache")
    said = subprocess.run(
        [sys.executable, "-c", ask],
        env=os.environ | own,
        cwd=program.parents[1],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    value, misses = said.split()
    return float(value), int(misses)


def test_a_kernel_is_compiled_anew_when_one_that_it_calls_has_changed(program: Path) -> None:
    assert asked(program) == (2.0, 1)
    assert asked(program) == (2.0, 0)
    (program / "helper.py").write_text(HELPER.format(added=5))
    (program / "stranger.py").write_text("")
    assert asked(program) == (6.0, 1)


def test_what_was_compiled_from_modules_that_an_update_moved_is_compiled_anew(program: Path) -> None:
    assert asked(program) == (2.0, 1)
    for index in (program.parents[1] / "cache").rglob("*.nbi"):
        index.write_bytes(pickle.dumps(numba.__version__) + b"cslz.kernels.gone\nThing\n.")
    assert asked(program) == (2.0, 1)


def test_the_stamp_of_the_companion_s_kernels_follows_the_modules_that_they_import() -> None:
    placement = REPOSITORY / "companion" / "flight" / "fusion" / "placement.py"
    names = {path.name for path in sources_of(placement, REPOSITORY)}
    assert {"placement.py", "motion.py", "jit.py"} <= names


def test_a_change_of_any_module_of_the_simulator_has_its_kernels_compiled_anew(tmp_path: Path) -> None:
    program = tmp_path / "sitl"
    program.mkdir()
    (program / "__init__.py").touch()
    (program / "compilation.py").write_bytes((REPOSITORY / "sitl" / "compilation.py").read_bytes())
    (program / "helper.py").write_text(HELPER.format(added=1).replace("slz.kernels.jit", "sitl.compilation"))
    (program / "caller.py").write_text(
        CALLER.replace("slz.kernels.jit", "sitl.compilation").replace(
            "slz.kernels.between import passed_on", "sitl.helper import helped as passed_on"
        )
    )
    ask = ASKED.replace("slz.kernels.caller", "sitl.caller")
    assert asked(program / "kernels", ask) == (2.0, 1)
    assert asked(program / "kernels", ask) == (2.0, 0)
    (program / "helper.py").write_text(HELPER.format(added=5).replace("slz.kernels.jit", "sitl.compilation"))
    assert asked(program / "kernels", ask) == (6.0, 1)
