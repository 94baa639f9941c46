"""SIMD operations against NumPy, for any alignment and values."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.elementary_functions import median, ranked
from slz.kernels.jit import kernel
from slz.kernels.simd import (
    LANES,
    broadcast,
    broadcast_wide,
    columns,
    flags,
    flags_of,
    fused_multiply_add,
    load,
    load_wide,
    logical_and,
    narrowed,
    prefetch,
    sqrt,
    store,
    store_bytes,
    store_wide,
    where,
    widened,
)

Floats = Array1D[np.float32]
ODD = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-40, 3e38, -1.5], np.float32)


@kernel
def all_of_them(a: Floats, b: Floats, at: int, out: Array2D[np.float32], bits: Array1D[np.uint64]) -> None:
    flat = out.ravel()
    x, y = load(a, at), load(b, at)
    store(flat, 0, x + y)
    store(flat, LANES, x - y)
    store(flat, 2 * LANES, x * y)
    store(flat, 3 * LANES, x / y)
    store(flat, 4 * LANES, sqrt(x))
    store(flat, 5 * LANES, where(x < y, x, broadcast(np.float32(7.0)) + y))
    bits[0], bits[1], bits[2] = flags_of(x < y), flags_of(x == y), flags_of(logical_and(x == x, y < x))


@kernel
def wide_ones(
    a: Floats,
    b: Array1D[np.float64],
    at: int,
    out: Array2D[np.float64],
    narrow: Floats,
    states: Array1D[np.uint8],
    bits: Array1D[np.uint64],
) -> None:
    flat = out.ravel()
    x, y = widened(load(a, at)), load_wide(b, at)
    store_wide(flat, 0, x + y)
    store_wide(flat, LANES, x - y)
    store_wide(flat, 2 * LANES, x * y)
    store_wide(flat, 3 * LANES, x / broadcast_wide(b[0]))
    store(narrow, 0, narrowed(y))
    bits[2] = flags_of(flags(bits[0]))
    store_bytes(states, at, flags(bits[0]), flags(bits[1]))


@pytest.mark.parametrize("at", [0, 1, 7, 33])
def test_wide_lanes_and_bytes_are_what_numpy_makes_of_them(at: int) -> None:
    rng = np.random.default_rng(at)
    a, b = rng.normal(0.0, 3.0, 64).astype(np.float32), rng.normal(0.0, 3.0, 64)
    a[at : at + 16 : 2], b[at + 1] = ODD, 1e300
    out, narrow, states = np.empty((4, LANES)), np.empty(LANES, np.float32), np.full(64, 7, np.uint8)
    bits = np.array([0b1010_0000_1111_0101, 0b0101_0000_0000_1010, 0], np.uint64)
    with np.errstate(all="ignore"):
        wide_ones(a, b, at, out, narrow, states, bits)
        x, y = a[at : at + LANES].astype(np.float64), b[at : at + LANES]
        np.testing.assert_array_equal(out, np.array([x + y, x - y, x * y, x / b[0]]))
        np.testing.assert_array_equal(narrow, y.astype(np.float32))
    assert bits[2] == bits[0]
    ones, alls = ([int(word) >> i & 1 for i in range(LANES)] for word in bits[:2])
    expected = [255 if every_bit else one for one, every_bit in zip(ones, alls, strict=True)]
    assert states[at : at + LANES].tolist() == expected
    assert (np.delete(states, range(at, at + LANES)) == 7).all()


def bits_of(flags: NDArray[np.bool_]) -> int:
    return sum(1 << i for i in np.flatnonzero(flags).tolist())


@pytest.mark.parametrize("at", [0, 1, 7, 33])
def test_lanes_are_what_numpy_makes_of_them(at: int) -> None:
    rng = np.random.default_rng(at)
    a, b = (rng.normal(0.0, 3.0, 64).astype(np.float32) for _ in "ab")
    a[at : at + 16 : 2], b[at + 1 : at + 16 : 5] = ODD, ODD[:3]
    b[at + 4] = a[at + 4] = 2.0
    out, bits = np.empty((6, LANES), np.float32), np.empty(3, np.uint64)
    all_of_them(a, b, at, out, bits)
    x, y = a[at : at + LANES], b[at : at + LANES]
    with np.errstate(all="ignore"):
        plain = [x + y, x - y, x * y, x / y, np.sqrt(x), np.where(x < y, x, np.float32(7.0) + y)]
    np.testing.assert_array_equal(out, np.array(plain, np.float32))
    assert bits.tolist() == [bits_of(x < y), bits_of(x == y), bits_of((x == x) & (y < x))]


@kernel
def multiplied_and_added(a: Floats, b: Floats, c: Floats, out: Floats) -> None:
    store(out, 0, fused_multiply_add(load(a, 0), load(b, 0), load(c, 0)))


def test_a_product_is_rounded_before_the_sum_or_with_it() -> None:
    rng = np.random.default_rng(6)
    a, b, c = (rng.normal(0.0, 3.0, LANES).astype(np.float32) for _ in "abc")
    out, exact = np.empty(LANES, np.float32), a.astype(np.float64) * b + c
    multiplied_and_added(a, b, c, out)
    at_once, one_by_one = exact.astype(np.float32), a * b + c
    assert ((out == at_once) | (out == one_by_one)).all()


@kernel
def in_columns(values: Floats, at: int, out: Floats) -> None:
    prefetch(values, at)
    for i, column in enumerate(columns(values, at)):
        store(out, LANES * i, column)


@pytest.mark.parametrize("at", [0, 3, 16])
def test_columns_are_those_of_16_rows_of_16_numbers(at: int) -> None:
    values, out = np.arange(300, dtype=np.float32), np.empty(LANES * LANES, np.float32)
    in_columns(values, at, out)
    rows = values[at : at + LANES * LANES].reshape(LANES, LANES)
    np.testing.assert_array_equal(out.reshape(LANES, LANES), rows.T)


# Ranked values and medians against sorting.


@pytest.mark.parametrize("n", [1, 2, 3, 10, 101])
@pytest.mark.parametrize("most", [1, 5, 10_000])
def test_ranked_values_and_medians_are_those_of_the_sorted_ones(n: int, most: int) -> None:
    values = np.random.default_rng(n).integers(0, most, n).astype(np.float32)
    assert [ranked(values.copy(), k) for k in range(n)] == sorted(values)
    assert median(values.copy()) == np.median(values)
    many = values.copy()
    assert (ranked(many, n // 3), ranked(many, n // 2)) == tuple(np.sort(values)[[n // 3, n // 2]])
