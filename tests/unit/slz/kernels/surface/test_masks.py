"""Labels, bounds, closing and hole filling of masks, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.kernels.surface.masks import REACH, bounding_boxes, closed_mask, connected_parts, with_holes


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (30, 41), (64, 3)])
@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.95])
def test_masks_are_closed_and_filled_as_by_scipy(shape: tuple[int, int], share: float) -> None:
    rng = np.random.default_rng(7)
    for _ in range(5):
        mask = rng.random(shape) < share
        closed, asked = ndimage.binary_closing(mask, iterations=REACH), rng.random(shape) < 0.5
        np.testing.assert_array_equal(closed_mask(mask, asked), closed & asked)
        whole = with_holes(mask.astype(np.int32), 1, np.array([0, shape[0] - 1, 0, shape[1] - 1]))
        np.testing.assert_array_equal(whole, ndimage.binary_fill_holes(mask))


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (30, 41), (64, 3)])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9])
def test_labels_and_their_bounds_are_those_of_scipy(shape: tuple[int, int], share: float) -> None:
    mask = np.random.default_rng(3).random(shape) < share
    labels, n = connected_parts(mask, 1.0, 1.0)
    expected, n_expected = ndimage.label(mask)
    np.testing.assert_array_equal(labels, expected)
    assert n == n_expected + 1
    for margin in (0, 2):
        boxes = bounding_boxes(labels, n, margin)[1:]
        for (row, last_row, col, last_col), (rows, cols) in zip(
            boxes, ndimage.find_objects(labels), strict=True
        ):
            assert row == max(0, rows.start - margin)
            assert last_row == min(shape[0], rows.stop + margin) - 1
            assert col == max(0, cols.start - margin)
            assert last_col == min(shape[1], cols.stop + margin) - 1


def test_small_parts_have_no_label_and_the_others_keep_their_order() -> None:
    mask = np.array([[1, 1, 0, 1, 0, 1], [0, 0, 0, 1, 0, 1], [1, 0, 0, 1, 0, 0]], np.bool_)
    labels, n = connected_parts(mask, 0.5, 1.0)
    assert labels.tolist() == [[1, 1, 0, 2, 0, 3], [0, 0, 0, 2, 0, 3], [0, 0, 0, 2, 0, 0]]
    assert n == 4
