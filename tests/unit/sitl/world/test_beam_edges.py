"""Edges in beams against plain code: rays of the ring one by one, and a pair of them that finds the edge."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.world.beam_edges import edge_echoes
from sitl.world.plant_motion import Sway
from sitl.world.primitives import REFLECTANCE, Box, Ellipsoid, Ground, Kind, Wire
from sitl.world.wires import Beam
from sitl.world.world import Crossings, World

F64 = NDArray[np.float64]
BEAM = Beam((0.0127, 0.0095), (0.03, 0.015))
LIMIT_M = 60.0
TURNS = 0, 3, 1, 2, 4, 5


def yard() -> World:
    """Return a hilly world with a box, a thin wire, a moved car, and a crown that sways."""
    rng = np.random.default_rng(2)
    ground = Ground(
        -40.0, -40.0, 1.0, rng.normal(0.0, 0.2, (81, 81)), np.full((80, 80), Kind.GRASS, np.uint8)
    )
    solids = (
        Box(6.0, 0.0, 0.0, 3.0, 3.0, 2.5, 0.3),
        Wire((-20.0, 2.0, 4.0), (20.0, 2.0, 4.0), 0.005),
        Ellipsoid(-5.0, 3.0, 3.0, 2.0, 2.0, 1.5),
    )
    world = World(ground, solids, sways={2: Sway(0.4, 0.5, 0.6, 0.2)})
    world.wind_ms = 8.0
    world.add_car("car", 1.0, -5.0, 0.7)
    return world


def ring_ray(direction: F64, up: F64, range_m: float, turn: int) -> F64:
    """Return a ray of the ring: beside the middle along the level and the upward axis of the beam."""
    level = np.cross(direction, up)
    level /= max(float(np.linalg.norm(level)), 1e-9)
    at_m = max(range_m, 0.1) if math.isfinite(range_m) else LIMIT_M
    sigma = math.sqrt(2.0 / 0.75) / math.sqrt(8.0 * math.log(2.0))
    wide, high = (sigma * (e / at_m + d) for e, d in zip(BEAM.exit_m, BEAM.divergence_rad, strict=True))
    angle = math.pi / 3.0 * turn
    ray = direction + wide * math.cos(angle) * level + high * math.sin(angle) * np.cross(level, direction)
    out: F64 = ray / np.linalg.norm(ray)
    return out


@pytest.mark.parametrize("left_out", [False, True])
def test_beams_with_an_edge_have_the_echoes_of_their_rays(left_out: bool) -> None:
    world, rng, n = yard(), np.random.default_rng(5), 1500
    origins = rng.uniform((-3.0, -3.0, 6.0), (3.0, 3.0, 9.0), (n, 3))
    directions = rng.normal(0.0, 0.6, (n, 3)) - (0.0, 0.0, 1.0)
    directions /= np.linalg.norm(directions, axis=1)[:, np.newaxis]
    ups = np.tile([0.6, 0.0, 0.8], (n, 1))
    time_s = np.linspace(0.0, 0.3, n)  # many stretches between two places of the crown

    def cast(rows: NDArray[np.int64], rays: F64) -> Crossings:
        none = np.zeros((len(rows), 0))
        return world.cross(origins[rows], rays, LIMIT_M, none, thin_wires=False, time_s=time_s[rows])

    middle = cast(np.arange(n), directions)
    known = rng.random(n) < 0.3 if left_out else None
    index = np.arange(100, 100 + n)
    found = edge_echoes(world, middle, (origins, directions, ups), index, known, BEAM, LIMIT_M, time_s)
    columns = []
    for turn in TURNS:
        rays = [
            ring_ray(directions[k], ups[k], middle.range_m[k], int(index[k] % 3) + turn) for k in range(n)
        ]
        columns.append(cast(np.arange(n), np.array(rays)))
    range_m = np.column_stack([middle.range_m, *(c.range_m for c in columns)])
    lost = np.isnan(range_m[:, :3]).sum(axis=1)
    bent = np.abs(range_m[:, 1] + range_m[:, 2] - 2.0 * range_m[:, 0]) > 0.05
    divided = (bent | ((lost > 0) & (lost < 3))) & (True if known is None else ~known)
    assert 100 < divided.sum() < n / 2
    assert found.at.tolist() == np.flatnonzero(divided).tolist()
    hit = np.column_stack([middle.hit, *(c.hit for c in columns)])[divided]
    assert {0, 2, -1, 1_000_000} <= set(hit.ravel().tolist())
    assert found.hit.tolist() == hit.tolist()
    np.testing.assert_allclose(found.range_m, range_m[divided], rtol=1e-9)
    bright = np.column_stack([REFLECTANCE[c.kind] * c.cosine for c in (middle, *columns)])
    shares = [0.25, *[0.125] * 6]
    np.testing.assert_allclose(found.bright, bright[divided] * shares, rtol=1e-6, atol=1e-12)
