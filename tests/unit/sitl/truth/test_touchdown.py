"""Judgement of touchdowns: by the ground, by the tilt of the gear, by the belly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sitl.truth.standing_gear import gear_of
from sitl.truth.touchdown import fault_of, footing
from sitl.world.primitives import Box, Ground, Kind, Solid
from sitl.world.world import World


def world(*solids: Solid, kind: Kind = Kind.GRASS) -> World:
    return World(Ground(-10.0, -10.0, 1.0, np.zeros((21, 21)), np.full((20, 20), kind, np.uint8)), solids)


def touched(east_m: float = 0.0, heading_deg: float = 0.0) -> dict[str, Any]:
    return {"e": east_m, "n": 0.0, "heading_deg": heading_deg}


def kerb(height_m: float, width_m: float = 0.12) -> Solid:
    return Box(0.285, 0.0, -0.5, width_m, 4.0, 0.5 + height_m, name="kerb")


def test_level_ground_has_no_fault() -> None:
    assert footing(world(), touched()) == (0.0, False, "")
    assert fault_of(world(), touched()) == ""


def test_a_kerb_that_slope_and_relief_allow_is_told_by_the_tilt() -> None:
    assert fault_of(world(kerb(0.2)), touched()) == "stands at 19.3 degrees on its gear"
    assert fault_of(world(kerb(0.2)), touched(heading_deg=45.0)) == ""
    assert fault_of(world(kerb(0.2)), touched(east_m=3.0)) == ""


@pytest.mark.parametrize(("height_m", "fault"), [(0.15, ""), (0.16, "stands at 15.7 degrees on its gear")])
def test_the_limit_is_15_degrees(height_m: float, fault: str) -> None:
    assert footing(world(kerb(height_m)), touched()).fault == fault
    assert footing(world(kerb(height_m)), touched(), tip_limit_deg=10.0).fault != ""


def test_ground_and_gear_are_both_told() -> None:
    assert fault_of(world(kerb(0.32)), touched()) == (
        "touched unsafe ground; stands at 29.3 degrees on its gear"
    )
    assert fault_of(world(kind=Kind.WATER), touched()) == "touched unsafe ground"


def test_a_stone_under_the_belly_is_told() -> None:
    low = gear_of(clearance_m=0.1)
    under = Box(0.0, 0.0, 0.0, 0.2, 0.2, 0.15, name="stone")
    assert fault_of(world(under), touched(), low) == "stands on its belly"
    assert fault_of(world(under), touched()) == ""


def test_beyond_the_world_there_is_no_ground() -> None:
    assert footing(world(), touched(east_m=9.9)) == (None, False, "its gear finds no ground")


def test_a_car_counts_where_it_stands_now() -> None:
    place = world()
    place.add_mover("step", (Box(0.0, 0.0, 0.0, 0.2, 2.0, 0.2, name="slab"),), 0.285, 0.0, 0.0)
    assert fault_of(place, touched()) == "stands at 19.3 degrees on its gear"
    place.move("step", 5.0, 0.0, 0.0)
    assert fault_of(place, touched()) == ""
