"""Word operations of bitmaps against the digits of the word; uncompiled, their plain forms."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import numba
import numpy as np
import pytest

from slz.kernels.jit import kernel_for_any_types
from slz.kernels.raster import bitmap

RANDOM = Random(7)
WORDS = [0, 1, 2, 3, 2**31, 2**32, 2**62, 2**63, 2**63 - 1, 2**64 - 2, 2**64 - 1]
WORDS += [RANDOM.getrandbits(64) >> RANDOM.randrange(64) for _ in range(200)]


@kernel_for_any_types
def _population(word: np.uint64) -> np.uint64:
    return np.uint64(bitmap.popcount(word))


@kernel_for_any_types
def _lowest(word: np.uint64) -> np.uint64:
    return np.uint64(bitmap.lowest(word))


@kernel_for_any_types
def _leading(word: np.uint64) -> np.uint64:
    return np.uint64(bitmap.leading(word))


def _naive(word: int) -> str:
    return f"{word:064b}"


def _trailing_zeros(word: int) -> int:
    return len(_naive(word)) - len(_naive(word).rstrip("0"))


def _leading_zeros(word: int) -> int:
    return len(_naive(word)) - len(_naive(word).lstrip("0"))


@pytest.mark.parametrize(
    ("kernel_of", "counted"),
    [
        (_population, lambda word: _naive(word).count("1")),
        (_lowest, _trailing_zeros),
        (_leading, _leading_zeros),
    ],
    ids=["population", "lowest", "leading"],
)
def test_a_word_s_operation_counts_the_bits_of_its_digits(
    kernel_of: Callable[[np.uint64], np.uint64], counted: Callable[[int], int]
) -> None:
    for word in WORDS:
        assert int(kernel_of(np.uint64(word))) == counted(word), hex(word)


def test_the_tests_run_compiled_unless_asked_otherwise() -> None:
    assert isinstance(bitmap.bit, numba.core.dispatcher.Dispatcher) is not bool(numba.config.DISABLE_JIT)
