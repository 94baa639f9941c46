"""Selected landing point: deciding map, state beyond a map, and warnings (SLZ thesis, Section 4.3.2)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from companion.flight.landing.aim import Aim
from companion.flight.landing.situation import Situation
from slz import SAFE, Pipeline, PointState, Report, SelectedPoint
from tests.unit.companion.flight.landing.flight import Flight, Phase, zone
from tests.unit.slz.hand_made import NOWHERE, flat, maps, returns, state_at, window

Floats = NDArray[np.float64]
POINT = np.array([20.5, 10.5, 0.0])
ELSEWHERE_M = 1000.0
BESIDE_M = 100.0  # within the map around it, out of sight
LOW_M, HIGH_M = 50.0, 150.0


# ---- source mode --------------------------------------------------------------------------------


class SourceFlight:
    """Windows into the near map (flown low) and into the far one (flown high), a minute from each other."""

    def __init__(self, *own: str) -> None:
        fixed = ["mode=source", "zone_m=400", "histogram_threshold=1", "min_square_m=5"]
        limits = ["min_boundary_points=10", "far_height_m=100", "far_speed_ms=100"]
        self.pipe = Pipeline(params.load("helicopter", [*fixed, *limits, *own]), (0.0, 0.0))
        self.second = 0.0

    def _window(self, height_m: float, slope_deg: float, east_m: float) -> Report:
        height = flat(120, 120) + np.tan(np.radians(slope_deg)) * (np.arange(120) - 60)
        cloud = returns(height, 1.0, east_m - 60.0, -60.0)
        up_m = height_m + float(np.median(cloud[:, 2]))
        self.second += 60.0
        return self.pipe.process(window(cloud, self.second, (east_m, 0.0, up_m)))

    def near(self, slope_deg: float = 0.0, east_m: float = 0.0) -> Report:
        return self._window(LOW_M, slope_deg, east_m)

    def far(self, slope_deg: float = 0.0, east_m: float = 0.0) -> Report:
        return self._window(HIGH_M, slope_deg, east_m)


def selected(report: Report) -> SelectedPoint:
    assert report.selected is not None
    return report.selected


STEEP_DEG = 20.0


@pytest.mark.parametrize(
    ("near", "far", "state", "judged_by"),
    [
        ("safe", "safe", PointState.SAFE, "near"),
        ("safe", "unsafe", PointState.SAFE, "near"),
        ("safe", "left", PointState.SAFE, "near"),
        ("unsafe", "safe", PointState.UNSAFE, "near"),
        ("unsafe", "unsafe", PointState.UNSAFE, "near"),
        ("unsafe", "left", PointState.UNSAFE, "near"),
        ("unseen", "safe", PointState.SAFE, "far"),  # no window went into the near map yet
        ("beside", "safe", PointState.UNSAFE, "near"),  # the map is there, and starts with the worst case
        ("left", "safe", PointState.SAFE, "far"),
        ("left", "unsafe", PointState.UNSAFE, "far"),
        ("left", "left", PointState.UNKNOWN, "none"),
    ],
)
@pytest.mark.parametrize("far_first", [True, False])
def test_source_the_near_map_decides_else_the_far_one(
    near: str, far: str, state: PointState, judged_by: str, far_first: bool
) -> None:
    """SLZ thesis, section 4.3.2.3, every row."""
    flight = SourceFlight()
    slope = {"safe": 0.0, "unsafe": STEEP_DEG, "left": 0.0, "beside": 0.0}
    away = {"left": ELSEWHERE_M, "beside": BESIDE_M}

    def fly_far() -> Report:
        return flight.far(slope[far], away.get(far, 0.0))

    if far_first:
        fly_far()
    if near != "unseen":
        flight.near(slope[near], away.get(near, 0.0))
    if not far_first:
        fly_far()
    flight.pipe.select(POINT)
    point = selected(fly_far())
    assert point.state is state
    assert point.judged_by == judged_by
    np.testing.assert_array_equal(point.enu_m, POINT)


def test_source_the_point_is_told_its_zone_and_ground() -> None:
    flight = SourceFlight()
    flight.near()
    flight.pipe.select(POINT)
    report = flight.near()
    point = selected(report)
    assert point.zone_id == report.near.zones[0].id
    assert point.height_m == 0.0
    assert point.slope_deg == 0.0
    assert math.isnan(point.relief_m)  # the sources know none


@pytest.mark.parametrize("slope_deg", [0.0, STEEP_DEG])
def test_source_the_state_outlives_a_map_that_left_the_point_behind(slope_deg: float) -> None:
    """SLZ thesis, section 4.3.2.2, both for a point found safe and for one found unsafe."""
    flight = SourceFlight()
    flight.near(slope_deg)
    flight.far(0.0, ELSEWHERE_M)
    flight.pipe.select(POINT)
    known = selected(flight.near(slope_deg))
    assert known.judged_by == "near"
    for _ in range(3):
        left = selected(flight.near(0.0, ELSEWHERE_M))
        assert left.judged_by == "none"
        assert left.state is known.state is (PointState.UNSAFE if slope_deg else PointState.SAFE)
        assert left.zone_id is None
        assert left.height_m == known.height_m


@pytest.mark.parametrize("slope_deg", [0.0, STEEP_DEG])
def test_source_a_map_that_comes_back_judges_anew(slope_deg: float) -> None:
    flight = SourceFlight()
    flight.near()
    flight.far(0.0, ELSEWHERE_M)
    flight.pipe.select(POINT)
    flight.near()
    assert selected(flight.near(0.0, ELSEWHERE_M)).judged_by == "none"
    back = selected(flight.near(slope_deg))
    assert back.judged_by == "near"
    assert back.state is (PointState.UNSAFE if slope_deg else PointState.SAFE)


def test_source_the_far_map_takes_over_from_a_near_one_that_left_the_point() -> None:
    flight = SourceFlight()
    flight.far(STEEP_DEG)
    flight.near()
    flight.pipe.select(POINT)
    assert selected(flight.near()).judged_by == "near"
    left = selected(flight.near(0.0, ELSEWHERE_M))
    assert (left.judged_by, left.state) == ("far", PointState.UNSAFE)


def test_source_a_new_point_knows_nothing_of_the_one_before() -> None:
    """SLZ thesis, section 4.3.2.1."""
    flight = SourceFlight()
    flight.near()
    flight.far()
    flight.pipe.select(POINT)
    assert selected(flight.near()).state is PointState.SAFE
    flight.near(0.0, ELSEWHERE_M)
    flight.far(0.0, ELSEWHERE_M)
    flight.pipe.select(POINT + np.array([5.0, 0.0, 0.0]))
    point = selected(flight.near(0.0, ELSEWHERE_M))
    assert (point.state, point.judged_by) == (PointState.UNKNOWN, "none")


def test_source_it_warns_with_the_window_that_shows_the_point_unsafe() -> None:
    flight = SourceFlight()
    flight.near()
    flight.pipe.select(POINT)
    assert selected(flight.near()).state is PointState.SAFE
    assert selected(flight.near(STEEP_DEG)).state is PointState.UNSAFE


# ---- default mode -------------------------------------------------------------------------------


def default(*own: str) -> Pipeline:
    fixed = ["zone_m=60", "min_boundary_points=10", "register_m=0", "coverage_m=1", "surround_m=5"]
    return Pipeline(params.load("quadcopter", [*fixed, *own]), (0.0, 0.0))


def square(half_m: float, cell_m: float, east_m: float = 0.0) -> Floats:
    n = round(2 * half_m / cell_m)
    return returns(flat(n, n), cell_m, east_m - half_m, -half_m)


def over(pipe: Pipeline, ground: Floats, second: float = 0.0, east_m: float = 0.0) -> Report:
    return pipe.process(window(ground, second, (east_m, 0.0, 10.0)))


def test_a_point_out_of_the_near_map_s_reach_is_judged_by_the_far_map() -> None:
    pipe = default()
    over(pipe, square(30, 0.25))
    pipe.select(np.array([22.0, 0.0, 0.0]))
    far = selected(over(pipe, square(30, 0.25), 1))
    assert (far.state, far.judged_by) == (PointState.SAFE, "far")
    closer = selected(over(pipe, square(30, 0.25), 2, 15.0))
    assert (closer.state, closer.judged_by) == (PointState.SAFE, "near")


def test_the_certainty_of_a_point_is_the_least_of_the_cells_it_may_be_missed_by() -> None:
    cloud = square(15, 0.25)
    block = (np.abs(cloud[:, 0] - 3.0) < 0.4) & (np.abs(cloud[:, 1]) < 0.4)
    cloud[block, 2] += 1.0
    pipe = default()
    over(pipe, cloud)
    for second, (east, state) in enumerate([(-5.0, PointState.SAFE), (1.1, PointState.UNSAFE)], 1):
        pipe.select(np.array([east, 0.0, 0.0]))
        point = selected(over(pipe, cloud, second))
        row, col = maps(pipe).grid.index(east, 0.0)
        certain, box = maps(pipe).certainty, maps(pipe).box
        reach = round(0.5 / maps(pipe).grid.cell_m)
        around = certain[row - box.row0 - reach : row - box.row0 + reach + 1, :]
        around = around[:, col - box.col0 - reach : col - box.col0 + reach + 1]
        assert point.state is state
        assert point.certainty <= certain[row - box.row0, col - box.col0]
        assert point.certainty == pytest.approx(around.min(), abs=0.05)
    assert point.certainty < 0.01


def test_the_near_map_overrules_the_far_one() -> None:
    """A narrow ditch vanishes in the far map's cells. Seen from near it counts, whatever the far map says."""
    ground = flat(240, 240)
    ground[:, 208:210] -= 0.5  # east 22.0 to 22.5
    cloud = returns(ground, 0.25, -30.0, -30.0)
    pipe = default()
    over(pipe, cloud)
    pipe.select(np.array([22.2, 0.0, 0.0]))
    assert selected(over(pipe, cloud, 1)).judged_by == "far"
    closer = selected(over(pipe, cloud, 2, 15.0))
    assert (closer.state, closer.judged_by) == (PointState.UNSAFE, "near")


