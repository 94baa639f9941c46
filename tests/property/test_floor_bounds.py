"""Bounds on the planes on which a gear rests, against the search for these planes."""

from __future__ import annotations

import math

import numpy as np
import pytest

import params
from slz.kernels.footprint.rest_planes import highest_floors, keep_rests, rests_anyhow
from slz.kernels.footprint.rest_pose import Ground
from slz.terrain.discs import discs_of
from slz.terrain.gear import gear_of

CELL_M, RADIUS, ROWS, COLS, EDGE = 0.5, 3, 2, 2, 16
YAW_ERROR, NOISE_M = math.radians(10.0), 0.02


def rough_ground(rng: np.random.Generator) -> Ground:
    """Return a slope with steps, noise and gaps."""
    side = 2 * EDGE + ROWS
    row, col = np.mgrid[:side, :side] * CELL_M
    height = rng.uniform(-0.15, 0.15) * row + rng.uniform(-0.15, 0.15) * col
    for _ in range(rng.integers(0, 4)):
        r, c, size = rng.integers(EDGE - 6, EDGE + 6), rng.integers(EDGE - 6, EDGE + 6), rng.integers(1, 5)
        height[r : r + size, c : c + size] += rng.uniform(-0.3, 0.3)
    spread = rng.uniform(0.0, rng.choice([0.005, 0.05]), height.shape)
    known = rng.random(height.shape) > rng.choice([0.0, 0.0, 0.1])
    lower = np.where(known, height - spread, np.inf).astype(np.float32)
    upper = np.where(known, height + spread, -np.inf).astype(np.float32)
    middle = np.where(known, height, 0.0).astype(np.float32)
    return lower.ravel(), middle.ravel(), upper.ravel(), side, EDGE, EDGE


@pytest.mark.parametrize(("gear", "seed"), [("skids", 1), ("skids", 2), ("pads", 3), ("tripod", 4)])
def test_no_rest_plane_is_outside_the_bounds(gear: str, seed: int) -> None:
    sizes = {"footprint_m": 3.0, "gear": gear, "gear_length_m": 1.8, "gear_width_m": 1.3, "cell_m": CELL_M}
    rotor = {"rotor_diameter_m": 6.0, "rotor_height_m": 1.5, "tail_length_m": 4.0, "tail_height_m": 0.9}
    p = params.build({**sizes, **rotor})
    made, discs, rng = gear_of(p, CELL_M), discs_of(p, CELL_M), np.random.default_rng(seed)
    assert discs is not None
    shape = ROWS * COLS, len(discs.corners_m), discs.corners_m.shape[1] // 2
    held = even = 0
    for _ in range(60):
        box = rough_ground(rng), RADIUS, ROWS, COLS, CELL_M
        floors, least, most = np.empty(shape), np.empty(shape), np.empty(shape)
        steepest, bound = np.empty(shape[:2]), np.empty(shape[:2])
        fits = np.ones(shape[1], np.bool_)
        keep_rests(
            *box, made.contacts_m, made.limits, NOISE_M, YAW_ERROR, fits, discs.corners_m, floors, steepest
        )
        highest_floors(*box, made.limits, discs.corners_m, most)
        assert (floors[:, fits] <= most[:, fits]).all()
        if rests_anyhow(*box, made.limits, discs.corners_m, least, bound):
            even += 1
            assert fits.all()
            assert (least <= floors + 1e-9).all()
            assert (steepest <= bound + 1e-9).all()
        held += int(fits.sum())
    assert held > 100, "hardly any heading was kept: nothing was compared"
    assert even > 0
