"""Ranked values and medians against sorting."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.ranks import median, ranked


@pytest.mark.parametrize("n", [1, 2, 3, 10, 101])
@pytest.mark.parametrize("most", [1, 5, 10_000])
def test_ranked_values_and_medians_are_those_of_the_sorted_ones(n: int, most: int) -> None:
    values = np.random.default_rng(n).integers(0, most, n).astype(np.float32)
    assert [ranked(values.copy(), k) for k in range(n)] == sorted(values)
    assert median(values.copy()) == np.median(values)
    many = values.copy()
    assert (ranked(many, n // 3), ranked(many, n // 2)) == tuple(np.sort(values)[[n // 3, n // 2]])
