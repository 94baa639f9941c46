"""Cells of zones within a box, for any overlap of box and zone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slz.grid import Box
from slz.zone import Zone, zone_mask

edge = st.integers(-12, 12)
boxes = st.builds(
    lambda r, c, h, w: Box(r, r + h, c, c + w), edge, edge, st.integers(1, 9), st.integers(1, 9)
)


def zone(box: Box, seed: int) -> Any:
    return SimpleNamespace(box=box, cells=np.random.default_rng(seed).integers(0, 2, box.shape, np.uint8))


@given(boxes, boxes, boxes, st.integers(0, 99))
def test_a_cell_is_in_the_mask_where_a_zone_holds_it(box: Box, first: Box, second: Box, seed: int) -> None:
    zones = zone(first, seed), zone(second, seed + 1)
    found = zone_mask(zones, box)
    for row in range(box.row0, box.row1):
        for col in range(box.col0, box.col1):
            held = any(Zone.holds(one, row, col) for one in zones)
            assert found[row - box.row0, col - box.col0] == held


@pytest.mark.parametrize(("row", "col"), [(3, 5), (2, 4), (7, 5), (3, 9)])
def test_a_zone_holds_the_cells_of_its_box_that_are_its_own(row: int, col: int) -> None:
    one = zone(Box(3, 7, 5, 9), 1)
    inside = 3 <= row < 7 and 5 <= col < 9
    assert Zone.holds(one, row, col) == (inside and bool(one.cells[row - 3, col - 5]))
