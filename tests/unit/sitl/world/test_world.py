"""World model: heights, moving objects, and refusals."""

from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest

from sitl.world.geodetic import geodetic_of
from sitl.world.primitives import Box, Cylinder, Ground, Kind, Wire
from sitl.world.world import World


def flat(half: float = 20.0) -> Ground:
    count = int(half) + 1
    return Ground(-half, -half, 2.0, np.zeros((count, count)), np.ones((count - 1, count - 1), np.uint8))


def test_height_is_that_of_the_highest_thing() -> None:
    world = World(flat(), [Box(0, 0, 0, 4, 4, 2), Box(0, 0, 2, 1, 1, 3, kind=Kind.METAL)])
    z, kind = world.surface(np.array([0.0, 1.5, 3.0]), np.array([0.0, 0.0, 0.0]))
    np.testing.assert_allclose(z, [5.0, 2.0, 0.0])
    np.testing.assert_array_equal(kind, [Kind.METAL, Kind.CONCRETE, Kind.GRASS])


def test_outside_the_world_there_is_no_height() -> None:
    z, kind = World(flat()).surface(np.array([20.0, 20.01]), np.array([0.0, 0.0]))
    assert z[0] == 0.0
    assert math.isnan(z[1])
    assert kind[1] == Kind.NOTHING


def test_a_car_is_seen_where_it_is_and_no_longer_where_it_was() -> None:
    world = World(flat())
    world.add_car("van", -5.0, 0.0, 0.0)
    assert world.height_m(-5.0, 0.0) == pytest.approx(1.45)
    world.move("van", 5.0, 5.0, math.pi / 2)
    assert world.height_m(-5.0, 0.0) == 0.0
    assert world.height_m(5.0, 7.2) == pytest.approx(0.85)  # its length lies along north now
    down = np.array([[0.0, 0.0, -1.0]])
    range_m, kind = world.cast(np.array([[5.0, 5.0, 11.45]]), down, 50.0)
    assert (range_m[0], kind[0]) == (pytest.approx(10.0), Kind.CAR)
    world.remove("van")
    assert world.height_m(5.0, 5.0) == 0.0


def test_a_car_stands_on_the_surface_below_it_not_on_another_car() -> None:
    world = World(flat(), [Box(0, 0, 0, 10, 10, 0.15)])
    world.add_car("a", 0.0, 0.0, 0.0)
    world.add_car("b", 0.0, 0.0, 0.0)
    assert world.movers["b"].z_m == pytest.approx(0.15)


def test_parts_of_a_mover_turn_about_its_own_origin() -> None:
    world = World(flat())
    parts = (Box(3.0, 1.0, 0.5, 2.0, 0.4, 1.0, name="arm"),)
    world.add_mover("crane", parts, 1.0, 2.0, math.pi / 2)
    assert world.height_m(0.0, 5.0) == pytest.approx(1.5)  # (3, 1) turned left by 90 deg is (-1, 3)
    assert world.height_m(0.0, 5.9) == pytest.approx(1.5)
    assert world.height_m(2.0, 5.0) == 0.0


def test_movers_do_not_hide_what_is_nearer() -> None:
    world = World(flat(), [Cylinder(0, 0, 0, 0.1, 8)])
    world.add_car("car", 5.0, 0.0, 0.0)
    east = np.array([[1.0, 0.0, 0.0]])
    range_m, kind = world.cast(np.array([[-5.0, 0.0, 0.5]]), east, 50.0)
    assert (range_m[0], kind[0]) == (pytest.approx(4.9), Kind.METAL)


def test_what_it_refuses_is_said_plainly() -> None:
    with pytest.raises(ValueError, match="'tower' reaches beyond the ground"):
        World(flat(), [Box(19.5, 0, 0, 2, 2, 2, name="tower")])
    with pytest.raises(ValueError, match=r"cell_m 1\.0 is smaller than post_m 2\.0"):
        World(flat(), cell_m=1.0)
    with pytest.raises(ValueError, match="vertical; use a Cylinder"):
        Wire((0, 0, 0), (0, 0, 5))
    with pytest.raises(ValueError, match="kind of shape"):
        Ground(0, 0, 1, np.zeros((3, 3)), np.zeros((3, 3), np.uint8))
    world = World(flat())
    world.add_car("car", 0, 0, 0)
    with pytest.raises(ValueError, match="'car' exists"):
        world.add_car("car", 0, 0, 0)
    with pytest.raises(ValueError, match="outside the extent"):
        world.move("car", 99, 0, 0)
    with pytest.raises(ValueError, match=r"two \(n, 3\) arrays"):
        world.cast(np.zeros((2, 3)), np.zeros((3, 3)), 10.0)
    with pytest.raises(KeyError):
        world.move("bus", 0, 0, 0)


# Geodetic coordinates of one point against pymap3d.


@pytest.mark.parametrize(
    "origin", [(47.4, 8.5, 488.0), (-35.4, 149.2, 584.0), (0.0, 179.0, 0.0), (78.2, -15.6, 9000.0)]
)
@pytest.mark.parametrize("reach_m", [0.0, 100.0, 20_000.0])
def test_it_is_that_of_pymap3d_to_a_micrometre(origin: tuple[float, float, float], reach_m: float) -> None:
    for enu in np.random.default_rng(1).uniform(-reach_m, reach_m, (20, 3)):
        found, expected = geodetic_of(tuple(enu), origin), pymap3d.enu2geodetic(*enu, *origin)
        np.testing.assert_allclose(found[:2], expected[:2], rtol=0, atol=1e-11)
        assert found[2] == pytest.approx(float(expected[2]), abs=1e-6)
        back = pymap3d.geodetic2enu(*found, *origin)
        np.testing.assert_allclose(back, enu, atol=1e-6)
