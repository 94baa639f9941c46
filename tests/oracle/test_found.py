"""Growable results: found items do not depend on the initial capacity."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.paper.zone_search import (
    BOUNDARY_AT,
    COL0,
    COL1,
    CONTENT_AT,
    N_BOUNDARY,
    N_CELLS,
    ROW0,
    ROW1,
    search_zones,
)
from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.connected_components import largest_groups, runs

Bytes = NDArray[np.uint8]


def found(safe: Bytes, least: int, longest: int) -> tuple[list[list[int]], NDArray[np.int32], list[int]]:
    bits = packed(safe)
    taken = np.zeros_like(bits)
    words = bits.shape[1]
    table, boundary, content, _ = search_zones(bits, bits, taken, 0, len(safe), 0, words, least, longest)
    return table.tolist(), boundary, content.tolist()


@pytest.mark.parametrize("longest", [4, 7, 1000])
def test_a_boundary_longer_than_expected_is_found_whole(longest: int) -> None:
    safe = np.zeros((12, 70), np.uint8)
    safe[2:10, 3:67] = 1
    safe[4:7, 20:30] = 0  # a hole
    table, boundary, content = found(safe, 4, longest)
    assert len(table) == 1
    entry = table[0]
    assert [entry[k] for k in (ROW0, ROW1, COL0, COL1)] == [2, 10, 3, 67]
    assert entry[N_CELLS] == 8 * 64  # the hole is content
    assert entry[N_BOUNDARY] == len(boundary) == 2 * (8 + 64) - 4
    assert boundary[0].tolist() == [2, 3]
    assert sum(map(int.bit_count, content)) == 8 * 64


def test_as_many_components_are_found_as_there_are() -> None:
    safe = np.zeros((64, 260), np.uint8)
    for row in range(1, 60, 6):
        for col in range(1, 255, 8):
            safe[row : row + 4, col : col + 6] = 1
    table, boundary, _ = found(safe, 4, 64)
    assert len(table) == 10 * 32
    assert {entry[N_CELLS] for entry in table} == {24}
    assert [entry[BOUNDARY_AT] for entry in table] == [16 * k for k in range(320)]
    assert len(boundary) == 16 * 320
    starts = boundary[[entry[BOUNDARY_AT] for entry in table]].tolist()
    assert starts == [[entry[ROW0], entry[COL0]] for entry in table]


def test_contents_lie_one_after_the_other_whatever_their_size() -> None:
    safe = np.zeros((300, 66 * 64), np.uint8)
    safe[1:90, 1:-1] = 1
    safe[100:110, 1:20] = 1
    table, _, content = found(safe, 4, 40_000)
    assert [entry[CONTENT_AT] for entry in table] == [0, 89 * 66]
    assert len(content) == 89 * 66 + 10
    assert sum(map(int.bit_count, content[89 * 66 :])) == 10 * 19


def test_a_component_whose_boundary_is_too_short_is_none() -> None:
    safe = np.zeros((9, 64), np.uint8)
    safe[1:3, 1:3], safe[4:8, 5:9] = 1, 1
    table, boundary, _ = found(safe, 8, 64)
    assert [entry[ROW0] for entry in table] == [4]
    assert len(boundary) == 12


def test_runs_go_on_over_words_and_are_as_many_as_there_are() -> None:
    cells = np.zeros((40, 256), np.uint8)
    cells[0, 3:250] = 1
    cells[1, 64:128] = 1
    cells[2:, ::2] = 1
    out = runs(packed(cells))
    assert out[:2].tolist() == [[0, 3, 250, 0], [1, 64, 128, 1]]
    assert len(out) == 2 + 38 * 128
    assert (out[2:, 2] - out[2:, 1] == 1).all()
    assert out[:, 3].tolist() == list(range(len(out)))


def test_of_many_groups_the_largest_are_kept_in_the_order_of_their_first_cells() -> None:
    cells = np.zeros((12, 64), np.uint8)
    cells[1, 1:4] = 1
    cells[1, 10], cells[2, 11], cells[3, 10] = 1, 1, 1  # corners touch
    cells[6, 20:22] = 1
    cells[9, 5:25] = 1
    groups, members = largest_groups(packed(cells), 3)
    assert groups[:, :4].tolist() == [[1, 2, 1, 4], [1, 4, 10, 12], [9, 10, 5, 25]]
    assert groups[:, 4:].tolist() == [[0, 3], [3, 6], [6, 26]]
    assert members[3:6].tolist() == [[1, 10], [2, 11], [3, 10]]
    everything, _ = largest_groups(packed(cells), 99)
    assert len(everything) == 4
