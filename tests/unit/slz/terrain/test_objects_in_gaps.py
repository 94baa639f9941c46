"""Objects in or beside unseen ground: they neither make it seen nor turn level ground into an obstacle."""

from __future__ import annotations

import numpy as np
import pytest

import params
from slz import SAFE, Pipeline
from tests.unit.slz.hand_made import flat, fly, maps, returns
from tests.unit.slz.test_departures import pipeline


@pytest.mark.parametrize(
    ("cell_m", "coverage_m", "footprint_m", "beside"), [(1.0, 3.0, 1.0, 2), (0.2, 1.0, 2.0, 4)]
)
def test_a_beam_in_the_middle_of_a_gap_makes_no_unknown_cell_safe(
    cell_m: float, coverage_m: float, footprint_m: float, beside: int
) -> None:
    states = []
    for beam in (False, True):
        height = flat(60, 60)
        height[:, 30 - beside : 30 + beside + 1] = np.nan
        if beam:
            height[:, 30] = 1.5
        own = [f"cell_m={cell_m}", f"coverage_m={coverage_m}", f"footprint_m={footprint_m}"]
        pipe = Pipeline(params.load("quadcopter", [*own, "zone_m=160", "angle_noise_deg=0"]), (0.0, 0.0))
        fly(pipe, returns(height, cell_m))
        states.append(maps(pipe).state)
    assert not ((states[0] != SAFE) & (states[1] == SAFE)).any()


def test_the_level_shore_of_a_pond_is_no_obstacle() -> None:
    height = flat(40, 40)
    height[17:23, 17:23] = np.nan
    (zone,) = fly(pipeline("default"), returns(height, 1.0)).zones
    assert zone.n_unsafe == 0
    assert zone.obstacles == ()


def test_source_a_safe_court_in_a_ring_is_no_obstacle() -> None:
    height = flat(40, 40)
    height[12:28, 12:28] = 3.0
    height[14:26, 14:26] = 0.0
    (zone,) = fly(pipeline("source"), returns(height, 1.0)).zones
    assert not any(o.width_m > 5 for o in zone.obstacles)
    assert not any(np.isnan(o.height_m) for o in zone.obstacles)
