"""Plateaus of cells joined by small steps, against SciPy and a plain graph."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from slz.kernels.surface.raised_plateaus import LEAST_DROP_M, MOST_DROPS, connect, plateau_edges

Cells = NDArray[np.float32]


def in_graph(height: Cells, step: float) -> tuple[NDArray[np.int32], int]:
    """Return labels and their number from a graph of cells: next ones, and next but one across an unknown."""
    known, at = ~np.isnan(height), np.arange(height.size).reshape(height.shape)
    pairs = []
    for axis in (0, 1):
        h, k, i = np.moveaxis(height, axis, 0), np.moveaxis(known, axis, 0), np.moveaxis(at, axis, 0)
        near = k[:-1] & k[1:] & ~(np.abs(h[1:] - h[:-1]) > step)
        over = k[:-2] & ~k[1:-1] & k[2:] & ~(np.abs(h[2:] - h[:-2]) > step)
        pairs += [np.stack([i[:-1][near], i[1:][near]]), np.stack([i[:-2][over], i[2:][over]])]
    a, b = np.concatenate(pairs, axis=1)
    _, group = connected_components(coo_array((np.ones(len(a)), (a, b)), (height.size,) * 2))
    own = group[known.ravel()]
    _, first = np.unique(own, return_index=True)
    number = np.zeros(group.max() + 1, np.int32)
    number[own[np.sort(first)]] = np.arange(1, len(first) + 1)
    return np.where(known, number[group].reshape(height.shape), 0).astype(np.int32), len(first)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("step", [0.0, 0.4, 3.0])
def test_labels_are_the_components_of_the_graph_of_small_steps(seed: int, step: float) -> None:
    rng = np.random.default_rng(seed)
    height = rng.choice([0, 0.1, 0.2, 0.6, 2.0], (14, 19)).astype(np.float32)
    height[rng.random(height.shape) < 0.1 * seed] = np.nan
    labels, n = connect(height, step)
    expected, expected_n = in_graph(height, step)
    assert n == expected_n
    np.testing.assert_array_equal(labels, expected)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_two_heights_far_apart_are_labelled_as_by_scipy(share: float) -> None:
    high = np.random.default_rng(8).random((40, 31)) < share
    labels, n = connect(np.where(high, np.float32(9), np.float32(0)), 1.0)
    up, n_up = ndimage.label(high)
    down, n_down = ndimage.label(~high)
    pairs = np.unique(np.stack([labels, np.where(high, up, -down)]).reshape(2, -1), axis=1)
    assert n == n_up + n_down == pairs.shape[1]


def test_unknown_cells_have_no_label() -> None:
    labels, n = connect(np.full((3, 4), np.nan, np.float32), 1.0)
    assert n == 0
    assert not labels.any()


def test_edges_count_the_drops_of_a_block_and_hold_as_many_as_there_is_room_for() -> None:
    height = np.zeros((200, 200), np.float32)
    height[60:120, 60:140] = LEAST_DROP_M + 2.5
    labels, n = connect(height, 0.3)
    drops, known, down = plateau_edges(height, labels, np.zeros_like(labels), n + 1, 4)
    own = labels[80, 80]
    assert known[own] == down[own] == 2 * (60 + 80) > MOST_DROPS
    np.testing.assert_array_equal(drops[own], 4.0)
    assert down[labels[0, 0]] == 0
