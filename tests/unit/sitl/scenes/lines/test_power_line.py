"""Scene of overhead lines: clearances, thicknesses and regions against the truth."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from sitl import scenes
from sitl.scenes.power_lines import constant_m, heights_m, span
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


# Spans of wire against the catenary.


@pytest.mark.parametrize(
    ("length_m", "rise_m", "sag_m"),
    [(30.0, 0.0, 0.5), (300.0, 12.0, 9.0), (180.0, -25.0, 6.0), (22.0, -4.0, 0.5)],
)
def test_a_span_departs_from_the_catenary_by_less_than_a_millimetre(
    length_m: float, rise_m: float, sag_m: float
) -> None:
    start, end = (3.0, -2.0, 20.0), (3.0 + 0.6 * length_m, -2.0 + 0.8 * length_m, 20.0 + rise_m)
    wires = span("span", start, end, sag_m, 0.01)
    assert wires[0].start_enu_m == pytest.approx(start, abs=1e-9)
    assert wires[-1].end_enu_m == pytest.approx(end, abs=1e-6)
    a = constant_m(length_m, rise_m, sag_m)
    # The catenary through both ends, from its definition alone: z'' = cosh(u) / a with u = asinh(z').
    nodes = np.array([w.start_enu_m for w in wires] + [wires[-1].end_enu_m])
    along = np.linspace(0.0, length_m, 20_001)
    z = np.interp(along, np.hypot(nodes[:, 0] - 3.0, nodes[:, 1] + 2.0), nodes[:, 2])
    middle = length_m / 2
    lowest = middle - a * math.asinh(rise_m / (2 * a * math.sinh(middle / a)))
    exact = 20.0 + a * (np.cosh((along - lowest) / a) - np.cosh(lowest / a))
    assert exact[-1] == pytest.approx(20.0 + rise_m, abs=1e-5)
    assert 20.0 + rise_m / 2 - exact[10_000] == pytest.approx(sag_m, abs=1e-5)
    assert np.abs(z - exact).max() < 1e-3
    assert all(b.start_enu_m == a.end_enu_m for a, b in pairwise(wires))


def test_a_tight_span_is_nearly_a_parabola_with_its_sag_at_the_middle() -> None:
    along = np.linspace(0.0, 100.0, 11)
    heights = heights_m(along, 100.0, 0.0, 1.0)
    np.testing.assert_allclose(heights, -4.0 * (along / 100.0) * (1.0 - along / 100.0), atol=2e-3)


def test_no_sag_is_one_straight_piece() -> None:
    (wire,) = span("stay", (0.0, 0.0, 0.0), (5.0, 0.0, 9.0), 0.0, 0.005)
    assert (wire.start_enu_m, wire.end_enu_m) == ((0.0, 0.0, 0.0), (5.0, 0.0, 9.0))