def test_a_point_that_no_map_measured_is_unknown() -> None:
    pipe = default()
    over(pipe, square(10, 0.2))
    for place in ((25.0, 0.0, 0.0), (500.0, 500.0, 0.0), (25.0, 0.0, math.nan)):
        pipe.select(np.array(place))
        point = selected(over(pipe, square(10, 0.2), 1))
        assert (point.state, point.judged_by) == (PointState.UNKNOWN, "none")
        assert point.surroundings is None
        assert all(map(math.isnan, (point.height_m, point.slope_deg, point.relief_m, point.certainty)))


def test_a_point_becomes_unsafe_with_the_first_window_that_shows_something_on_it() -> None:
    pipe, free = default(), flat(100, 100)
    taken = free.copy()
    taken[48:53, 48:53] = 1.0
    over(pipe, returns(free, 0.2, -10, -10))
    pipe.select(np.array([0.1, 0.1, 0.0]))
    before = selected(over(pipe, returns(free, 0.2, -10, -10), 1))
    assert (before.state, before.judged_by) == (PointState.SAFE, "near")
    after = selected(over(pipe, returns(taken, 0.2, -10, -10), 2))
    assert (after.state, after.judged_by) == (PointState.UNSAFE, "near")


def test_the_evidence_of_a_point_outlives_the_map_s_window_and_ages() -> None:
    """Unlike the source's state, which lasts for ever."""
    pipe = default("max_age_s=50")
    over(pipe, square(10, 0.2))
    pipe.select(np.array([1.0, 1.0, 0.0]))
    here = selected(over(pipe, square(10, 0.2), 1))
    for second in range(2, 8):
        report = over(pipe, square(12, 0.5, 300.0), second, 300.0)
    assert not report.near.grid.holds(*report.near.grid.index(1.0, 1.0))
    there = selected(report)
    assert (there.state, there.judged_by) == (PointState.SAFE, "near")
    assert there.height_m == here.height_m
    old = selected(over(pipe, square(12, 0.5, 300.0), 58, 300.0))
    assert (old.state, old.judged_by) == (PointState.UNKNOWN, "none")
    assert old.height_m == here.height_m  # the last one known


