"""Kernels: their signatures, from their annotations, and which of them the start loads."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import numba
import numpy as np
import pytest

from slz.kernels.argument_types import Array1D, Array2D, Array4D, Float32, ReadOnly2D, Strided2D
from slz.kernels.jit import kernel, kernel_part, signatures
from tests import REPOSITORY

Value = TypeVar("Value", np.float32, np.uint8)
Pair = tuple[int, Array2D[np.int32]]
compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiler")


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
        "print(*kernel.signatures)\n"
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


def test_what_python_calls_is_loaded_at_import_and_what_only_kernels_call_is_not() -> None:
    """Else a flight would compile or load a kernel in mid-air, or the start would load what nobody calls."""
    files = [ast.parse(path.read_text("utf-8")) for path in program_sources()]
    kinds = {
        function.name: kind
        for tree in files
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef) and (kind := decorated(function))
    }
    called = {name for tree in files for name in names_outside_kernels(tree)}
    assert sum(kind == "kernel" for kind in kinds.values()) > 150
    assert [name for name, kind in kinds.items() if kind == "kernel" and name not in called] == []
    assert [name for name, kind in kinds.items() if kind == "kernel_part" and name in called] == []


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
