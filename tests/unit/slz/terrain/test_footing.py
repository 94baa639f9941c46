"""Footing of the gear at a selected point: headings common to all cells within the touchdown error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, Pipeline, PointState, SelectedPoint, Window
from slz.frame import LocalFrame
from slz.terrain.footing import ALL_HEADINGS
from tests.unit.slz.hand_made import flat, fly, maps, returns
from tests.unit.slz.test_departures import pipeline

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
HALF_M = 6.0
KERB_M = 0.12  # tilts the gear to 17 degrees where a diagonal stands across it


def selected(
    surface: Floats, xy: Floats, at: tuple[float, float], *own: str, turned_deg: float = 0.0
) -> SelectedPoint:
    """The point of a map of this ground, turned clockwise about the origin."""
    turn = math.radians(turned_deg)
    clockwise = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    points = np.column_stack([xy @ clockwise, surface])
    pipe = Pipeline(params.load("quadcopter", list(own)), (0.0, 0.0), follow=False)
    pipe.select(np.array([*(np.array(at) @ clockwise), 0.0]))
    stamps = np.linspace(0, 9e8, len(points)).astype(np.int64)
    window = Window(points, stamps, np.array([0.0, 0.0, 25.0]), FRAME, 0, int(stamps[-1]))
    found = pipe.process(window).selected
    assert found is not None
    return found


def scattered(per_m2: float) -> Floats:
    return np.random.default_rng(3).uniform(-HALF_M, HALF_M, (round(per_m2 * 4 * HALF_M**2), 2))


def kerb(xy: Floats) -> Floats:
    """Rises to the east at x = 0."""
    noise = np.random.default_rng(4).normal(0, 0.01, len(xy))
    return np.asarray(KERB_M * (xy[:, 0] > 0) + noise)


PRECISE = ("range_noise_m=0.01", "touchdown_error_m=0.1")


def test_even_ground_carries_the_gear_at_any_heading() -> None:
    xy = scattered(200)
    point = selected(0 * xy[:, 0], xy, (0, 0))
    assert point.state is PointState.SAFE
    assert point.footing.headings_deg == ALL_HEADINGS


def test_on_a_kerb_the_gear_stands_along_it_and_not_across_its_diagonal() -> None:
    xy = scattered(600)
    headings = selected(kerb(xy), xy, (0.0, 0.0), *PRECISE).footing.headings_deg
    assert {0, 90, 180, 270} <= set(headings)
    assert not {45, 135, 225, 315} & set(headings)


@pytest.mark.parametrize("turned_deg", [90.0, 180.0])
def test_headings_turn_with_the_ground(turned_deg: float) -> None:
    """A rectangular gear tells a kerb to the north from one to the east."""
    own = (*PRECISE, "gear_length_m=0.9", "gear_width_m=0.45")
    xy = scattered(600)
    before = selected(kerb(xy), xy, (0.1, 0.1), *own).footing.headings_deg
    after = selected(kerb(xy), xy, (0.1, 0.1), *own, turned_deg=turned_deg).footing.headings_deg
    assert 0 < len(before) < len(ALL_HEADINGS)
    assert {int(heading + turned_deg) % 360 for heading in before} == set(after)


def test_a_point_without_a_heading_common_to_its_cells_is_unsafe() -> None:
    """Across a high kerb, no heading will do wherever the vehicle may touch down."""
    xy = scattered(600)
    point = selected(2 * kerb(xy), xy, (0.0, 0.0), "range_noise_m=0.01")
    assert point.state is PointState.UNSAFE
    assert point.footing.headings_deg == ()


def test_without_gear_any_heading_will_do() -> None:
    xy = scattered(600)
    assert selected(kerb(xy), xy, (0.0, 0.0), "gear=none").footing.headings_deg == ALL_HEADINGS


def test_source_mode_knows_no_gear() -> None:
    xy = scattered(200)
    footing = selected(kerb(xy), xy, (3.0, 0.0), "mode=source").footing
    assert footing.headings_deg == ALL_HEADINGS
    assert math.isnan(footing.unseen)


@pytest.mark.parametrize(("per_m2", "hazard_m"), [(10, 0.3), (20, 0.3), (50, 0.3), (50, 0.2)])
def test_a_hazard_goes_unseen_as_often_as_no_return_falls_on_it(per_m2: float, hazard_m: float) -> None:
    """Returns at random: none falls on an area with probability exp(-returns per area)."""
    xy = scattered(per_m2)
    own = (f"hazard_size_m={hazard_m}", "touchdown_error_m=0")
    footing = selected(0 * xy[:, 0], xy, (0.0, 0.0), *own).footing
    assert footing.unseen == pytest.approx(math.exp(-per_m2 * hazard_m**2), rel=0.5, abs=0.01)


def test_denser_returns_never_leave_more_unseen() -> None:
    sparse, dense = scattered(20), np.vstack([scattered(20), scattered(30) + 0.001])
    one = selected(0 * sparse[:, 0], sparse, (0.0, 0.0)).footing.unseen
    other = selected(0 * dense[:, 0], dense, (0.0, 0.0)).footing.unseen
    assert other <= one


# Objects in or beside unseen ground: they neither make it seen nor turn level ground into an obstacle.


@pytest.mark.parametrize(
    ("cell_m", "coverage_m", "footprint_m", "beside"), [(1.0, 3.0, 1.0, 2), (0.2, 1.0, 2.0, 4)]
)
def test_a_beam_in_the_middle_of_a_gap_makes_no_unknown_cell_safe(
    cell_m: float, coverage_m: float, footprint_m: float, beside: int
) -> None:
    states = []
    for beam in (False, True):
        height = flat(60, 60)
        height[:, 30 - beside : 30 + beside + 1] = np.nan
        if beam:
            height[:, 30] = 1.5
        own = [f"cell_m={cell_m}", f"coverage_m={coverage_m}", f"footprint_m={footprint_m}"]
        pipe = Pipeline(params.load("quadcopter", [*own, "zone_m=160", "angle_noise_deg=0"]), (0.0, 0.0))
        fly(pipe, returns(height, cell_m))
        states.append(maps(pipe).state)
    assert not ((states[0] != SAFE) & (states[1] == SAFE)).any()


def test_the_level_shore_of_a_pond_is_no_obstacle() -> None:
    height = flat(40, 40)
    height[17:23, 17:23] = np.nan
    (zone,) = fly(pipeline("default"), returns(height, 1.0)).zones
    assert zone.n_unsafe == 0
    assert len(zone.obstacles) == 0


def test_source_a_safe_court_in_a_ring_is_no_obstacle() -> None:
    height = flat(40, 40)
    height[12:28, 12:28] = 3.0
    height[14:26, 14:26] = 0.0
    (zone,) = fly(pipeline("source"), returns(height, 1.0)).zones
    assert not any(o.width_m > 5 for o in zone.obstacles)
    assert not any(np.isnan(o.height_m) for o in zone.obstacles)
