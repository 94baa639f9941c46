"""Growth of extents, their shores, and flooded ground."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.banks import BANK_CELLS, BANK_M, DOWN, EVEN, UP, around_shore
from slz.kernels.surface.masks import bounding_boxes
from slz.kernels.surface.shores import flood, grow_extents

LEVEL, LEAST, DEEPEST = np.array([np.nan, 0.0, 1.0]), 0.01, 0.4


def flooded(
    seeds: NDArray[np.int32], level: NDArray[np.float32], may: NDArray[np.bool_], mean: NDArray[np.float32]
) -> NDArray[np.int32]:
    out = seeds.copy()
    flood(out, level.copy(), may, mean, LEAST, DEEPEST)
    return out


def level_of(labels: NDArray[np.int32]) -> NDArray[np.float32]:
    return LEVEL[labels].astype(np.float32)


@pytest.mark.parametrize("seed", range(8))
def test_water_floods_connected_lower_ground_and_never_climbs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mean = ndimage.gaussian_filter(rng.normal(0, 1.5, (30, 40)), 1.5).astype(np.float32)
    seen = rng.random(mean.shape) < 0.95
    seeds = np.zeros(mean.shape, np.int32)
    seeds[15, 20] = seeds[5, 5] = 1
    out = flooded(seeds, level_of(seeds), seen, mean)
    may = seen & (mean < -LEAST) & (mean > -DEEPEST)
    parts, _ = ndimage.label(may | (seeds > 0))
    expected = np.isin(parts, parts[seeds > 0])
    np.testing.assert_array_equal(out > 0, expected)
    assert (mean[(out > 0) & (seeds == 0)] < LEVEL[1]).all()


def test_each_water_floods_by_its_own_level() -> None:
    mean = np.array([[0.0, -0.1, -0.2, 5, 0.7, 1.0]], np.float32)
    seeds = np.array([[1, 0, 0, 0, 0, 2]], np.int32)
    out = flooded(seeds, level_of(seeds), np.ones((1, 6), np.bool_), mean)
    assert out.tolist() == [[1, 1, 1, 0, 2, 2]]


def test_an_extent_grows_by_one_cell_to_unseen_ones_and_those_of_its_level() -> None:
    labels = np.zeros((5, 5), np.int32)
    labels[2, 2] = 1
    mean, count, level = np.full((5, 5), 9.0, np.float32), np.ones((5, 5), np.float32), level_of(labels)
    mean[1, 1], mean[2, 3], count[3, 2] = 0.05, -0.2, 0
    mean[1, 2] = np.nan
    grow_extents(count, mean, labels, level, np.array([0, 0.06]), 1)
    assert np.argwhere(labels).tolist() == [[1, 1], [2, 2], [3, 2]]
    assert level[labels > 0].tolist() == [0, 0, 0]
    assert np.isnan(level[labels == 0]).all()


@pytest.mark.parametrize("seed", range(4))
def test_growing_twice_is_growing_by_one_cell_and_again(seed: int) -> None:
    rng = np.random.default_rng(seed)
    once = (rng.random((20, 30)) < 0.03) * rng.integers(1, 3, (20, 30), np.int32)
    mean, count = (rng.random((2, 20, 30)) < 0.7).astype(np.float32)
    level, band, twice = level_of(once), np.array([0, 0.1, 0.1]), once.copy()
    level_twice = level.copy()
    grow_extents(count, mean, once, level, band, 1)
    grow_extents(count, mean, once, level, band, 1)
    grow_extents(count, mean, twice, level_twice, band, 2)
    np.testing.assert_array_equal(once, twice)
    np.testing.assert_array_equal(level, level_twice)


def test_what_grows_takes_the_level_of_the_cells_beside_it() -> None:
    labels = np.zeros((3, 6), np.int32)
    labels[1, 1:5] = 1
    level = np.where(labels > 0, np.float32(0.1) * np.arange(6), np.nan).astype(np.float32)
    mean, count = np.full((3, 6), 0.1, np.float32), np.ones((3, 6), np.float32)
    grow_extents(count, mean, labels, level, np.array([0, 0.12]), 1)
    assert labels[0].tolist() == [1, 1, 1, 0, 0, 0]  # the water beside the fourth is 0.2 m higher
    np.testing.assert_allclose(level[0, :3], [0.1, 0.15, 0.2], atol=1e-6)


def test_water_floods_by_the_nearest_level() -> None:
    """A river falls to the right; land is dry that lies between its levels upstream and beside it."""
    level = np.tile(np.linspace(1, 0, 11, dtype=np.float32), (3, 1))
    seeds = np.zeros((3, 11), np.int32)
    seeds[0] = 1
    mean = np.where(seeds > 0, level, level + np.array([[0], [-0.05], [0.05]])).astype(np.float32)
    out = flooded(seeds, level, np.ones(seeds.shape, np.bool_), mean)
    assert out.tolist() == [[1] * 11, [1] * 11, [0] * 11]


@pytest.mark.parametrize("fall", [0.0, 0.1])
def test_shores_are_counted_by_kind_and_by_the_directions_that_rise(fall: float) -> None:
    row, col = np.indices((41, 41)) - 20.0
    whole = np.hypot(row, col) <= 10
    mean = np.where(row > 0, 1.0, np.where(col > 0, -1.0, 0.0)).astype(np.float32)
    level = np.where(whole, fall * row, np.nan).astype(np.float32)
    beside = np.where(np.isnan(level), 0, level)
    seen = np.ones(whole.shape, np.bool_)
    seen[:, 28:] = False
    reach, kinds = BANK_CELLS, np.zeros(3, np.int64)
    wide = np.pad(whole, reach)
    at = [(i, j) for i in range(2 * reach + 1) for j in range(2 * reach + 1)]
    around = np.any([wide[i : i + 41, j : j + 41] for i, j in at], axis=0)
    ring = around & ~whole & seen
    _, nearest = ndimage.distance_transform_edt(~whole, return_indices=True)
    above = mean - beside[tuple(nearest)]
    labels = whole.astype(np.int32)
    box = bounding_boxes(labels, 2, reach)[1]
    sides = around_shore(seen.astype(np.float32), mean, labels, level, 1, box, np.inf, kinds)
    apart = np.abs(np.abs(above) - BANK_M) > 0.02  # of equally near cells any may be taken
    if fall == 0:
        for kind, cells in {UP: above > BANK_M, DOWN: above < -BANK_M, EVEN: np.abs(above) <= BANK_M}.items():
            assert kinds[kind] == np.count_nonzero(cells & ring)
        assert sides == 5  # of the six to the north, that to the east was not seen
    assert kinds.sum() == np.count_nonzero(ring)
    assert abs(kinds[UP] - np.count_nonzero((above > BANK_M) & ring)) <= np.count_nonzero(ring & ~apart)
