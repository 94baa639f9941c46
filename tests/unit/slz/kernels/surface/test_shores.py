"""Growth of extents, their shores, and flooded ground."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.kernels.surface.shores import DOWN, EVEN, UP, around_shore, flood, grow

LEVEL, LEAST, DEEPEST = np.array([np.nan, 0.0, 1.0]), 0.01, 0.4


@pytest.mark.parametrize("seed", range(8))
def test_water_floods_connected_lower_ground_and_never_climbs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mean = ndimage.gaussian_filter(rng.normal(0, 1.5, (30, 40)), 1.5).astype(np.float32)
    seen = rng.random(mean.shape) < 0.95
    seeds = np.zeros(mean.shape, np.int32)
    seeds[15, 20] = seeds[5, 5] = 1
    out = flood(seeds, seen, mean, LEVEL, LEAST, DEEPEST)
    may = seen & (mean < -LEAST) & (mean > -DEEPEST)
    parts, _ = ndimage.label(may | (seeds > 0))
    expected = np.isin(parts, parts[seeds > 0])
    np.testing.assert_array_equal(out > 0, expected)
    assert (mean[(out > 0) & (seeds == 0)] < LEVEL[1]).all()


def test_each_water_floods_by_its_own_level() -> None:
    mean = np.array([[0.0, -0.1, -0.2, 5, 0.7, 1.0]], np.float32)
    seeds = np.array([[1, 0, 0, 0, 0, 2]], np.int32)
    out = flood(seeds, np.ones((1, 6), np.bool_), mean, LEVEL, LEAST, DEEPEST)
    assert out.tolist() == [[1, 1, 1, 0, 2, 2]]
    assert seeds.tolist() == [[1, 0, 0, 0, 0, 2]]


def test_an_extent_grows_by_one_cell_to_unseen_ones_and_those_of_its_level() -> None:
    labels = np.zeros((5, 5), np.int32)
    labels[2, 2] = 1
    mean, seen = np.full((5, 5), 9.0, np.float32), np.ones((5, 5), np.bool_)
    mean[1, 1], mean[2, 3], seen[3, 2] = 0.05, -0.2, False
    mean[1, 2] = np.nan
    out = grow(labels, seen, mean, LEVEL[:2], np.array([0, 0.06]))
    assert np.argwhere(out).tolist() == [[1, 1], [2, 2], [3, 2]]


def test_shores_are_counted_by_kind_and_by_the_directions_that_rise() -> None:
    row, col = np.indices((41, 41)) - 20.0
    ring = ((np.hypot(row, col) > 10) & (np.hypot(row, col) < 14)).astype(np.int32)
    mean = np.where(row > 0, 1.0, np.where(col > 0, -1.0, 0.0)).astype(np.float32)
    seen = np.ones(ring.shape, np.bool_)
    seen[:, 28:] = False
    there, count = (ring > 0) & seen, np.zeros(3, np.int64)
    sides = around_shore(there, mean, LEVEL[1], 20.0, 20.0, 0.1, np.inf, 12, count)
    expected = {UP: mean > 0.5, DOWN: mean < -0.5, EVEN: mean == 0}
    for kind, cells in expected.items():
        assert count[kind] == np.count_nonzero(cells & there)
    assert sides == 5  # of the six to the north, that to the east was not seen
