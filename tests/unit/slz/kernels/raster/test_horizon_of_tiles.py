"""Horizon from tiles: that of the copied layers, in the sector towards a direction and the two beside it."""

from __future__ import annotations

import numpy as np
import pytest

import params
from slz.grid import Box, Grid
from slz.landing_point.obstacles import SECTORS, horizon_at
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import SAFE


def terrain_with_walls(rng: np.random.Generator, rough_m: float) -> EvidenceTerrain:
    p = params.load("quadcopter", ["zone_m=80"])
    terrain = EvidenceTerrain(Grid.centred(3.0, -2.0, 80.0, p.cell_m), p)
    at = rng.uniform(-22, 22, (40_000, 2))
    at = at[np.hypot(*at.T) > 2.5 if rough_m > 0.2 else np.hypot(*(at - 9).T) > 4]
    up = rng.normal(0, rough_m, len(at)) + np.where(rng.random(len(at)) < 0.01, rng.uniform(0, 6, len(at)), 0)
    terrain.add(np.column_stack([at, up]), np.array([0.0, 0.0, 30.0]), 0.0)
    terrain.tiles.datum_m = 0.37
    return terrain


@pytest.mark.parametrize("rough_m", [0.01, 0.3])
@pytest.mark.parametrize("degrees", range(0, 360, 24))
def test_the_horizon_ahead_is_that_of_the_layers(rough_m: float, degrees: int) -> None:
    rng = np.random.default_rng(degrees)
    terrain = terrain_with_walls(rng, rough_m)
    towards = (np.sin(np.radians(degrees)), np.cos(np.radians(degrees)))
    point = np.array([*rng.uniform(-3, 3, 2), 0.5])
    row, col = terrain.grid.index(float(point[0]), float(point[1]))
    box = Box(row - 90, row + 91, col - 80, col + 81)
    height, top = terrain.layer("height_m", box), terrain.layer("top_m", box)
    view = np.where((terrain.state(box) == SAFE) | np.isnan(top), height, top)
    wanted = horizon_at(point, view, terrain.grid, box, 1.0, 15.0)
    found = np.degrees(terrain.horizon(point, box, 1.0, 15.0, SECTORS, towards))
    ahead = round(degrees / 360 * SECTORS)
    sectors = [(ahead + k) % SECTORS for k in (-1, 0, 1)]
    assert np.array_equal(found, np.nanmax(wanted[sectors]), equal_nan=True)
