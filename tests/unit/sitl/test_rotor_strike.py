"""A rotor disc meets what is beside it, below it and above it, and what it passed on its way."""

import math

import numpy as np
import pytest

from sitl.vehicle.rigid_body import State, from_euler
from sitl.vehicle.rotor_strike import Rotor, struck
from sitl.world.primitives import Box, Ground, Kind, Wire
from sitl.world.world import World

ROTOR = Rotor(0.45, 0.3)


def at(x: float, y: float, z: float, roll: float = 0.0) -> State:
    zero = np.zeros(3)
    return State(np.array([x, y, z]), zero, from_euler(roll, 0.0, 0.3), zero, zero)


def world(*solids: Box | Wire) -> World:
    z = np.zeros((41, 41))
    return World(Ground(-20.0, -20.0, 1.0, z, np.full((40, 40), Kind.GRASS, np.uint8)), solids)


WALL = Box(1.0, 0.0, 0.0, 0.2, 4.0, 2.0, name="wall")  # its face is at x = 0.9


@pytest.mark.parametrize(("x", "hit"), [(0.43, False), (0.46, True), (1.57, False), (1.54, True)])
def test_a_disc_beside_a_wall(x: float, hit: bool) -> None:
    there = at(x, 0.1, 1.0)
    assert struck(world(WALL), ROTOR, there, there) is hit


def test_a_disc_over_a_wall_and_one_that_tilts_into_it() -> None:
    over = at(1.0, 0.0, 1.75)
    assert not struck(world(WALL), ROTOR, over, over)
    beside = at(0.4, 0.0, 1.9)  # its disc is over the top of the wall
    assert not struck(world(WALL), ROTOR, beside, beside)
    low = at(1.0, 0.0, 1.75, roll=0.6)
    assert struck(world(WALL), ROTOR, low, low)


def test_a_vehicle_that_stands_on_the_ground_strikes_nothing_and_one_that_lies_does() -> None:
    stands = at(5.0, 5.0, 0.0)
    assert not struck(world(), ROTOR, stands, stands)
    lies = at(5.0, 5.0, 0.0, roll=1.2)
    assert struck(world(), ROTOR, lies, lies)


def test_what_hangs_above_is_met_on_the_way_up_alone() -> None:
    jib = Box(0.0, 0.0, 10.0, 20.0, 1.0, 1.0, name="jib")
    below, above = at(0.0, 0.0, 9.5), at(0.0, 0.0, 11.2)
    assert not struck(world(jib), ROTOR, below, below)
    assert not struck(world(jib), ROTOR, above, above)
    assert struck(world(jib), ROTOR, below, above)


def test_a_bar_passed_between_two_looks_is_met() -> None:
    bar = Wire((-5.0, 0.02, 5.0), (5.0, 0.02, 5.0), 0.05)
    assert struck(world(bar), ROTOR, at(0.0, 0.0, 4.6), at(0.0, 0.0, 4.8))
    assert not struck(world(bar), ROTOR, at(0.0, 2.0, 4.6), at(0.0, 2.0, 4.8))


@pytest.mark.parametrize(("rotor", "post_m"), [(ROTOR, 0.05), (Rotor(5.0, 2.6), 0.4)])
def test_a_post_anywhere_under_the_disc_is_met_from_above_and_from_the_side(
    rotor: Rotor, post_m: float
) -> None:
    rng, top_m = np.random.default_rng(1), 4.0
    for _ in range(40):
        away, turn = rotor.radius_m * math.sqrt(rng.uniform(0, 0.95)), rng.uniform(0, 2 * np.pi)
        x, y = away * math.cos(turn), away * math.sin(turn)
        there = world(Box(x, y, 0.0, post_m, post_m, top_m, yaw_rad=turn, name="post"))
        down = at(0.0, 0.0, top_m - rotor.height_m + 0.02), at(0.0, 0.0, top_m - rotor.height_m - 0.02)
        assert struck(there, rotor, *down) or struck(
            there, rotor, down[1], at(0.0, 0.0, top_m - 0.5 - rotor.height_m)
        )
        assert struck(there, rotor, at(-0.05, 0.0, 1.0), at(0.05, 0.0, 1.0)) or rotor.height_m + 1.0 > top_m


def test_the_ground_is_what_is_below_not_what_hangs_above() -> None:
    jib = Box(0.0, 0.0, 10.0, 20.0, 1.0, 1.0, name="jib")
    hung = world(jib, Box(0.0, 0.0, 0.0, 2.0, 2.0, 0.4, name="block"))
    assert hung.height_m(0.0, 0.0) == 11.0
    assert hung.height_below_m(0.0, 0.0, 12.0) == 11.0
    assert hung.height_below_m(0.0, 0.0, 5.0) == pytest.approx(0.4)
    assert hung.height_below_m(3.0, 0.0, 5.0) == pytest.approx(0.0)
    assert hung.height_below_m(3.0, 3.0, 5.0) == 0.0
    assert np.isnan(hung.height_below_m(99.0, 0.0, 5.0))
