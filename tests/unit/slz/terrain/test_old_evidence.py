"""Old or frequent evidence: it does not hide new obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNSAFE, LocalFrame, Pipeline, Window
from slz.grid import Box
from slz.kernels.cells.cell_record import TILE
from slz.zones.zone_map import ZoneMap
from tests.unit.slz.hand_made import near_map

FRAME = LocalFrame(47.0, 8.0, 400.0)
S = 1_000_000_000


def ground(rng: np.random.Generator, step_m: float, east_m: float = 0.0) -> NDArray[np.float64]:
    """Level ground of 16 x 16 m about a place, a return in each square of so many metres."""
    axis = np.arange(-8.0, 8.0, step_m) + step_m / 2
    east, north = (part.ravel() for part in np.meshgrid(axis, axis))
    shaken = rng.uniform(-step_m / 3, step_m / 3, (len(east), 2))
    level = rng.normal(0, 0.005, len(east))
    return np.column_stack([east + shaken[:, 0] + east_m, north + shaken[:, 1], level])


def look(pipe: Pipeline, points: NDArray[np.float64], east_m: float, stamp_s: float) -> None:
    stamps = np.full(len(points), round(stamp_s * S), np.int64)
    pipe.process(Window(points, stamps, np.array([east_m, 0.0, 15.0]), FRAME, int(stamps[0]), int(stamps[0])))


@pytest.mark.parametrize("later_s", [100.0, 280.0, 990.0])
def test_a_wire_that_came_since_the_ground_was_seen_is_a_hazard_in_the_first_window(later_s: float) -> None:
    """It sends back one return a cell; the ground was seen densely before, and counts for 300 s."""
    rng = np.random.default_rng(3)
    pipe = Pipeline(params.load("quadcopter", ["adaptive=off", "register_m=0"]))
    for second in range(10):
        look(pipe, ground(rng, 0.06), 0.0, 0.7 * second)
    along = np.arange(-3.0, 3.0, 0.2) + 0.1
    wire = np.column_stack([along, np.full(len(along), 0.1), np.ones(len(along))])
    look(pipe, ground(rng, 0.2, 100.0), 100.0, later_s - 5.0)
    look(pipe, np.vstack([ground(rng, 0.2), wire]), 0.0, later_s)
    maps = pipe.maps(which="near")
    assert maps is not None
    row, col = maps.grid.index(0.1, 0.1)
    state = maps.state[row - maps.box.row0, col - 10 - maps.box.col0 : col + 11 - maps.box.col0]
    assert (state == UNSAFE).all()


def test_below_ground_seen_often_two_ghosts_are_no_hole_and_what_takes_its_share_of_the_rays_is() -> None:
    """Multipath of two rays fell in cells beside each other, 2 m below the vehicle, and ended a landing."""
    rng = np.random.default_rng(6)
    for below in (np.array([[-0.1, 0.1], [0.1, 0.1]]), rng.uniform((-0.1, 0.0), (0.0, 0.2), (16, 2))):
        pipe = Pipeline(params.load("quadcopter", ["adaptive=off", "register_m=0"]))
        dense = ground(rng, 0.03)
        look(pipe, np.vstack([dense, np.column_stack([below, np.full(len(below), -1.6)])]), 0.0, 0.0)
        maps = pipe.maps(which="near")
        assert maps is not None
        row, col = maps.grid.index(0.1, 0.1)
        found = maps.state[row - maps.box.row0, col - maps.box.col0]
        assert found == (SAFE if len(below) == 2 else UNSAFE)


def test_what_is_too_old_adds_nothing_to_what_comes() -> None:
    """Ground that was a metre higher, and is seen again when that no longer counts, is level at once."""
    rng = np.random.default_rng(4)
    pipe = Pipeline(params.load("quadcopter", ["adaptive=off", "register_m=0", "max_age_s=60"]))
    pile = ground(rng, 0.1)
    pile[np.hypot(*pile[:, :2].T) < 0.5, 2] += 1.0
    look(pipe, pile, 0.0, 0.0)
    look(pipe, ground(rng, 0.1), 0.0, 61.0)
    maps = pipe.maps(which="near")
    assert maps is not None
    row, col = maps.grid.index(0.0, 0.0)
    box = Box(row - 3, row + 4, col - 3, col + 4).relative_to(maps.box)
    assert (maps.state[box.slices] == SAFE).all()
    assert np.abs(maps.height_m[box.slices]).max() < 0.05


def test_ground_is_forgotten_patch_by_patch_and_drawn_anew_only_then() -> None:
    """Three patches of one row of tiles, seen at 0, 13 and 26 s; what is seen on keeps none of them."""
    rng = np.random.default_rng(5)
    pipe = Pipeline(params.load("quadcopter", ["adaptive=off", "register_m=0", "max_age_s=60"]), (0.0, 0.0))
    places = {0: -40.0, 13: -18.0, 26: 4.0}
    last_known_s = dict.fromkeys(places, 0)
    drawn_s = []
    for second in range(95):
        east_m = places.get(second, 40.0)
        look(pipe, ground(rng, 0.2, east_m), east_m, second)
        near = near_map(pipe)
        assert isinstance(near, ZoneMap)
        first = (15.0 - near.tiles.west_m) / (TILE * near.tiles.cell_m)
        if second > 26 and any(key[1] < first - 1 for key in near.terrain.changed_tiles):
            drawn_s.append(second)
        near.terrain.changed_tiles.clear()
        for stamp_s, east_m in places.items():
            row, col = near.terrain.grid.index(east_m, 0.0)
            if (pipe.state("near", Box(row - 3, row + 4, col - 3, col + 4)) == SAFE).any():
                last_known_s[stamp_s] = second
    for stamp_s, known_s in last_known_s.items():
        assert stamp_s + 54 <= known_s <= stamp_s + 60
    assert 1 <= len([second for second in drawn_s if second < 80]) <= 6  # two patches, by and by
    assert min(drawn_s) >= 54
