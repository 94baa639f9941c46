"""Tops of the far map beside a near map that knows a part of the ground."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.air.corridor_obstacles import forget_known

FLOOR_M = 0.3
NEAR_M, FAR_M = 0.2, 0.5


def left(ground: NDArray[np.float32], shift_m: float = 0.0, offset_m: float = 0.0) -> NDArray[np.bool_]:
    """Return (12, 12) which tops of a far map are left; the near map's corner is 1 m and `offset_m` in it."""
    top = np.full((12, 12), 2.0, np.float32)
    corner = shift_m - 1.0
    forget_known(top, corner, corner, FAR_M, ground, shift_m + offset_m, shift_m + offset_m, NEAR_M, FLOOR_M)
    return np.isfinite(top)


@pytest.mark.parametrize("shift_m", [0.0, -37.3, 1234.4])
def test_tops_over_ground_that_the_near_map_knows_are_forgotten(shift_m: float) -> None:
    found = left(np.zeros((20, 20), np.float32), shift_m)  # 4 m: eight cells of the far map from the third on
    inside = np.zeros((12, 12), bool)
    inside[2:10, 2:10] = True
    np.testing.assert_array_equal(found, ~inside)


def test_a_cell_that_the_near_map_knows_in_part_keeps_its_top() -> None:
    ground = np.zeros((20, 20), np.float32)
    ground[0, 0] = np.nan
    found = left(ground)
    assert found[2, 2]
    assert not found[2, 3]


def test_a_cell_that_the_near_map_covers_in_part_keeps_its_top() -> None:
    found = left(np.zeros((20, 20), np.float32), offset_m=0.1)
    assert found[2].all()
    assert not found[3, 3:9].any()


def test_a_top_below_the_floor_stays() -> None:
    top = np.full((4, 4), 0.2, np.float32)
    forget_known(top, 0.0, 0.0, FAR_M, np.zeros((10, 10), np.float32), 0.0, 0.0, NEAR_M, FLOOR_M)
    assert np.isfinite(top).all()
