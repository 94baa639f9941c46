"""River with waves and water clear to muddy in a strong wind, with banks, a gravel bar and a meadow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Polygon, Scene, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.surface_layers import MEADOW
from sitl.world.water_waves import WaterState

LEVEL_M, BED_M, BANK_M = -1.2, -2.9, 9.0
HALF_BED_M = 9.0
BAR = (45.0, 16.0)
"""Gravel bar: east, half length."""
TURBIDITY = (0.0, 0.03)
"""Range from which a seed draws: a clear to a muddy river, see ``WaterState.turbid``."""
FALL = (0.0, 0.003)
"""Range from which a seed draws: rivers of the plains, and of the hills before them."""


def build(seed: int) -> Scene:
    """Return the river; the seed sets relief, trees, turbidity and fall."""
    terrain_rng, rng, water_rng = np.random.default_rng(seed).spawn(3)
    turbid, fall = (float(water_rng.uniform(*drawn)) for drawn in (TURBIDITY, FALL))
    water = WaterState(wind_ms=8.0, fetch_m=600.0, towards_rad=0.2, turbid=turbid)
    terrain = Terrain(150.0, 0.5, terrain_rng)
    terrain.swell(0.3, 70.0)
    terrain.level(terrain.rectangle(-8.0, -6.0, 8.0, 10.0), 0.0, 10.0)
    terrain.grow(terrain.rectangle(-140.0, 20.0, 140.0, 120.0), MEADOW)
    off = np.abs(terrain.y - _middle(terrain.x))
    terrain.level(off < HALF_BED_M, BED_M, BANK_M)
    terrain.cover(off < HALF_BED_M + 5.0, Kind.GRAVEL)
    along = np.clip(1.0 - ((terrain.x - BAR[0]) / BAR[1]) ** 2, 0.0, 1.0)
    across = np.clip(1.0 - ((terrain.y - _middle(terrain.x) - 7.0) / 6.0) ** 2, 0.0, 1.0)
    terrain.z += (LEVEL_M - BED_M + 0.3) * along * across * (off < HALF_BED_M + 4.0)
    falling = -fall * terrain.x
    terrain.z += falling
    terrain.stand_water(off < HALF_BED_M + BANK_M, LEVEL_M + falling)
    solids: list[Solid] = []
    for k in range(50):
        x, y = rng.uniform(-145.0, 145.0), rng.uniform(-145.0, 145.0)
        if abs(y - float(_middle(np.array(x)))) > 24.0 and np.hypot(x, y) > 25.0:
            solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 12.0), rng)
    return Scene(
        name="river",
        seed=seed,
        world=terrain.world(solids, water=water),
        home_enu=(0.0, 2.0, 0.0),
        description="River 28 m wide with waves in a wind of 8 m/s, a gravel bar, meadows and trees",
        regions={"river": _course(), "meadow": rectangle(-140.0, 20.0, 140.0, 120.0)},
    )


def _middle(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the north of the river's middle."""
    return np.asarray(-22.0 + 6.0 * np.sin(x / 40.0))


def _course() -> Polygon:
    """Return the polygon of the deep water."""
    xs = np.linspace(-148.0, 148.0, 60)
    south = [(float(x), float(y) - HALF_BED_M) for x, y in zip(xs, _middle(xs), strict=True)]
    north = [(float(x), float(y) + HALF_BED_M) for x, y in zip(xs, _middle(xs), strict=True)]
    return (*south, *north[::-1])
