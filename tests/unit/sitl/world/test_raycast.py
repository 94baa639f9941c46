"""Ray casting against surfaces of known distance, and the grid against brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import brentq

from sitl.world.primitives import Box, Cylinder, Ellipsoid, Ground, Kind, Solid, Wire
from sitl.world.world import World

F64 = NDArray[np.float64]


def flat_ground(half: float = 50.0, post: float = 2.0, z: float = 0.0, kind: Kind = Kind.GRASS) -> Ground:
    count = round(2 * half / post) + 1
    return Ground(-half, -half, post, np.full((count, count), z), np.full((count - 1,) * 2, kind, np.uint8))


def cast_one(
    world: World, origin: tuple[float, float, float], towards: tuple[float, float, float]
) -> tuple[float, int, float]:
    direction = np.array([towards], dtype=np.float64)
    direction /= np.linalg.norm(direction)
    range_m, kind, cosine = world.trace(np.array([origin]), direction, 500.0)
    return float(range_m[0]), int(kind[0]), float(cosine[0])


def test_plane_is_hit_at_height_over_cosine() -> None:
    world = World(flat_ground())
    for tilt_deg in (0.0, 20.0, 55.0):
        tilt = math.radians(tilt_deg)
        hit = cast_one(world, (1.0, 2.0, 10.0), (math.sin(tilt), 0.0, -math.cos(tilt)))
        assert hit == pytest.approx((10.0 / math.cos(tilt), Kind.GRASS, math.cos(tilt)), abs=1e-9)


def test_tilted_plane_is_hit_exactly_wherever_the_ray_starts() -> None:
    x, y = np.meshgrid(np.arange(-50.0, 51.0, 2.0), np.arange(-50.0, 51.0, 2.0))
    ground = Ground(-50.0, -50.0, 2.0, 0.2 * x - 0.1 * y, np.full((50, 50), Kind.SOIL, np.uint8))
    rng = np.random.default_rng(3)
    origins = np.column_stack([rng.uniform(-20, 20, (500, 2)), rng.uniform(15, 30, 500)])
    directions = rng.normal(size=(500, 3)) * [0.3, 0.3, 0.1] - [0, 0, 1]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    range_m, _ = World(ground).cast(origins, directions, 200.0)
    normal = np.array([-0.2, 0.1, 1.0])
    np.testing.assert_allclose(range_m, -(origins @ normal) / (directions @ normal), rtol=1e-10)


def test_box_is_hit_on_its_turned_face() -> None:
    yaw = math.radians(30.0)
    world = World(flat_ground(), [Box(10.0, 0.0, 0.0, 4.0, 2.0, 3.0, yaw, Kind.ROOF)])
    towards = (math.cos(yaw), math.sin(yaw), 0.0)
    origin = (10.0 - 8.0 * towards[0], -8.0 * towards[1], 1.0)
    assert cast_one(world, origin, towards) == pytest.approx((6.0, Kind.ROOF, 1.0), abs=1e-9)
    assert cast_one(world, (10.0, 0.0, 9.0), (0.0, 0.0, -1.0)) == pytest.approx((6.0, Kind.ROOF, 1.0))


def test_cylinder_is_hit_on_its_side_and_on_its_top() -> None:
    world = World(flat_ground(), [Cylinder(5.0, 5.0, 0.0, 0.5, 6.0)])
    offset = 0.3
    side = 5.0 - math.sqrt(0.5**2 - offset**2)
    assert cast_one(world, (0.0, 5.0 + offset, 2.0), (1.0, 0.0, 0.0))[0] == pytest.approx(side, abs=1e-12)
    assert cast_one(world, (5.2, 5.0, 10.0), (0.0, 0.0, -1.0))[0] == pytest.approx(4.0, abs=1e-12)
    assert math.isnan(cast_one(world, (0.0, 5.51, 2.0), (1.0, 0.0, 0.0))[0])


def test_ellipsoid_is_hit_where_its_equation_says() -> None:
    world = World(flat_ground(), [Ellipsoid(0.0, 0.0, 10.0, 2.0, 3.0, 4.0)])
    drop = 4.0 * math.sqrt(1.0 - (1.0 / 2.0) ** 2)
    assert cast_one(world, (1.0, 0.0, 30.0), (0.0, 0.0, -1.0))[0] == pytest.approx(20.0 - drop, abs=1e-12)
    assert cast_one(world, (0.0, 0.0, 10.0), (0.0, 1.0, 0.0))[0] == pytest.approx(3.0)  # from inside


def test_wire_is_hit_within_its_length_only() -> None:
    world = World(flat_ground(), [Wire((0.0, 0.0, 5.0), (10.0, 0.0, 5.0), 0.02)])
    assert cast_one(world, (4.0, 0.0, 8.0), (0.0, 0.0, -1.0))[0] == pytest.approx(2.98, abs=1e-12)
    assert cast_one(world, (11.0, 0.0, 8.0), (0.0, 0.0, -1.0))[0] == pytest.approx(8.0)
    assert cast_one(world, (4.0, 0.021, 8.0), (0.0, 0.0, -1.0))[0] == pytest.approx(8.0)


def test_a_thick_rising_wire_looks_the_same_from_above_by_ray_and_by_formula() -> None:
    world = World(flat_ground(), [Wire((0.0, 0.0, 3.0), (6.0, 4.0, 12.0), 0.8)])
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-2.0, 8.0, 0.11), np.arange(-2.0, 6.0, 0.11)))
    z, _ = world.surface(x, y)
    origins = np.column_stack([x, y, np.full(x.size, 50.0)])
    range_m, _ = world.cast(origins, np.tile([0.0, 0.0, -1.0], (x.size, 1)), 100.0)
    # Near the open ends a ray enters the tube through its mouth and meets the inside.
    outside = z > 0.0
    assert outside.sum() > 300
    np.testing.assert_allclose(50.0 - range_m[outside], z[outside], atol=1e-9)


def test_a_ray_that_crosses_one_saddle_square_twice_stops_at_the_first_crossing() -> None:
    saddle = Ground(0.0, 0.0, 10.0, np.array([[0.0, 4.0], [4.0, 0.0]]), np.ones((1, 1), np.uint8))
    # Along the diagonal x = y the height is 8 u (1 - u): a ridge 2 m high. Fly through it at 1.5 m.
    range_m, _, _ = cast_one(World(saddle, cell_m=10.0), (0.1, 0.1, 1.5), (1.0, 1.0, 0.0))
    u = (1.0 - math.sqrt(1.0 - 1.5 / 2.0)) / 2.0
    assert range_m == pytest.approx((10.0 * u - 0.1) * math.sqrt(2.0), abs=1e-9)


def test_water_returns_nothing_but_hides_what_is_below() -> None:
    range_m, kind, _ = cast_one(World(flat_ground(kind=Kind.WATER)), (0.0, 0.0, 10.0), (0.1, 0.0, -1.0))
    assert math.isnan(range_m)
    assert kind == Kind.WATER


def test_nothing_is_seen_beyond_the_maximum_range_or_with_a_nan_direction() -> None:
    world = World(flat_ground())
    origins = np.array([[0.0, 0.0, 10.0]] * 3)
    directions = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [np.nan, 0.0, -1.0]])
    assert np.isnan(world.cast(origins, directions, 9.99)[0]).all()
    np.testing.assert_array_equal(np.isnan(world.cast(origins, directions, 10.01)[0]), [False, True, True])


def _clutter(rng: np.random.Generator) -> list[Solid]:
    solids: list[Solid] = []
    for _ in range(12):
        x, y, yaw = (float(v) for v in (*rng.uniform(-30, 30, 2), rng.uniform(0, 6)))
        size = [float(v) for v in rng.uniform(0.3, 9.0, 3)]
        solids.append(Box(x, y, 0.0, size[0], size[1], size[2], yaw, Kind.ROOF))
        x, y = (float(v) for v in rng.uniform(-30, 30, 2))
        solids.append(Cylinder(x, y, 0.0, float(rng.uniform(0.02, 2.0)), size[0], Kind.METAL))
        x, y = (float(v) for v in rng.uniform(-30, 30, 2))
        solids.append(Ellipsoid(x, y, size[1], size[0] / 2, size[1] / 2, size[2] / 2, Kind.FOLIAGE))
        a = [float(v) for v in rng.uniform(-30, 30, 2)]
        b = [float(v) for v in rng.uniform(-30, 30, 2)]
        solids.append(Wire((a[0], a[1], size[0]), (b[0], b[1], size[1]), 0.05, Kind.WOOD))
    return solids


def _rough_ground(rng: np.random.Generator) -> Ground:
    z = np.cumsum(np.cumsum(rng.normal(0.0, 0.05, (81, 81)), axis=0), axis=1)
    z = 5.0 * z / np.abs(z).max()
    return Ground(-40.0, -40.0, 1.0, z, np.full((80, 80), Kind.GRASS, np.uint8))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_grid_gives_what_brute_force_gives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ground, solids = _rough_ground(rng), _clutter(rng)
    origins = rng.uniform([-45, -45, -5], [45, 45, 40], (400, 3))
    directions = rng.normal(size=(400, 3))
    directions[:20] *= [1.0, 0.0, 0.0]
    directions[20:40] *= [0.0, 1.0, 0.0]
    directions[40:60] *= [0.0, 0.0, 1.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    above = origins[:, 2] > World(ground).surface(origins[:, 0], origins[:, 1])[0]
    above |= np.isnan(World(ground).surface(origins[:, 0], origins[:, 1])[0]) & (origins[:, 2] > 20)
    gridded = World(ground, solids, cell_m=4.0).cast(origins[above], directions[above], 90.0)
    one_cell = World(ground, solids, cell_m=1000.0).cast(origins[above], directions[above], 90.0)
    np.testing.assert_allclose(gridded[0], one_cell[0], atol=1e-7)
    np.testing.assert_array_equal(gridded[1], one_cell[1])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_ray_from_straight_above_finds_the_top_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = World(_rough_ground(rng), _clutter(rng))
    x, y = rng.uniform(-39.9, 39.9, (2, 500))
    z, kind = world.surface(x, y)
    down = np.tile([0.0, 0.0, -1.0], (500, 1))
    range_m, seen = world.cast(np.column_stack([x, y, np.full(500, 200.0)]), down, 500.0)
    np.testing.assert_allclose(200.0 - range_m, z, atol=1e-7)
    np.testing.assert_array_equal(seen, kind)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_bilinear_ground_is_hit_at_the_first_root(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ground = _rough_ground(rng)
    world = World(ground)
    origin = np.array([*rng.uniform(-15, 15, 2), 60.0])
    direction = np.array([*rng.uniform(-0.2, 0.2, 2), -1.0])
    direction /= np.linalg.norm(direction)

    def above(t: float) -> float:
        x, y, z = origin + t * direction
        u, v = x + 40.0, y + 40.0
        i, j = int(u), int(v)
        u, v = u - i, v - j
        rows = ground.z_m[j : j + 2, i] * (1 - u) + ground.z_m[j : j + 2, i + 1] * u
        return float(z - rows[0] * (1 - v) - rows[1] * v)

    t = np.arange(20.0, 75.0, 0.02)
    heights = np.array([above(float(v)) for v in t])
    first = int(np.argmax(heights < 0.0))
    expected = brentq(above, t[first - 1], t[first])
    range_m, _ = world.cast(origin[np.newaxis], direction[np.newaxis], 200.0)
    assert range_m[0] <= expected + 1e-9  # the samples may step over a grazed bump
    assert above(float(range_m[0])) == pytest.approx(0.0, abs=1e-9)
