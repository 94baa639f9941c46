"""Scene of overhead lines: clearances, thicknesses and regions against the truth."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sitl import scenes
from sitl.scenes.scene import Scene
from sitl.truth.truth import safe_map
from sitl.world.primitives import Wire
from sitl.world.world import World

SEEDS = (0, 1, 2)


@cache
def built(seed: int) -> Scene:
    return scenes.build("power_line", seed)


def thin(seed: int, prefix: str) -> list[Wire]:
    world = built(seed).world
    return [s for s in world.solids if isinstance(s, Wire) and s.name.startswith(prefix)]


def height(world: World, wire: Wire) -> float:
    """Return the height of the world below the start of a wire."""
    z, _ = world.surface(*(np.array([v]) for v in wire.start_enu_m[:2]))
    return float(z[0])


@pytest.mark.parametrize("seed", SEEDS)
def test_the_meadow_is_safe_and_no_wire_crosses_it(seed: int) -> None:
    scene = built(seed)
    (x0, y0), _, (x1, y1), _ = scene.regions["meadow"]
    assert safe_map(scene.world, (x0, y0, x1, y1), 0.5).safe.all()


@pytest.mark.parametrize("seed", SEEDS)
def test_below_the_wires_it_is_unsafe(seed: int) -> None:
    scene = built(seed)
    for name in ("transmission_line", "distribution_line", "fence", "mast"):
        corners = np.array(scene.regions[name])
        (x0, y0), (x1, y1) = corners.min(axis=0) - 1.0, corners.max(axis=0) + 1.0
        found = safe_map(scene.world, (x0, y0, x1, y1), 1.0)
        assert (found.safe == 0).mean() > 0.0
        wires = thin(seed, {"transmission_line": "line", "distribution_line": "low"}.get(name, name))
        for wire in [w for w in wires if w.radius_m < 0.015][:: max(1, len(wires) // 50)]:
            x, y = ((a + b) / 2 for a, b in zip(wire.start_enu_m[:2], wire.end_enu_m[:2], strict=True))
            assert found.safe[int((y - y0) / 1.0), int((x - x0) / 1.0)] == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_lines_hang_as_high_and_are_as_thick_as_real_ones(seed: int) -> None:
    world = built(seed).world
    bare = World(world.ground)
    over = {
        prefix: min(w.start_enu_m[2] - height(bare, w) for w in thin(seed, prefix))
        for prefix in ("line", "low")
    }
    assert over["line"] > 12.0
    assert over["low"] > 5.0
    assert {w.radius_m for w in thin(seed, "line")} == {0.010, 0.005}
    assert {w.radius_m for w in thin(seed, "low")} == {0.005, 0.0025}
    assert max(w.end_enu_m[2] for w in thin(seed, "line")) < 80.0


def test_another_seed_hangs_the_lines_elsewhere() -> None:
    assert thin(1, "line") != thin(2, "line")
    assert thin(1, "line") == thin(1, "line")
