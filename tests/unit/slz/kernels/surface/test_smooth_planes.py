"""Planes through windows of cells, against a least-squares fit of their returns."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.level_extents import even_falls
from slz.kernels.surface.masks import REACH, bounding_boxes, closed_mask, connected_parts, with_holes
from slz.kernels.surface.smooth_planes import FEWEST, FEWEST_CELLS, PLANE_RADIUS, smooth_planes
from slz.kernels.surface.surface_record import GRADIENT, LEVEL, RESIDUAL, N
from tests.unit.slz.surface.made_ground import places

Floats = NDArray[np.float64]


def scene(seed: int, fill: float, side: int = 12) -> tuple[Floats, NDArray[np.float32]]:
    """Return rows (row, column, height) of returns, and count, mean and squares of their cells."""
    rng = np.random.default_rng(seed)
    held = rng.integers(1, 7, (side, side)) * (rng.random((side, side)) < fill)
    row, col = (np.repeat(index.ravel(), held.ravel()) for index in np.indices((side, side)))
    z = 431.0 + 0.3 * row - 0.1 * col + rng.normal(0, 0.2, len(row))
    at = row * side + col
    n = np.bincount(at, minlength=side * side)
    mean = np.bincount(at, z, side * side) / np.maximum(n, 1)
    squares = np.bincount(at, (z - mean[at]) ** 2, side * side)
    cells = np.stack([n, mean, squares]).reshape(3, side, side).astype(np.float32)
    return np.column_stack([row, col, z]), cells


@pytest.mark.parametrize(("seed", "fill"), [(1, 1.0), (2, 0.6), (3, 0.25)])
def test_a_plane_is_the_least_squares_fit_of_its_window_s_returns(seed: int, fill: float) -> None:
    cell_m = 1.5
    returns, (count, mean, squares) = scene(seed, fill)
    out = smooth_planes(count, mean, squares, cell_m)
    fitted = 0
    for row, col in np.ndindex(count.shape):
        near = returns[(np.abs(returns[:, :2] - (row, col)) <= PLANE_RADIUS).all(axis=1)]
        assert out[N, row, col] == len(near)
        places = np.unique(near[:, :2], axis=0)
        if len(near) < FEWEST or len(places) < FEWEST_CELLS:
            assert np.isnan(out[[LEVEL, GRADIENT, RESIDUAL], row, col]).all()
            continue
        terms = np.column_stack([near[:, :2] * cell_m, np.ones(len(near))])
        plane, _, rank, _ = np.linalg.lstsq(terms, near[:, 2], rcond=None)
        if rank < 3:
            continue
        residual = np.sqrt(np.mean((near[:, 2] - terms @ plane) ** 2))
        found = out[[LEVEL, GRADIENT, RESIDUAL], row, col]
        np.testing.assert_allclose(
            found, (near[:, 2].mean(), np.hypot(*plane[:2]), residual), rtol=1e-4, atol=1e-4
        )
        fitted += 1
    assert fitted > 50


def test_cells_in_a_line_make_no_plane() -> None:
    count, mean = np.zeros((9, 9), np.float32), np.zeros((9, 9), np.float32)
    count[4] = 20
    out = smooth_planes(count, mean, np.zeros((9, 9), np.float32), 1.0)
    assert np.isnan(out[[LEVEL, GRADIENT, RESIDUAL]]).all()
    assert out[N, 4, 4] == 100


# Even falls: extents as planes over blocks, each label by itself.


X, Y = places(64)
ALL = np.array([False, True, True])


def labels() -> np.ndarray:
    """Two extents side by side."""
    return np.where(X < 30, 1, np.where(X < 32, 0, 2)).astype(np.int32)


def test_planes_are_told_with_their_gradient_and_no_unevenness() -> None:
    own = labels()
    height = np.where(own == 1, 0.003 * Y, 1 + 0.001 * X)
    off, variance, gradient = even_falls(own, height.astype(np.float32), ALL, 1.0)
    np.testing.assert_allclose(off[own > 0], 0, atol=1e-3)
    assert gradient[1:] == pytest.approx([0.003, 0.001], rel=0.02)
    assert variance.max() < 1e-6


@pytest.mark.parametrize("noise_m", [0.0, 0.02])
def test_undulation_and_noise_are_the_variance_about_the_planes(noise_m: float) -> None:
    own = labels()
    height = 0.02 * np.sin(2 * np.pi * Y / 8) * (own == 1) + np.random.default_rng(1).normal(
        0, noise_m, own.shape
    )
    _, variance, _ = even_falls(own, height.astype(np.float32), ALL, 1.0)
    assert np.sqrt(variance[1]) == pytest.approx(np.hypot(0.02 / np.sqrt(2), noise_m), rel=0.15)
    assert variance[2] == pytest.approx(noise_m**2, rel=0.15, abs=1e-6)


def test_a_river_that_bends_is_a_plane_in_each_block() -> None:
    """Its fall turns from south to east."""
    own = np.where((X < 16) | (Y < 16), 1, 0).astype(np.int32)
    height = np.where(X < 16, 0.002 * Y, 0.002 * (16 - X) + 0.032)
    _, variance, gradient = even_falls(own, height.astype(np.float32), ALL[:2], 1.0)
    assert variance[1] < 1e-6
    assert gradient[1] == pytest.approx(0.002, rel=0.02)


# Labels, bounds, closing and hole filling of masks, against SciPy.


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
