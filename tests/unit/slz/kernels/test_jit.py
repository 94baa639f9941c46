"""Signatures of kernels, from their annotations."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TypeVar

import numba
import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array4D, Float32, ReadOnly2D, Strided2D
from slz.kernels.jit import signatures
from tests import REPOSITORY

Value = TypeVar("Value", np.float32, np.uint8)
Pair = tuple[int, Array2D[np.int32]]


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
