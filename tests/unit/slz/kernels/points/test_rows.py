"""Rows of returns by their flags, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.points.rows import mark, picked, rows_by_scan, rows_in_turn, rows_of


@pytest.mark.parametrize(("has", "lacks"), [(0, 0), (1, 0), (0, 1), (3, 4), (8, 3)])
@pytest.mark.parametrize("n", [0, 1, 500])
def test_rows_are_those_with_all_of_one_sum_and_none_of_the_other(n: int, has: int, lacks: int) -> None:
    random = np.random.default_rng(n)
    flags, places = random.integers(0, 16, n).astype(np.uint16), random.normal(size=(n, 3))
    wanted = ((flags & has) == has) & ((flags & lacks) == 0)
    assert np.array_equal(rows_of(flags, has, lacks), np.flatnonzero(wanted))
    assert np.array_equal(picked(places, flags, has, lacks), places[wanted])


@pytest.mark.parametrize("n", [0, 1, 500])
def test_rows_by_scan_are_sorted_by_scan_and_those_of_the_last_flag_end_each(n: int) -> None:
    random = np.random.default_rng(n)
    flags, origin = random.integers(0, 16, n).astype(np.uint16), random.integers(0, 5, n).astype(np.uint16)
    wanted = [i for i in range(n) if flags[i] & (2 | 4)]
    wanted.sort(key=lambda i: (origin[i], bool(flags[i] & 4)))
    assert rows_by_scan(flags, 2, 4, origin, 5).tolist() == wanted


@pytest.mark.parametrize("n", [0, 1, 500])
def test_rows_of_one_flag_come_before_those_of_others_without_it(n: int) -> None:
    flags = np.random.default_rng(n).integers(0, 16, n).astype(np.uint16)
    first, others = (flags & 2) != 0, np.array([8, 4], np.uint16)
    wanted = [first, *(~first & ((flags & other) != 0) for other in others)]
    found = rows_in_turn(flags, 2, others)
    assert np.array_equal(found, np.concatenate([np.flatnonzero(which) for which in wanted]))


def test_a_flag_is_set_of_those_rows_alone_which_are_told() -> None:
    random = np.random.default_rng(1)
    flags, rows, which = (
        random.integers(0, 16, 90).astype(np.uint16),
        random.permutation(90)[:50],
        np.arange(50) % 3 == 0,
    )
    wanted = flags.copy()
    wanted[rows[which]] |= np.uint16(4)
    mark(flags, rows, which, 4)
    assert np.array_equal(flags, wanted)