def test_an_unsafe_point_left_behind_does_not_become_safe_by_itself() -> None:
    pipe, ground = default("max_age_s=50"), flat(100, 100)
    ground[48:53, 48:53] = 1.0
    over(pipe, returns(ground, 0.2, -10, -10))
    pipe.select(np.array([0.1, 0.1, 0.0]))
    for second in range(2, 70, 4):
        state = selected(over(pipe, square(12, 0.5, 300.0), second, 300.0)).state
        assert state is not PointState.SAFE
        assert state is PointState.UNSAFE or second > 44
    assert state is PointState.UNKNOWN


@pytest.mark.parametrize("bad", [[1.0, 2.0], [math.nan, 0.0, 0.0], [0.0, math.inf, 0.0], [[0.0, 0.0, 0.0]]])
def test_a_point_is_three_numbers(bad: list[float]) -> None:
    pipe = default()
    over(pipe, square(5, 0.2))
    with pytest.raises(ValueError, match="three numbers"):
        pipe.select(np.array(bad))


def test_no_point_is_watched_any_more_once_none_is_selected() -> None:
    pipe = default()
    over(pipe, square(10, 0.2))
    assert over(pipe, square(10, 0.2), 1).selected is None
    pipe.select(POINT)
    assert over(pipe, square(10, 0.2), 2).selected is not None
    pipe.select(None)
    assert over(pipe, square(10, 0.2), 3).selected is None


