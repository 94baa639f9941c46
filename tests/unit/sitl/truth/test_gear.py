"""Rest poses of the gear, against hand-computed tilts on steps, stones and slopes."""

from __future__ import annotations

import argparse
import math

import numpy as np
import pytest

from sitl.truth.standing_gear import QUADCOPTER, Gear, gear_of, stances
from sitl.truth.touchdown import add_gear_options, chosen_gear
from sitl.world.primitives import Box, Cylinder, Ground, Solid
from sitl.world.world import World

SIDE_M = 0.57
PLACE = (1.3, -0.7)


def world(*solids: Solid, gradient: tuple[float, float] = (0.0, 0.0)) -> World:
    x, y = np.meshgrid(np.arange(-10.0, 11.0), np.arange(-10.0, 11.0))
    z = gradient[0] * x + gradient[1] * y
    return World(Ground(-10.0, -10.0, 1.0, z, np.full((20, 20), 1, np.uint8)), solids)


def tilts(where: World, heading_deg: float = 0.0, gear: Gear = QUADCOPTER) -> list[float]:
    return [pose.tilt_deg for pose in stances(where, gear, *PLACE, math.radians(heading_deg))]


def stone(forward_m: float, right_m: float, height_m: float, heading_deg: float = 0.0) -> Solid:
    """Return a stone under a place of the gear."""
    turn = math.radians(heading_deg)
    east = PLACE[0] + forward_m * math.sin(turn) + right_m * math.cos(turn)
    north = PLACE[1] + forward_m * math.cos(turn) - right_m * math.sin(turn)
    return Cylinder(east, north, 0.0, 0.08, height_m, name=f"stone{forward_m:+.1f}{right_m:+.1f}")


def kerb(east_m: float, width_m: float, height_m: float) -> Solid:
    """Return a kerb that runs north, so far east of the gear's centre."""
    return Box(PLACE[0] + east_m, PLACE[1], -0.5, width_m, 4.0, 0.5 + height_m, name="kerb")


@pytest.mark.parametrize("heading_deg", [0.0, 20.0, 45.0, 290.0])
@pytest.mark.parametrize("gradient", [(0.0, 0.0), (0.1, 0.0), (-0.15, 0.2)])
def test_on_a_plane_the_gear_stands_at_its_slope(gradient: tuple[float, float], heading_deg: float) -> None:
    gear = gear_of(pad_radius_m=1e-4)  # the uphill rim of a pad adds nothing then
    found = tilts(world(gradient=gradient), heading_deg, gear)
    assert found == pytest.approx([math.degrees(math.atan(math.hypot(*gradient)))] * len(found), abs=0.02)
    assert found


@pytest.mark.parametrize("height_m", [0.1, 0.15, 0.28])
@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 180.0])
def test_a_step_under_two_pads_tilts_by_its_height_over_their_distance(
    height_m: float, heading_deg: float
) -> None:
    found = tilts(world(kerb(1.0, 1.9, height_m)), heading_deg)
    assert found
    assert found == pytest.approx([math.degrees(math.atan(height_m / SIDE_M))] * len(found))


def test_on_one_stone_four_pads_rock_between_two_poses() -> None:
    found = tilts(world(stone(SIDE_M / 2, SIDE_M / 2, 0.2, 35.0)), 35.0)
    assert found == pytest.approx([math.degrees(math.atan(0.2 / SIDE_M))] * 2)


@pytest.mark.parametrize("seed", range(6))
def test_four_pads_rest_on_the_higher_diagonal_and_one_of_the_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heading, half = float(rng.uniform(0, 360)), SIDE_M / 2
    places = [(half, half), (-half, -half), (half, -half), (-half, half)]
    a, b, c, d = (float(h) for h in rng.uniform(0.05, 0.25, 4))
    found = tilts(world(*(stone(*p, h, heading) for p, h in zip(places, (a, b, c, d), strict=True))), heading)
    if a + b < c + d:
        a, b, c, d = c, d, a, b
    along = (a - b) / math.hypot(SIDE_M, SIDE_M)
    expected = [
        math.degrees(math.atan(math.hypot(along, ((a + b) / 2 - low) / math.hypot(half, half))))
        for low in (c, d)
    ]
    assert sorted(found) == pytest.approx(sorted(expected), abs=1e-6)


