"""Ranking of zones with reasons, and the landing point within a zone."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

import params
from slz import SAFE, UNKNOWN, UNSAFE, Corridors, Pipeline, Report, SurfaceHere, SurfaceKind, Zone
from slz.landing_point.helicopter_areas import HelicopterAreas
from slz.terrain.footing import ALL_HEADINGS
from slz.zones.ranking import criteria, criteria_text, enough_m, rank
from tests.unit.companion.flight.landing.flight import zone as bare_zone
from tests.unit.slz.hand_made import NOWHERE, returns, window

Floats = NDArray[np.float64]
P = params.load("quadcopter")  # enough is four footprints: 8 m, in steps of 1 m
BARE, ROOF = SurfaceHere(SurfaceKind.BARE, 0.9), SurfaceHere(SurfaceKind.ROOF, 0.99, raised_m=25.2)
WAYS = {
    state: Corridors(
        np.zeros(3), (90.0,), np.full((72, 1), state, np.uint8), np.zeros(72), np.full((72, 3), np.nan)
    )
    for state in (SAFE, UNKNOWN, UNSAFE)
}
CROP = SurfaceHere(SurfaceKind.LOW_VEGETATION, 0.9)


def zone(zone_id: int, **best: Any) -> Zone:
    """A zone of which only what counts in the ranking is filled in; all alike but for what is given."""
    alike = {"clearance_m": 4.0, "certainty": 0.97, "slope_deg": 2.5, "horizon_deg": 7.0, "distance_m": 45.0}
    bare = bare_zone(zone_id, 0.0, 0.0)
    return replace(bare, best=replace(bare.best, **(alike | best)))


def ids(zones: tuple[Zone, ...]) -> list[int]:
    return [one.id for one in zones]


# ---- each criterion in turn ---------------------------------------------------------------------

# what decides; better; worse; what it says of the worse one
DECIDES = [
    (
        "heading",
        {"headings_deg": ALL_HEADINGS},
        {"headings_deg": (), "blocked_by": "rotor: 3.4 m high at 5.0 m"},
        "no heading: rotor: 3.4 m high at 5.0 m, zone 2 has a heading",
    ),
    ("certain enough", {"certainty": 0.861}, {"certainty": 0.855}, "certainty 0.85, zone 2 0.86"),
    (
        "surface",
        {"surface": BARE},
        {"surface": ROOF},
        "roof, 25 m up: to be confirmed, zone 2 needs no confirmation",
    ),
    (
        "areas",
        {"areas": HelicopterAreas(11.7, "", "", "not seen at 9.0 m")},
        {"areas": HelicopterAreas(11.7, "", "slope 6 deg at 5.0 m", "not seen at 9.0 m")},
        "fits 1 of 3 areas by D, zone 2 2 of 3 areas by D",
    ),
    (
        "way in",
        {"corridors": WAYS[SAFE]},
        {"corridors": None},
        "way in unseen, zone 2 in clear",
    ),
    ("way in", {"corridors": WAYS[SAFE]}, {"corridors": WAYS[UNSAFE]}, "way in blocked, zone 2 in clear"),
    ("clearance", {"clearance_m": 5.2}, {"clearance_m": 4.9}, "clearance 4.9 m, zone 2 5.2 m"),
    ("certainty", {"certainty": 0.96}, {"certainty": 0.94}, "certainty 0.94, zone 2 0.96"),
    ("slope", {"slope_deg": 1.9}, {"slope_deg": 2.1}, "slope 2.1 deg, zone 2 1.9 deg"),
    ("approach", {"horizon_deg": 4.0}, {"horizon_deg": 6.0}, "approach 6.0 deg, zone 2 4.0 deg"),
    ("distance", {"distance_m": 39.0}, {"distance_m": 41.0}, "distance 41 m, zone 2 39 m"),
]


@pytest.mark.parametrize(("name", "better", "worse", "why"), DECIDES)
def test_each_criterion_decides_and_says_so(
    name: str, better: dict[str, Any], worse: dict[str, Any], why: str
) -> None:
    first, second = rank([zone(1, **worse), zone(2, **better)], P)
    assert (first.id, second.id) == (2, 1)
    assert first.why == ""
    assert second.why == why


ORDERED = [
    (first, second)
    for first, second in combinations(range(len(DECIDES)), 2)
    if (first, second) != (1, 5)  # the certainty of a zone is one number
]


@pytest.mark.parametrize(("earlier", "later"), ORDERED)
def test_the_earlier_criterion_decides_against_each_later_one(earlier: int, later: int) -> None:
    _, up, down, why = DECIDES[earlier]
    _, better, worse, _ = DECIDES[later]
    first, second = rank([zone(1, **(better | down)), zone(2, **(worse | up))], P)
    assert (first.id, second.id) == (2, 1)
    assert second.why == why


def test_a_zone_not_certain_enough_comes_after_all_that_are() -> None:
    wide = zone(1, certainty=P.min_certainty - 0.01, clearance_m=50, slope_deg=0, horizon_deg=0, distance_m=0)
    narrow = zone(2, certainty=P.min_certainty, clearance_m=1.5, slope_deg=9, horizon_deg=60, distance_m=900)
    assert ids(rank([wide, narrow], P)) == [2, 1]


def test_a_surface_that_the_profile_allows_costs_no_rank() -> None:
    zones = [zone(1, surface=ROOF), zone(2, surface=CROP), zone(3, surface=BARE)]
    assert ids(rank(zones, P)) == [3, 1, 2]
    assert ids(rank(zones, params.load("quadcopter", ["roof=allow"]))) == [1, 3, 2]
    assert ids(rank(zones, params.load("quadcopter", ["roof=allow", "vegetation=allow"]))) == [1, 2, 3]


def test_a_point_without_a_height_is_no_certain_one() -> None:
    bare = zone(1, clearance_m=50)
    nowhere = replace(bare, best=replace(bare.best, enu_m=np.array([0.0, 0.0, math.nan])))
    first, second = rank([nowhere, zone(2)], P)
    assert (first.id, second.id) == (2, 1)
    assert second.why == "certainty 0.97 without height, zone 2 0.97"


@pytest.mark.parametrize(
    "same",
    [
        {"clearance_m": 4.9},
        {"certainty": 0.999},
        {"slope_deg": 2.01},
        {"horizon_deg": 9.9},
        {"distance_m": 40.1},
    ],
)
def test_a_difference_within_a_step_decides_nothing(same: dict[str, float]) -> None:
    one, other = zone(1), zone(2, **same)
    assert ids(rank([other, one], P)) == ids(rank([one, other], P)) == [1, 2]
    assert rank([other, one], P)[1].why == "found later"


def test_more_than_enough_clearance_is_no_better() -> None:
    assert enough_m(P) == 8.0
    assert ids(rank([zone(1, clearance_m=8.0, slope_deg=1), zone(2, clearance_m=80.0)], P)) == [1, 2]
    assert ids(rank([zone(1, clearance_m=7.9, slope_deg=1), zone(2, clearance_m=8.0)], P)) == [2, 1]


def test_enough_is_the_safe_square_where_that_is_more() -> None:
    assert enough_m(params.load("quadcopter", ["min_square_m=24"])) == 24.0


def test_an_approach_that_was_not_seen_is_the_worst_one() -> None:
    first, second = rank([zone(1, horizon_deg=math.nan), zone(2, horizon_deg=60.0)], P)
    assert (first.id, second.id) == (2, 1)
    assert second.why == "approach unseen, zone 2 60.0 deg"
    steep = rank([zone(1, horizon_deg=84.0), zone(2, horizon_deg=math.nan)], P)
    assert steep[1].why == "approach unseen, zone 1 84.0 deg"


def test_an_approach_over_a_valley_is_as_good_as_a_level_one() -> None:
    assert ids(rank([zone(1, horizon_deg=0.0), zone(2, horizon_deg=-30.0)], P)) == [1, 2]


def test_no_distance_is_known_of_a_stored_cloud() -> None:
    ranked = rank([zone(i, distance_m=math.nan) for i in (3, 1, 2)], P)
    assert ids(ranked) == [1, 2, 3]
    assert [one.why for one in ranked] == ["", "found later", "found later"]


def test_each_is_compared_to_the_one_before_it() -> None:
    ranked = rank([zone(1, slope_deg=5.0), zone(2, clearance_m=6.0), zone(3)], P)
    assert [(one.id, one.why) for one in ranked] == [
        (2, ""),
        (3, "clearance 4.0 m, zone 2 6.0 m"),
        (1, "slope 5.0 deg, zone 3 2.5 deg"),
    ]


def test_no_more_zones_than_asked_for_the_best_ones() -> None:
    few = params.load("quadcopter", ["max_zones=2"])
    assert ids(rank([zone(i, slope_deg=9.5 - i) for i in range(1, 6)], few)) == [5, 4]
    assert rank([], P) == ()


kinds = st.fixed_dictionaries(
    {
        "clearance_m": st.sampled_from([1.5, 3.2, 3.9, 7.9, 8.0, 30.0]),
        "certainty": st.sampled_from([0.0, 0.5, 0.855, 0.86, 0.96, 1.0]),
        "slope_deg": st.sampled_from([0.0, 2.2, 2.9, 9.0, 90.0]),
        "horizon_deg": st.sampled_from([math.nan, -8.0, 0.0, 4.0, 21.0, 88.0]),
        "distance_m": st.sampled_from([math.nan, 0.0, 8.0, 12.0, 300.0]),
        "surface": st.sampled_from([BARE, ROOF, CROP]),
    }
)


@settings(max_examples=100, deadline=None)
@given(st.lists(kinds, max_size=6).flatmap(lambda k: st.tuples(st.just(k), st.permutations(range(len(k))))))
def test_the_order_given_changes_nothing(drawn: tuple[list[dict[str, Any]], list[int]]) -> None:
    kind, order = drawn
    zones = [zone(i + 1, **best) for i, best in enumerate(kind)]
    ranked = rank(zones, P)
    again = rank([zones[i] for i in order], P)
    assert [(one.id, one.why) for one in again] == [(one.id, one.why) for one in ranked]
    assert sorted(ids(ranked)) == [one.id for one in zones]


@settings(max_examples=100, deadline=None)
@given(st.lists(kinds, min_size=1, max_size=6))
def test_the_reason_is_the_first_criterion_that_differs(kind: list[dict[str, Any]]) -> None:
    ranked = rank([zone(i + 1, **best) for i, best in enumerate(kind)], P)
    assert ranked[0].why == ""
    for above, below in pairwise(ranked):
        differing = [
            (a, b, text)
            for a, b, text in zip(
                criteria(above, P), criteria(below, P), criteria_text(below, P), strict=True
            )
            if a != b
        ]
        if not differing:
            assert below.why == "found later"
            assert above.id < below.id
            continue
        better, worse, text = differing[0]
        assert better > worse
        assert below.why.startswith(f"{text}, zone {above.id} ")


# ---- through the pipeline -----------------------------------------------------------------------

CELL_M = 0.5


def land(side: int = 100) -> Floats:
    return np.full((side, side), np.nan)


def seen(height: Floats, *own: str, sensor: tuple[float, float, float] = NOWHERE) -> Report:
    fixed = ["cell_m=0.5", "zone_m=100", "angle_noise_deg=0", "min_boundary_points=10", "min_square_m=3"]
    pipe = Pipeline(params.load("quadcopter", [*fixed, "coverage_m=1", *own]), (25.0, 25.0))
    return pipe.process(window(returns(height, CELL_M), 0.0, sensor))


def test_the_wider_of_two_fields_comes_first() -> None:
    height = land()
    height[10:30, 5:25] = 0.0
    height[40:70, 40:70] = 0.0
    first, second = seen(height).zones
    assert first.best.clearance_m > second.best.clearance_m
    assert first.best.enu_m[0] > 20
    assert second.why.startswith(f"clearance {second.best.clearance_m:.1f} m, zone {first.id} ")


def test_the_more_level_of_two_fields_comes_first() -> None:
    height = land()
    rows = np.arange(100)[:, None] * CELL_M
    height[20:50, 5:35] = (np.tan(np.radians(6)) * rows + np.zeros(100))[20:50, 5:35]
    height[20:50, 55:85] = 0.0
    first, second = seen(height).zones
    assert first.best.slope_deg < 1
    assert second.best.slope_deg == pytest.approx(6.0, abs=0.2)
    assert second.why == f"slope {second.best.slope_deg:.1f} deg, zone {first.id} 0.0 deg"


def test_the_field_with_the_free_approach_comes_first() -> None:
    """A wall stands on the side of the vehicle, low enough for neither field to lose room by it."""
    height = land()
    height[20:50, 5:35] = height[20:50, 55:85] = 0.0
    height[50:53, 5:35] = 4.0
    first, second = seen(height, "register_m=0", sensor=(22.5, 60.0, 30.0)).zones
    assert first.best.enu_m[0] > 25
    assert second.best.horizon_deg > first.best.horizon_deg + 10
    assert second.why.startswith("approach ")


def test_the_nearer_of_two_like_fields_comes_first() -> None:
    height = land()
    height[20:50, 5:35] = height[20:50, 55:85] = 0.0
    for east_m, nearer_is_east in ((2.0, False), (48.0, True)):
        first, second = seen(height, "register_m=0", sensor=(east_m, 17.5, 30.0)).zones
        assert bool(first.best.enu_m[0] > 25) is nearer_is_east
        assert second.why.startswith("distance ")
        for one in (first, second):
            assert one.best.distance_m == pytest.approx(math.hypot(*(one.best.enu_m[:2] - [east_m, 17.5])))


# ---- where in a zone ----------------------------------------------------------------------------


def clearance_m(one: Zone) -> Floats:
    """Distance of each cell of a zone from what is not the zone, by another way round: cell by cell."""
    cells = np.argwhere(one.cells == 1)
    none = np.argwhere(np.pad(one.cells, 1) == 0) - 1
    way = np.hypot(*(cells[:, None] - none[None]).transpose(2, 0, 1)).min(axis=1)
    return np.asarray((way - 0.5) * CELL_M)


@pytest.mark.parametrize("seed", range(6))
def test_the_best_point_is_the_one_of_largest_clearance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height = land(70)
    height[5:60, 5:60] = 0.0
    for row, col in rng.integers(5, 58, (5, 2)):
        height[row : row + 2, col : col + 2] = 1.5
    report = seen(height)
    assert report.zones
    for one in report.zones:
        clearance = clearance_m(one)
        row, col = report.grid.index(*one.best.enu_m[:2])
        cells = np.argwhere(one.cells == 1) + np.array([one.box.row0, one.box.col0])
        own = float(clearance[(cells == [row, col]).all(axis=1)][0])
        assert one.best.clearance_m == pytest.approx(own)
        assert own >= clearance.max() - CELL_M / 2 - 1e-9
        inside = ndimage.distance_transform_edt(np.pad(one.cells, 1))
        assert own >= (inside.max() - 1) * CELL_M - 1e-9


def strip(tilt_deg: Floats) -> Floats:
    """A strip along a row, as deep everywhere, so that many points have the largest clearance."""
    height = land(130)
    slope = np.tan(np.radians(tilt_deg))
    up = np.arange(130)[:, None] * CELL_M * slope[None]
    height[20:41, 5:125] = up[20:41, 5:125]
    return height


def test_of_points_as_clear_the_most_certain_is_taken() -> None:
    """The western half is smooth and slopes; the eastern one is level, and as uneven as is just allowed."""
    height = land(130)
    height[20:41, 5:125] = np.minimum(np.arange(5, 125), 65) * CELL_M * np.tan(np.radians(4.0))
    height[20:41:2, 62:125:2] += 0.24
    one = seen(height, "zone_m=140", "range_noise_m=0.12", "safe_slope_deg=30", "min_certainty=0.5").zones[0]
    assert one.box.col1 - one.box.col0 > 100
    assert one.best.enu_m[0] < 32.5
    assert one.best.slope_deg == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("level_end", ["west", "east"])
def test_of_points_as_certain_the_least_steep_is_taken(level_end: str) -> None:
    tilt = np.interp(np.arange(130), [0, 129], [0.0, 4.0])
    tilt = tilt if level_end == "west" else tilt[::-1]
    over_the_steep_end = (62.0 if level_end == "west" else 3.0, 15.25, 20.0)
    own = ("zone_m=140", "relief_m=2", "safe_slope_deg=20", "register_m=0")
    one = seen(strip(tilt), *own, sensor=over_the_steep_end).zones[0]
    ends = sorted(one.corners_enu_m[:, 0])
    middle = (ends[0] + ends[-1]) / 2
    assert bool(one.best.enu_m[0] < middle) is (level_end == "west")
    assert one.best.slope_deg <= one.slope_deg


@pytest.mark.parametrize("east_m", [12.0, 30.0, 50.0])
def test_of_points_as_level_the_nearest_to_the_vehicle_is_taken(east_m: float) -> None:
    one = seen(strip(np.zeros(130)), "zone_m=140", "register_m=0", sensor=(east_m, 15.25, 20.0)).zones[0]
    assert one.best.enu_m[0] == pytest.approx(east_m, abs=2 * CELL_M)


def test_the_best_point_is_on_the_ground() -> None:
    height = land()
    height[20:60, 20:60] = 3.25
    (one,) = seen(height).zones
    assert one.best.enu_m[2] == pytest.approx(3.25)
    assert one.best.square_side_m >= 2 * one.best.clearance_m - CELL_M
