"""Planes through windows of cells, against a least-squares fit of their returns."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.surface.smooth_planes import FEWEST, FEWEST_CELLS, PLANE_RADIUS, smooth_planes
from slz.kernels.surface.surface_record import GRADIENT, LEVEL, RESIDUAL, N

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