@pytest.mark.parametrize(("edge_m", "height_m"), [(0.02, 0.2), (0.04, 0.0)])
def test_a_pad_stands_on_the_highest_under_its_disc(edge_m: float, height_m: float) -> None:
    """The kerb begins so far outside the middle of the right pads; their radius is 0.03 m."""
    beside = kerb(SIDE_M / 2 + edge_m + 0.5, 1.0, 0.2)
    assert max(tilts(world(beside))) == pytest.approx(math.degrees(math.atan(height_m / SIDE_M)))


def test_at_another_heading_a_kerb_is_between_the_pads() -> None:
    along = world(kerb(SIDE_M / 2, 0.1, 0.25))
    assert max(tilts(along, 0.0)) == pytest.approx(math.degrees(math.atan(0.25 / SIDE_M)))
    assert max(tilts(along, 45.0)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("height_m", "touches"), [(0.29, False), (0.31, True)])
def test_what_reaches_up_to_the_belly_touches_it(height_m: float, touches: bool) -> None:
    found = stances(world(stone(0.05, 0.1, height_m)), QUADCOPTER, *PLACE, 0.0)
    assert {pose.belly_touches for pose in found} == {touches}
    assert {pose.tilt_deg for pose in found} == {0.0}


def test_the_belly_s_clearance_is_square_to_a_tilted_gear() -> None:
    """On a step the plane is half of it high under the middle; there a stone may rise by clearance / cos."""
    step_m = 0.2
    upright = math.cos(math.atan(step_m / SIDE_M))
    for over_m, touches in ((-0.003, False), (0.003, True)):
        height_m = step_m / 2 + 0.3 / upright + over_m
        needle = Cylinder(*PLACE, 0.0, 0.0005, height_m, name="needle")
        found = stances(world(kerb(1.0, 1.9, step_m), needle), QUADCOPTER, *PLACE, 0.0)
        assert {pose.belly_touches for pose in found} == {touches}


def test_a_tripod_stands_on_its_three_pads_only() -> None:
    gear = gear_of("tripod")
    assert tilts(world(stone(0.285, 0.0, 0.2)), 0.0, gear) == pytest.approx(
        [math.degrees(math.atan(0.2 / SIDE_M))]
    )
    assert tilts(world(stone(0.285, 0.285, 0.2)), 0.0, gear) == pytest.approx([0.0])


def test_skids_seesaw_on_a_kerb_across_their_middle() -> None:
    gear = gear_of("skids", 3.0, 2.2, 0.005, 0.4)
    found = tilts(world(kerb(0.0, 0.04, 0.2)), 90.0, gear)
    assert found
    assert found == pytest.approx([math.degrees(math.atan(0.2 / 1.5))] * len(found))


def test_beyond_the_world_nothing_rests_and_an_unknown_gear_is_refused() -> None:
    assert stances(world(), QUADCOPTER, 9.9, 0.0, 0.0) == []
    with pytest.raises(ValueError, match="'floats' is unknown; choose one of pads, skids, tripod"):
        gear_of("floats")


# Options of the gear: their defaults are the quadcopter's.


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_gear_options(parser)
    return parser.parse_args(words)


def test_without_options_it_is_the_quadcopter() -> None:
    assert chosen_gear(parsed()) == QUADCOPTER
    assert parsed().tip_limit == 15.0


def test_each_option_counts() -> None:
    words = "--gear skids --gear-length 3 --gear-width 2.2 --pad-radius 0.05 --clearance 0.4 --tip-limit 10"
    options = parsed(*words.split())
    assert chosen_gear(options) == gear_of("skids", 3.0, 2.2, 0.05, 0.4)
    assert options.tip_limit == 10.0


def test_there_is_no_vehicle_without_a_gear(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed("--gear", "none")
    assert "invalid choice: 'none'" in capsys.readouterr().err
