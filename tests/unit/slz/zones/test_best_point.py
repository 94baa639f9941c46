"""Where in a zone its best point lies."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import Pipeline, Zone
from tests.unit.slz.hand_made import returns, window

Floats = NDArray[np.float64]
CELL_M, SIDE, STRIPE = 0.2, 100, 3
HALF_M = CELL_M * SIDE / 2


def garden(even_cells: int) -> Floats:
    """Paving in stripes, 0.22 m high: safe with little to spare. In the east it is even."""
    out = np.zeros((SIDE, SIDE))
    paved = np.arange(SIDE) // STRIPE % 2 == 1
    out[np.ix_(paved, np.arange(SIDE) < SIDE - even_cells)] = 0.22
    return out


def zone_of(heights: Floats) -> Zone:
    settings = ["min_boundary_points=4", "gear=none"]
    pipe = Pipeline(params.load("quadcopter", settings), (0.0, 0.0), follow=False)
    points = np.repeat(returns(heights, CELL_M, -HALF_M, -HALF_M), 3, axis=0)
    (zone,) = pipe.process(window(points)).near.zones
    return zone


def test_the_point_lies_on_undoubted_ground_where_that_is_wide_enough_for_a_zone() -> None:
    best = zone_of(garden(even_cells=30)).best
    assert HALF_M - 30 * CELL_M < best.enu_m[0] < HALF_M
    assert best.certainty > 0.99
    assert best.clearance_m > 1.5


def test_without_such_ground_the_point_has_the_greatest_clearance_of_the_zone() -> None:
    best = zone_of(garden(even_cells=10)).best
    assert best.enu_m[:2] == pytest.approx([0.0, 0.0], abs=4.0)
    assert best.clearance_m > 5.0
