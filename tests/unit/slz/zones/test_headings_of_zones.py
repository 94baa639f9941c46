"""Headings of zones' best points, and of a selected point, with rotor and tail."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import Pipeline, PointState, Report
from slz.terrain.footing import ALL_HEADINGS, Footing
from slz.terrain.terrain import EvidenceTerrain
from tests.unit.slz.hand_made import near_map, returns, window

Floats = NDArray[np.float64]
CELL_M = 0.2
ROTOR = ("rotor_diameter_m=3", "rotor_height_m=0.6", "min_boundary_points=4")
TAIL = ("tail_length_m=3", "tail_height_m=0.5", "min_boundary_points=4")


def flown(heights: Floats, *own: str, select: tuple[float, float] | None = None) -> tuple[Pipeline, Report]:
    pipe = Pipeline(params.load("quadcopter", list(own)), (0.0, 0.0), follow=False)
    if select is not None:
        pipe.select(np.array([*select, 0.0]))
    half_m = heights.shape[0] * CELL_M / 2
    points = np.repeat(returns(heights, CELL_M, -half_m, -half_m), 3, axis=0)
    return pipe, pipe.process(window(points))


def yard(side: int, wall_m: float) -> Floats:
    """Level ground of so many cells across, within a wall."""
    out = np.full((side + 20, side + 20), wall_m)
    out[10:-10, 10:-10] = 0.0
    return out


def test_a_zone_tells_the_headings_of_its_best_point() -> None:
    _, report = flown(yard(60, 1.5), *ROTOR)
    (zone,) = report.near.zones
    assert zone.best.headings_deg == ALL_HEADINGS
    assert zone.best.blocked_by == ""


def test_a_zone_too_narrow_for_the_rotor_says_so() -> None:
    """The yard holds the safe square, but not the disc of 3 m."""
    _, report = flown(yard(22, 1.5), *ROTOR, "min_square_m=1")
    best = report.near.zones[0].best
    assert best.headings_deg == ()
    assert best.blocked_by.startswith("rotor: 1.5 m high at")
    _, without = flown(yard(22, 1.5), "min_square_m=1", "min_boundary_points=4")
    assert without.near.zones[0].best.headings_deg == ALL_HEADINGS


def test_a_zone_without_a_heading_ranks_behind_one_with_headings() -> None:
    """A yard within a wall that the rotor meets, and a level place amid lower ground."""
    heights = np.full((180, 180), np.nan)
    heights[45:135, :90], heights[45:135, 90:] = 1.5, -1.5
    heights[65:83, 20:38] = 0.0
    heights[65:87, 110:132] = 0.0
    _, report = flown(heights, *ROTOR, "min_square_m=1", "touchdown_error_m=0.2")
    ranked = [zone for zone in report.near.zones if zone.area_m2 < 30]
    assert len(ranked) == 2
    assert ranked[0].best.headings_deg == ALL_HEADINGS
    assert ranked[1].best.headings_deg == ()
    assert "no heading: rotor" in ranked[1].why


def test_a_selected_point_beside_a_fence_is_unsafe_and_says_why() -> None:
    heights = np.zeros((80, 80))
    heights[:, 48] = 1.2  # a fence 1.6 m east of the middle
    _, report = flown(heights, *ROTOR, select=(0.0, 0.0))
    assert report.selected is not None
    assert report.selected.state is PointState.UNSAFE
    assert report.selected.footing.blocked_by.startswith("rotor: 1.2 m high at 1.")
    _, report = flown(heights, *TAIL, select=(0.0, 0.0))
    assert report.selected is not None
    assert report.selected.state is PointState.SAFE
    assert 90 in report.selected.footing.headings_deg
    assert 270 not in report.selected.footing.headings_deg


def test_the_order_of_the_returns_does_not_matter() -> None:
    heights = np.zeros((80, 80))
    heights[55, 44] = 1.2
    points = np.repeat(returns(heights, CELL_M, -8.0, -8.0), 3, axis=0)
    found = []
    for order in (np.arange(len(points)), np.random.default_rng(3).permutation(len(points))):
        pipe = Pipeline(params.load("quadcopter", list(TAIL)), (0.0, 0.0), follow=False)
        pipe.select(np.array([0.0, 0.0, 0.0]))
        selected = pipe.process(window(points[order])).selected
        assert selected is not None
        found.append(selected.footing.headings_deg)
    assert found[0] == found[1]
    assert 0 < len(found[0]) < len(ALL_HEADINGS)


def test_a_footing_is_computed_again_only_where_its_cells_changed() -> None:
    pipe, _ = flown(np.zeros((80, 80)), *TAIL)
    terrain: EvidenceTerrain = near_map(pipe).terrain
    place = np.array([1.0, 1.0, 0.0])
    first = terrain.footing_at(place, 0.5)
    assert terrain.footing_at(place, 0.5) is first
    post = np.tile([[1.1, -1.1, 1.2]], (6, 1))
    pipe.process(window(post, 1.0))
    assert terrain.footing_at(place, 0.5) is not first
    assert 0 not in terrain.footing_at(place, 0.5).headings_deg


@pytest.mark.parametrize("left", [(), (0, 15, 30)])
def test_where_the_first_point_excludes_headings_one_of_more_is_taken(
    monkeypatch: pytest.MonkeyPatch, left: tuple[int, ...]
) -> None:
    """A long yard whose greatest clearance is all along its axis; little fits west of the middle."""
    own = EvidenceTerrain.footing_at
    asked: list[float] = []

    def blocked(terrain: EvidenceTerrain, enu_m: Floats, error_m: float) -> Footing:
        asked.append(float(enu_m[0]))
        west = float(enu_m[0]) < 2.0
        return Footing(left, 0.0, "rotor: 2.0 m high at 1.0 m") if west else own(terrain, enu_m, error_m)

    monkeypatch.setattr(EvidenceTerrain, "footing_at", blocked)
    heights = np.full((42, 100), 1.5)
    heights[10:32, 10:90] = 0.0
    points = np.repeat(returns(heights, CELL_M, -10.0, -4.2), 3, axis=0)
    pipe = Pipeline(
        params.load("quadcopter", ["min_boundary_points=4", "min_square_m=1"]), (0.0, 0.0), follow=False
    )
    report = pipe.process(window(points))
    zone = min(report.near.zones, key=lambda one: abs(float(one.best.enu_m[2])))
    assert min(asked) < 2.0
    assert zone.best.enu_m[0] > 2.0
    assert zone.best.headings_deg == ALL_HEADINGS
