"""Compilation of kernels before anything else where they are missing or outdated."""

from __future__ import annotations

import importlib
import io
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Self

import pytest

from companion.cli import console
from companion.runtime import kernel_compilation
from companion.runtime.interrupt import Interrupted

IMPORTS_ROWS = "from slz.kernels.array_memory import (\n    b,\n)\n"
KERNEL = "@kernel\ndef kernel(x: int) -> None: ...\n"
KERNELS = ("slz/kernels/points/voxels", "companion/flight/fusion/placement")
FLOWN = kernel_compilation.of_flight
OF_SOME_FLIGHTS = {
    "companion.flight.sensors.decoders.livox_points",
    "companion.flight.sensors.decoders.livox_scan_pattern",
    "companion.flight.dashboard.quantise",
}
PYTHON = f"py{sys.version_info.major}{sys.version_info.minor}"


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of sources in the place of ours, nothing of it compiled; the home is beside it."""
    monkeypatch.setattr(kernel_compilation, "ROOT", tmp_path / "program")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    for name in (*KERNELS, "slz/kernels/paper/search", "slz/kernels/jit"):
        path = tmp_path / "program" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("" if name.endswith("jit") else KERNEL)
        os.utime(path, (1000, 1000))
    return tmp_path / "program"


def compiled(folder: Path, at_s: float, *but: str, python: str = PYTHON) -> None:
    """Leave what Numba leaves of every module, but of some."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in {"search", *(Path(own).name for own in KERNELS)} - set(but):
        path = folder / f"{name}.kernel-43.{python}.nbi"
        path.touch()
        os.utime(path, (at_s, at_s))


def test_it_is_the_first_start_until_all_kernels_are_compiled_and_again_when_one_is_newer(
    sources: Path,
) -> None:
    cache = sources / "slz" / "kernels" / "__pycache__"
    assert kernel_compilation.is_first(FLOWN())
    compiled(cache, 2000, python="py39")
    assert kernel_compilation.is_first(FLOWN())
    compiled(cache, 2000, "placement")
    assert kernel_compilation.is_first(FLOWN()), "the start before was ended"
    compiled(cache, 2000)
    voxels = sources / "slz" / "kernels" / "points" / "voxels.py"
    voxels.write_text(KERNEL + KERNEL.replace("kernel(", "another("))
    os.utime(voxels, (1000, 1000))
    assert kernel_compilation.is_first(FLOWN()), "another command compiled the other kernel"
    voxels.write_text(KERNEL)
    os.utime(voxels, (1000, 1000))
    assert not kernel_compilation.is_first(FLOWN())
    os.utime(sources / "slz" / "kernels" / "jit.py", (3000, 3000))
    assert not kernel_compilation.is_first(FLOWN()), "it holds no kernel"
    os.utime(sources / "slz" / "kernels" / "paper" / "search.py", (3000, 3000))
    assert not kernel_compilation.is_first(FLOWN()), "it is source mode's"
    assert kernel_compilation.is_first(FLOWN("source"))
    os.utime(sources / "slz" / "kernels" / "points" / "voxels.py", (3000, 3000))
    assert kernel_compilation.is_first(FLOWN())


def test_it_is_a_first_start_when_a_kernel_that_another_one_calls_is_newer(sources: Path) -> None:
    kernels = sources / "slz" / "kernels"
    for name, text in (
        ("points/voxels", KERNEL + "from companion.flight.fusion.between import a\n"),
        ("../../companion/flight/fusion/between", KERNEL + IMPORTS_ROWS),
        ("array_memory", ""),
    ):
        (kernels / f"{name}.py").write_text(text)
        os.utime(kernels / f"{name}.py", (1000, 1000))
    compiled(kernels / "__pycache__", 2000)
    between = kernels / "__pycache__" / f"between.kernel-43.{PYTHON}.nbi"
    between.touch()
    os.utime(between, (2000, 2000))
    assert not kernel_compilation.is_first(FLOWN())
    os.utime(kernels / "array_memory.py", (3000, 3000))
    assert kernel_compilation.is_first(FLOWN())


def test_compiled_kernels_are_looked_for_where_numba_keeps_them(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled(tmp_path / "cache" / "numba" / "a-folder-of-its-own", 2000)
    assert not kernel_compilation.is_first(FLOWN())
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "elsewhere"))
    assert kernel_compilation.is_first(FLOWN())
    compiled(tmp_path / "elsewhere", 2000)
    assert not kernel_compilation.is_first(FLOWN())


def test_it_is_the_simulators_first_start_where_no_kernel_of_its_sources_is_cached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    needs = kernel_compilation.of_simulator()
    for module in map(module_of, needs):
        importlib.import_module(module)
    assert not kernel_compilation.is_first(needs)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "0")
    assert kernel_compilation.is_first(needs)
    for path, names in needs.items():
        for name in names:
            (tmp_path / f"{path.stem}.{name}-1.{PYTHON}.nbi").write_bytes(b"0" * 64)
    assert kernel_compilation.is_first(needs), "of other sources"


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(kernel_compilation.ROOT).with_suffix("").parts)


