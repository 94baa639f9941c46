"""Maps derived where evidence changed are those of all evidence derived anew, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

import params
from slz.grid import Grid
from slz.terrain.layers import LAYERS
from slz.terrain.terrain import EvidenceTerrain

SENSOR = np.array([0.0, 0.0, 20.0])


def bumpy(rng: np.random.Generator, count: int) -> np.ndarray:
    """Returns scattered over a slope with steps, holes without a return, and a few poles."""
    east, north = rng.uniform(-14, 14, (2, count)) + rng.uniform(-6, 6, (2, 1))
    up = 0.05 * east + 0.15 * (np.floor(east / 3) % 2) + rng.normal(0, 0.02, count)
    up[rng.random(count) < 0.002] += 1.5
    kept = (np.hypot(east % 9 - 4, north % 7 - 3) > 1.1) | (rng.random(count) < 0.02)
    return np.column_stack([east, north, up])[kept]


@pytest.mark.parametrize("profile", ["quadcopter", "helicopter"])
@pytest.mark.parametrize(
    ("seed", "count", "windows", "step_s"), [(1, 3000, 12, 0.1), (2, 600, 20, 1.0), (3, 900, 12, 40.0)]
)
def test_windows_one_by_one_give_the_maps_of_all_evidence(
    profile: str, seed: int, count: int, windows: int, step_s: float
) -> None:
    rng, p = np.random.default_rng(seed), params.load(profile, ["zone_m=80"])
    terrain = EvidenceTerrain(Grid.centred(0.0, 0.0, 80.0, p.cell_m), p)
    for k in range(windows):
        terrain.add(bumpy(rng, count if k < 6 else 40), SENSOR, k * step_s, rng.uniform(-15, 15, (20, 3)))
    anew = terrain.at_level(0)
    box = terrain.seen
    assert np.array_equal(terrain.state(box), anew.state(box))
    for layer in LAYERS:
        own, other = terrain.layer(layer.name, box), anew.layer(layer.name, box)
        assert np.array_equal(own, other, equal_nan=True), layer.name