def obstructed() -> Pipeline:
    """Ground with a block on it, and with a hole in what was seen."""
    ground = flat(120, 120)
    ground[60:65, 60:64] = 1.0
    ground[20:31, 90:101] = np.nan
    pipe = default()
    pipe.process(window(returns(ground, 0.2, -12, -12), 0.0, NOWHERE))
    return pipe


SCENE = obstructed()
offsets = st.floats(-4, 4)


def assert_judged_by_its_cells(east_m: float, north_m: float) -> None:
    """Safe only if every cell within the error is, and always if every cell of the square about it is.

    A cell that is touched just so, to a thousandth of a millimetre, may count or not.
    """
    SCENE.select(np.array([east_m, north_m, 0.0]))
    point = SCENE.selected
    assert point is not None
    if point.state is PointState.SAFE:
        safe, distance_m = cells_about(east_m, north_m, 0.5 - 1e-6)
        assert safe[distance_m < 0.5 - 1e-6].all()
    else:
        safe, _ = cells_about(east_m, north_m, 0.5 + 1e-6)
        assert not safe.all()


def cells_about(east_m: float, north_m: float, half_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return of the cells of a square about a point whether they are safe, and how far their edges are."""
    m = maps(SCENE)
    row0, col0 = m.grid.index(east_m - half_m, north_m - half_m)
    row1, col1 = m.grid.index(east_m + half_m, north_m + half_m)
    rows, cols = np.mgrid[row0 : row1 + 1, col0 : col1 + 1]
    safe = m.state[rows - m.box.row0, cols - m.box.col0] == SAFE
    centres = m.grid.centres(np.column_stack([rows.ravel(), cols.ravel()]))
    way = np.maximum(np.abs(centres - np.array([east_m, north_m])) - m.grid.cell_m / 2, 0)
    return safe, np.hypot(*way.T).reshape(safe.shape)


@pytest.mark.parametrize("across", [True, False])
@pytest.mark.parametrize("middle", [(0.4, 0.5), (7.1, -6.9)])
def test_a_point_is_never_safe_while_a_cell_within_the_touchdown_error_is_not(
    middle: tuple[float, float], across: bool
) -> None:
    """On lines over what stands there, and over what was not seen."""
    for step in np.arange(-3.01, 3.0, 0.04):
        assert_judged_by_its_cells(middle[0] + step * across, middle[1] + step * (not across))


@settings(max_examples=60, deadline=None)
@example((7.1, -6.9), 0.0, 2.8)
@example((7.1, -6.9), 2.75, 2.75)
@given(st.sampled_from([(0.4, 0.5), (7.1, -6.9)]), offsets, offsets)
def test_a_point_is_never_safe_while_a_cell_within_the_touchdown_error_is_not_anywhere(
    middle: tuple[float, float], east: float, north: float
) -> None:
    assert_judged_by_its_cells(middle[0] + east, middle[1] + north)


def test_the_touchdown_error_counts_in_cells_wider_than_it() -> None:
    """In cells of 1 m a point 0.1 m from an unsafe cell is not safe."""
    ground = flat(60, 60)
    ground[30:34, 40:44] = 2.0
    pipe = Pipeline(
        params.load(
            "quadcopter",
            [
                "cell_m=1",
                "zone_m=80",
                "footprint_m=2",
                "coverage_m=1",
                "touchdown_error_m=0.4",
                "min_square_m=3",
            ],
        ),
        (30.0, 30.0),
    )
    pipe.process(window(returns(ground, 1.0), 0.0, NOWHERE))
    free = [state_at(pipe, east + 0.5, 32.5) == SAFE for east in range(20, 40)]
    edge_m = 20.0 + free.index(False)
    assert all(free[: free.index(False)])
    for gap_m, state in ((0.1, PointState.UNSAFE), (0.3, PointState.UNSAFE), (0.45, PointState.SAFE)):
        pipe.select(np.array([edge_m - gap_m, 32.5, 0.0]))
        point = pipe.selected
        assert point is not None
        assert point.state is state


# ---- and the executive --------------------------------------------------------------------------


class FarJudged(Flight):
    """A flight whose point is judged by the far map, above a height or always."""

    above_m = 0.0

    def situation(self) -> Situation:
        known = super().situation()
        if known.selected is None or self.position[2] <= self.above_m:
            return known
        point = replace(known.selected, judged_by="far")
        assert known.report is not None
        return replace(known, selected=point, report=replace(known.report, selected=point))


def test_the_executive_never_descends_on_what_the_far_map_says() -> None:
    flight = FarJudged([zone(1, 20, 0)])
    flight.run(60)
    assert Phase.APPROACH in flight.phases
    assert Phase.DESCEND not in flight.phases
    assert Phase.FINAL not in flight.phases
    assert "SLZ: abort: point not seen" in flight.texts
    assert flight.position[2] > 25


def test_the_executive_breaks_off_when_the_near_map_loses_the_point_on_the_way_down() -> None:
    flight = FarJudged([zone(1, 20, 0)])
    flight.above_m = 1e9
    flight.fly_to(Phase.DESCEND).until(lambda f: f.position[2] < 20)
    flight.above_m = 0.0
    flight.step()
    assert flight.executive.phase is Phase.CLIMB
    assert "SLZ: abort: point unknown" in flight.texts


def test_the_executive_descends_once_the_near_map_says_so() -> None:
    flight = FarJudged([zone(1, 20, 0)])
    flight.run(25)
    assert Phase.DESCEND not in flight.phases
    flight.above_m = 1e9
    flight.fly_to(Phase.DESCEND)


def test_the_point_of_the_pipeline_keeps_the_executive_up_until_the_near_map_has_it() -> None:
    """Both together: what the pipeline says of a point out of reach, and what is done about it."""
    pipe = default()
    over(pipe, square(30, 0.25))
    place = np.array([22.0, 0.0, 0.0])
    pipe.select(place)
    aim = Aim()
    aim.set_target(place)
    for second, east_m, state in ((1, 0.0, PointState.UNKNOWN), (2, 15.0, PointState.SAFE)):
        point = selected(over(pipe, square(30, 0.25), second, east_m))
        assert point.state is PointState.SAFE
        assert aim.judgement(point) is state