def test_the_modules_compiled_for_a_flight_are_those_that_it_loads() -> None:
    """In a program of its own: this one has loaded whatever other tests need."""
    loads = (
        "import sys\nfor m in ('companion.flight.app', 'slz.paper.paper_method'):\n"
        " __import__(m); print(*sys.modules)"
    )
    said = subprocess.run(
        [sys.executable, "-c", loads],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=kernel_compilation.ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for mode, loaded in zip(("default", "source"), said.stdout.splitlines(), strict=True):
        compiled_first = set(map(module_of, FLOWN(mode)))
        assert compiled_first - set(loaded.split()) <= OF_SOME_FLIGHTS
        others = {name for name in loaded.split() if name.startswith(("slz.", "companion."))} - compiled_first
        assert not [name for name in others if kernel_compilation.KERNEL.search(_source(name))]


def test_the_kernels_of_a_survey_are_kernels_that_there_are() -> None:
    with_kernels = kernel_compilation.ALL
    for path, names in kernel_compilation.of_survey().items():
        assert set(names) <= set(with_kernels.findall(path.read_text("utf-8"))), path.name


def test_without_the_compiler_nothing_is_to_be_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for told, expected in (("", True), ("0", True), ("1", False)):
        monkeypatch.setenv("NUMBA_DISABLE_JIT", told)
        assert kernel_compilation.is_first(FLOWN()) is expected


def test_modules_are_compiled_in_other_processes_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    chosen = [
        kernel_compilation.ROOT / "slz" / "kernels" / f"{name}.py"
        for name in ("raster/horizon", "instruments/phase_unwrapping")
    ]
    needs = {path: ["horizon" if path == chosen[0] else "unwrap_by_quality"] for path in chosen}
    assert kernel_compilation.is_first(needs)
    told: list[tuple[int, int]] = []
    kernel_compilation.compile_kernels(lambda *pair: told.append(pair), needs)
    assert sorted(told) == [(1, 2), (2, 2)]
    assert not kernel_compilation.is_first(needs)
    compiled = {path.name.partition("-")[0] for path in tmp_path.rglob("*.nbi")}
    assert compiled >= {"horizon.horizon", "phase_unwrapping.unwrap_by_quality"}
    assert "horizon.horizon_of_tiles" not in compiled

    # Numba keeps the hash of the source: a checkout or a formatter writes files again as they were.
    again = tmp_path / "phase_unwrapping.py"
    for added, expected in ((b"", False), (b"\n", True)):
        again.write_bytes(chosen[1].read_bytes() + added)
        os.utime(again, (2**32, 2**32))
        assert kernel_compilation.is_first({again: ["unwrap_by_quality"]}) is expected


def test_what_cannot_be_compiled_in_advance_is_left_to_those_who_import_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr("subprocess.Popen", refused)
    told: list[tuple[int, int]] = []
    kernel_compilation.compile_kernels(lambda *pair: told.append(pair), FLOWN())
    assert told == []


class Compiler:
    """A process that compiles until it is told to end."""

    def __init__(self, *_: object, **__: object) -> None:
        self.stdin, self.stdout, self.ended = io.StringIO(), self, threading.Event()
        self.asked = threading.Event()
        COMPILERS.append(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def readline(self) -> str:
        self.asked.set()
        self.ended.wait(60)
        return ""

    def terminate(self) -> None:
        self.ended.set()


COMPILERS: list[Compiler] = []


def test_a_signal_ends_the_processes_that_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_futures: object) -> None:
        while not (COMPILERS and COMPILERS[0].asked.wait(60)):
            pass
        raise Interrupted(signal.SIGINT)

    monkeypatch.setattr("subprocess.Popen", Compiler)
    monkeypatch.setattr(kernel_compilation, "wait", interrupted)
    COMPILERS.clear()
    told: list[tuple[int, int]] = []
    with pytest.raises(Interrupted):
        kernel_compilation.compile_kernels(lambda *pair: told.append(pair), FLOWN())
    assert all(compiler.ended.is_set() for compiler in COMPILERS if compiler.asked.is_set())
    assert COMPILERS[0].stdin.getvalue().startswith("slz.")
    assert told == []


@pytest.mark.parametrize("first", [True, False])
def test_the_first_start_says_why_it_takes_long(
    first: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def compiled(step: Callable[[int, int], None], needs: kernel_compilation.Needs) -> None:
        step(1, 2)
        asked.append(needs)

    asked: list[kernel_compilation.Needs] = []
    monkeypatch.setattr(kernel_compilation, "is_first", lambda _: first)
    monkeypatch.setattr(kernel_compilation, "compile_kernels", compiled)
    console.compile_at_first(kernel_compilation.of_survey())
    assert asked == [kernel_compilation.of_survey()][: int(first)]
    assert ("first start: compiling the kernels" in capfd.readouterr().err) == first


def _source(module: str) -> str:
    path = kernel_compilation.ROOT.joinpath(*module.split("."))
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return path.read_text("utf-8")
