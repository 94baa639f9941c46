"""Corridor and wall: level ground to land on, and nothing that changes along the walls."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl import scenes
from sitl.truth import truth
from sitl.world.primitives import Kind

F64 = NDArray[np.float64]


@pytest.mark.parametrize(("name", "heights"), [("corridor", (8.0, 8.0)), ("wall", (6.0, 0.0))])
def test_walls_have_the_same_height_all_along(name: str, heights: tuple[float, float]) -> None:
    world = scenes.build(name, 1).world
    side = 10.2 if name == "corridor" else 12.2
    x = np.linspace(-99.5, 99.5, 400)
    for north, height in zip((side, -side), heights, strict=True):
        z, kind = world.surface(x, np.full_like(x, north))
        np.testing.assert_allclose(z, height, atol=0.02)
        assert set(np.unique(kind)) == {Kind.CONCRETE if height else Kind.GRASS}


@pytest.mark.parametrize(("name", "half_m"), [("corridor", 10.0), ("wall", 12.0)])
def test_the_lawn_is_level_and_safe_but_for_a_footprint_at_the_walls(name: str, half_m: float) -> None:
    scene = scenes.build(name, 1)
    found = truth.safe_map(scene.world, (-30.0, -half_m + 1.5, 30.0, half_m - 1.5))
    assert found.safe.all()
    assert not truth.safe_map(scene.world, (-30.0, half_m - 0.5, 30.0, half_m + 0.5)).safe.any()
    x, y = np.meshgrid(np.arange(-90.0, 90.0, 0.7), np.arange(-half_m + 0.5, half_m - 0.5, 0.7))
    z, _ = scene.world.surface(x, y)
    assert np.abs(z).max() < 0.02


@pytest.mark.parametrize("name", ["corridor", "wall"])
def test_a_way_along_the_walls_changes_no_range_and_a_way_across_does(name: str) -> None:
    world = scenes.build(name, 1).world
    angle = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
    down = np.full_like(angle, -0.2)
    rays = np.column_stack([np.cos(angle), np.sin(angle), down])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)

    def ranges(east: float, north: float) -> F64:
        origin = np.tile([east, north, 5.0], (len(rays), 1))
        return np.asarray(world.cross(origin, rays, 60.0, np.empty((len(rays), 0))).range_m)

    here = ranges(0.0, 0.0)
    assert np.nanmedian(np.abs(ranges(15.0, 0.0) - here)) < 0.05
    meets_wall = np.nan_to_num(here, nan=99.0) * rays[:, 1] > 9.0
    assert meets_wall.sum() > 50
    across = np.abs(ranges(0.0, 2.0) - here)[meets_wall]
    assert np.nanmedian(across) > 1.0


def test_the_seed_changes_the_micro_relief_alone() -> None:
    first, other = (scenes.build("corridor", seed) for seed in (1, 2))
    assert first.world.solids == other.world.solids
    assert (first.world.ground.z_m != other.world.ground.z_m).any()
