"""Kernels: their signatures, from their annotations, and which of them the start loads."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import numba
import numpy as np
import pytest
from llvmlite import binding

from slz.kernels.argument_types import Array1D, Array2D, Array4D, Float32, ReadOnly2D, Strided2D
from slz.kernels.jit import kernel, kernel_part, signatures
from tests import REPOSITORY

Value = TypeVar("Value", np.float32, np.uint8)
Pair = tuple[int, Array2D[np.int32]]
Ask = Callable[[str], list[str]]
OFF_FLIGHT = ("companion.desk", "slz.paper", "slz.flash", "slz.radar")
SELDOM = ("slz.kernels.paper", "slz.kernels.survey", "slz.kernels.instruments")
# Called by methods that only the desk calls: `slz.terrain.derive.derive`, `TiledRaster.write`.
OF_MAPS_WRITTEN_WHOLE = {
    ("slz.kernels.footprint.derive_maps", "derive_box"),
    ("slz.kernels.cells.tile_boxes", "put_layers"),
}
compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiler")


@pytest.fixture
def in_a_program(tmp_path: Path) -> Ask:
    """Return the lines that a program of its own prints."""

    def ask(text: str) -> list[str]:
        path = tmp_path / "program.py"
        path.write_text(text)
        own = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(REPOSITORY)}
        said = subprocess.run([sys.executable, path], env=own, capture_output=True, text=True, check=True)
        return said.stdout.splitlines()

    return ask


def scalars(a: float, b: int, c: bool, d: np.uint64, e: Float32) -> None: ...


def arrays(a: Array1D[np.bool_], b: Strided2D[np.uint16], c: ReadOnly2D[np.float64]) -> Array4D[np.int32]: ...


def tuples(a: Pair, b: tuple[float, float]) -> tuple[Pair, bool]: ...


def several(a: Array1D[Value], at: int, out: Array2D[Value]) -> int: ...


def test_scalars_are_those_of_64_bits_unless_their_type_says_otherwise() -> None:
    assert signatures(scalars) == ["void(float64, int64, boolean, uint64, float32)"]


def test_arrays_have_the_element_the_dimensions_and_the_layout_of_their_type() -> None:
    (text,) = signatures(arrays)
    assert text == "int32[:, :, :, ::1](boolean[::1], uint16[:, :], Array(float64, 2, 'C', readonly=True))"


def test_tuples_are_spelled_out_so_that_numba_understands_them() -> None:
    (text,) = signatures(tuples)
    ints = numba.types.Array(numba.int32, 2, "C")
    pair = numba.types.Tuple([numba.int64, ints])
    known = numba.core.sigutils.normalize_signature(text)
    assert known == (
        (pair, numba.types.UniTuple(numba.float64, 2)),
        numba.types.Tuple([pair, numba.types.boolean]),
    )


def test_a_type_variable_stands_for_each_of_its_constraints() -> None:
    assert signatures(several) == [
        "int64(float32[::1], int64, float32[:, ::1])",
        "int64(uint8[::1], int64, uint8[:, ::1])",
    ]


def test_a_kernel_takes_nothing_but_the_types_in_its_annotations() -> None:
    ask = (
        "import numpy as np; from slz.kernels.raster.morphology import minimum_filter as kernel\n"
        "kernel(np.zeros((4, 4), np.float32), 1, 0.0); print(*kernel.signatures)\n"
        "try: kernel(np.zeros((4, 4)), 1, 0.0)\n"
        "except TypeError: print('refused')"
    )
    own = {**os.environ, "NUMBA_DISABLE_JIT": "0"}
    said = subprocess.run(
        [sys.executable, "-c", ask], env=own, cwd=REPOSITORY, check=True, capture_output=True, text=True
    ).stdout.splitlines()
    assert said == ["(Array(float32, 2, 'C', False, aligned=True), int64, float32)", "refused"]


@compiled
def test_a_part_is_compiled_with_the_kernel_that_calls_it_for_the_types_in_its_annotations() -> None:
    @kernel_part
    def half(value: float) -> float:
        return value / 2

    assert not half.signatures

    @kernel
    def quarter(value: int) -> float:
        return half(value) / 2

    assert quarter(3) == 0.75
    assert half.signatures == [(numba.float64,)]


@compiled
def test_a_part_called_alone_is_the_compiled_function_of_its_annotations() -> None:
    @kernel_part
    def third(value: float) -> float:
        return value / 3

    assert third(np.float32(1.0)) == 1.0 / 3.0
    assert third.signatures == [(numba.float64,)]


@compiled
def test_kernels_of_flights_are_compiled_before_a_flight_and_later_at_their_import(in_a_program: Ask) -> None:
    lines = in_a_program(
        "import sys, types; sys.modules['slz'] = slz = types.ModuleType('slz')\n"  # without all its kernels
        f"slz.__path__ = ['{REPOSITORY / 'slz'}']\n"
        "from slz.kernels.jit import *\n"
        "@kernel\ndef called(x: float) -> float: return x\n"
        "called(1.0)\n"
        "@kernel\ndef a(x: float) -> float: return x\n"
        "@kernel_of_source_mode\ndef b(x: float) -> float: return x\n"
        "@kernel_at_call\ndef c(x: float) -> float: return x\n"
        "def told(): print(*(len(each.signatures) for each in (a, b, c)))\n"
        "told(); load_kernels(); told(); load_kernels(source_mode=True); told(); c(1.0); told()\n"
        "@kernel\ndef d(x: float) -> float: return x\n"
        "print(len(d.signatures))"
    )
    assert lines == ["0 0 0", "1 0 0", "1 1 0", "1 1 1", "1"]


@compiled
def test_code_generation_lets_no_variables_on_the_stack_share_a_place() -> None:
    """Else what Numba takes over into callers has 16 lanes in a place that is aligned for a pointer."""
    calls = "\n".join(
        f"""
        call void @llvm.lifetime.start.p0(ptr %{name})
        store {kind} zeroinitializer, ptr %{name}
        call void @use(ptr %{name})
        call void @llvm.lifetime.end.p0(ptr %{name})"""
        for name, kind in (("words", "[11 x i64]"), ("lanes", "<16 x float>"))
    )
    module = binding.parse_assembly(
        f"""
        declare void @use(ptr)
        declare void @llvm.lifetime.start.p0(ptr)
        declare void @llvm.lifetime.end.p0(ptr)
        define void @f() {{
        %words = alloca [11 x i64]
        %lanes = alloca <16 x float>
        {calls}
        ret void
        }}"""
    )
    binding.Target.from_default_triple().create_target_machine(opt=3).emit_object(module)
    assert "@use(ptr %lanes)" in str(module)


def test_a_kernel_first_called_by_several_threads_at_once_is_compiled_for_its_annotations_alone() -> None:
    @kernel
    def eighth(value: float) -> float:
        return value / 8

    with ThreadPoolExecutor(8) as threads:
        assert set(threads.map(eighth, [np.float32(1.0), 1] * 20)) == {0.125}
    assert eighth.signatures == [(numba.float64,)]


def test_what_flights_call_is_loaded_before_them_and_what_only_kernels_or_the_desk_call_is_not() -> None:
    """Else a flight would compile or load a kernel in mid-air, or the start would load what nobody calls."""
    kinds: dict[tuple[str, str], str] = {}
    callers: dict[tuple[str, str], set[str]] = {}
    for path in program_sources():
        module, tree = (
            ".".join(path.relative_to(REPOSITORY).with_suffix("").parts),
            ast.parse(path.read_text()),
        )
        imported = {
            alias.asname or alias.name: (node.module, alias.name)
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module
            for alias in node.names
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and (kind := decorated(node)):
                kinds[module, node.name] = kind
        for name in names_outside_kernels(tree):
            callers.setdefault(imported.get(name, (module, name)), set()).add(module)
            for of, own in imported.values():  # a module's attribute
                callers.setdefault((f"{of}.{own}", name), set()).add(module)
    flown = {
        at for at, modules in callers.items() if not all(module.startswith(OFF_FLIGHT) for module in modules)
    }
    by_kind = {kind: {at for at, own in kinds.items() if own == kind} for kind in kinds.values()}
    assert len(by_kind["kernel"]) > 120
    seldom = {at for at in by_kind["kernel"] if at[0].startswith(SELDOM)}
    assert by_kind["kernel"] - flown - seldom == set()
    assert by_kind["kernel_part"] & set(callers) == set()
    assert (by_kind["kernel_at_call"] | by_kind["kernel_of_source_mode"]) & flown == OF_MAPS_WRITTEN_WHOLE
    of_paper = {
        at for at, modules in callers.items() if any(each.startswith("slz.paper") for each in modules)
    }
    assert by_kind["kernel_of_source_mode"] <= of_paper
    assert by_kind["kernel_at_call"] & of_paper == set()


def program_sources() -> Iterator[Path]:
    for folder in ("slz", "companion"):
        yield from (REPOSITORY / folder).rglob("*.py")


def decorated(function: ast.FunctionDef) -> str | None:
    """Return the name of the decorator that makes a function a kernel."""
    names = [each.id for each in function.decorator_list if isinstance(each, ast.Name)]
    return next((name for name in names if name.startswith("kernel")), None)


def names_outside_kernels(tree: ast.AST) -> Iterator[str]:
    """Yield the names that Python reads; an import alone does not."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef) and decorated(node):
            continue
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        yield from names_outside_kernels(node)
