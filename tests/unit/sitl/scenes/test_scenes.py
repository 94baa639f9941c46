"""Scenes: reproducible, with a safe home, and the required dimensions of the stadium."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from sitl import scenes
from sitl.scenes.scene import Scene
from sitl.truth import truth
from sitl.truth.touchdown import fault_of, footing
from sitl.world.primitives import Box, Kind

ON_REQUEST = pytest.mark.bench  # for their time


@cache
def scene(name: str, seed: int = 1) -> Scene:
    return scenes.build(name, seed)


def region_box(name: str, region: str) -> tuple[float, float, float, float]:
    corners = np.array(scene(name).regions[region])
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


@pytest.mark.parametrize("name", scenes.NAMES)
def test_home_is_on_truly_safe_ground_with_room_around_it(name: str) -> None:
    for seed in (1, 2):
        x, y, _ = scene(name, seed).home_enu
        found = truth.safe_map(scene(name, seed).world, (x - 4.0, y - 4.0, x + 4.0, y + 4.0))
        assert found.safe.all()


@pytest.mark.parametrize("name", scenes.NAMES)
def test_regions_lie_in_the_world_and_names_are_unique(name: str) -> None:
    built = scene(name)
    x0, y0, x1, y1 = built.extent_m
    for polygon in built.regions.values():
        assert all(x0 <= x <= x1 and y0 <= y <= y1 for x, y in polygon)
    names = [solid.name for solid in built.world.solids]
    assert len(names) == len(set(names))


def test_same_seed_same_world_other_seed_other_world() -> None:
    first, same, other = (scenes.build("plain", seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.world.ground.z_m, same.world.ground.z_m)
    assert first.world.solids == same.world.solids
    assert first.world.solids != other.world.solids


def test_an_unknown_scene_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match="'beach' is unknown; choose one of stadium, plain"):
        scenes.build("beach")


def test_court_and_entrance_have_the_sizes_of_the_paper() -> None:
    x0, y0, x1, y1 = region_box("stadium", "court")
    assert (x1 - x0, y1 - y0) == (106.0, 73.0)
    x0, y0, x1, y1 = region_box("stadium", "entrance")
    assert (x1 - x0, y1 - y0) == (55.0, 62.0)


def test_only_court_and_entrance_hold_a_square_of_24_m_in_the_built_part() -> None:
    """SLZ paper, scene 1: the 24 m filter leaves two zones, 106 x 73 m and 55 x 62 m."""
    x0, y0, x1, y1 = -100.0, -66.0, 196.0, 92.0
    cell = 0.5
    safe = truth.safe_map(scene("stadium").world, (x0, y0, x1, y1), cell).safe
    room = ndimage.binary_erosion(safe, np.ones((48, 48)), border_value=0)
    labels, count = ndimage.label(ndimage.binary_dilation(room, np.ones((49, 49))))
    found = []
    for rows, columns in ndimage.find_objects(labels):
        south_west = (x0 + columns.start * cell, y0 + rows.start * cell)
        north_east = (x0 + columns.stop * cell, y0 + rows.stop * cell)
        found.append((*south_west, *north_east))
    assert count == 2
    for box, region in zip(sorted(found), ("court", "entrance"), strict=True):
        assert box == pytest.approx(region_box("stadium", region), abs=3.0)  # less half a footprint


def test_court_is_flat_within_centimetres_and_stands_rise_around_it() -> None:
    world = scene("stadium").world
    x, y = np.meshgrid(np.arange(-85.0, 5.0, 0.7), np.arange(5.0, 75.0, 0.7))
    z, kind = world.surface(x, y)
    grass = kind == Kind.GRASS
    assert grass.mean() > 0.99
    assert np.abs(z[grass]).max() < 0.03
    for outside, highest in (((-50.0, 90.5), 14.0), ((-50.0, -6.9), 10.0), ((-101.5, 40.0), 8.0)):
        assert world.height_m(*outside) == pytest.approx(highest)
    assert world.height_m(-50.0, 77.0) == pytest.approx(1.2)


def test_slope_and_pond_and_roofs_are_what_their_regions_say() -> None:
    world = scene("stadium").world
    ring = truth.safe_map(world, (95.0, -145.0, 100.0, -140.0), 0.5)
    assert np.median(ring.slope_deg) > 12.0
    assert not truth.safe_map(world, (-125.0, -130.0, -115.0, -120.0), 0.5).safe.any()
    assert truth.safe_map(world, (155.0, 40.0, 165.0, 50.0), 0.5).safe.all()
    assert world.height_m(150.0, -15.0) == pytest.approx(8.0)
    assert world.height_m(120.1, 40.0) == pytest.approx(12.5)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=ON_REQUEST) for seed in (2, 3))])
def test_the_garden_of_the_streets_tips_a_gear_where_slope_and_relief_are_safe(seed: int) -> None:
    built = scene("streets", seed)
    corners = np.array(built.regions["garden"])
    rng = np.random.default_rng(seed)
    tilts = []
    for east, north in rng.uniform(corners.min(axis=0) + 1, corners.max(axis=0) - 1, (150, 2)):
        here = {"e": float(east), "n": float(north), "heading_deg": float(rng.uniform(0, 360))}
        if not fault_of(built.world, here, tip_limit_deg=90.0):
            tilts.append(footing(built.world, here).tilt_deg or 0.0)
    assert len(tilts) > 100  # of 150 safe without a gear
    assert 0.05 < np.mean(np.array(tilts) > 15.0) < 0.4
    assert np.median(tilts) < 2.0
    x, y, heading = built.home_enu
    assert footing(built.world, {"e": x, "n": y, "heading_deg": np.degrees(heading)}).fault == ""


def test_kerbs_and_flagstones_are_as_high_as_kerbs() -> None:
    heights = [
        box.z_m + box.height_m
        for box in scene("streets").world.solids
        if isinstance(box, Box) and box.name.startswith(("kerb", "flagstone"))
    ]
    assert len(heights) > 60
    assert min(heights) == pytest.approx(0.1, abs=0.01)
    assert max(heights) == pytest.approx(0.24)


def test_nobody_can_land_on_the_hill_but_all_around_it() -> None:
    world = scene("hill").world
    assert truth.safe_map(world, (-45.0, -45.0, 45.0, 45.0), 0.5).safe.mean() < 0.005
    assert truth.safe_map(world, (-60.0, -180.0, 60.0, -90.0), 0.5).safe.mean() > 0.99


# Corridor and wall: level ground to land on, and nothing that changes along the walls.


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
