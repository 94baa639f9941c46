"""Heights around the vehicle from both maps: unknown stays unknown, departed objects disappear."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from params import Parameters, build
from slz import Nearby, Pipeline, PointState, Window
from slz.frame import LocalFrame

S = 1_000_000_000
FRAME = LocalFrame(47.0, 8.0, 400.0)
SENSOR = np.array([0.0, 0.0, 15.0])


def patch(ground: list[list[float]], west_m: float = 0.0, cell_m: float = 0.5) -> Nearby:
    heights = np.array(ground, np.float32)
    return Nearby(west_m, 0.0, cell_m, heights, heights, np.zeros(heights.shape, bool))


def ground(seed: int, half_m: float = 20.0, count: int = 120_000) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-half_m, half_m, (count, 2)), rng.normal(0, 0.01, count)])


def box(east_m: float, north_m: float, top_m: float, seed: int = 9) -> NDArray[np.float64]:
    """Return the roof and walls of a 2 m box."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1, -1, 0.2), (1, 1, top_m), (6000, 3))
    points[:2000, 2] = top_m
    points[2000:4000, 0] = np.where(points[2000:4000, 0] > 0, 1, -1)
    points[4000:, 1] = np.where(points[4000:, 1] > 0, 1, -1)
    return points + np.array([east_m, north_m, 0.0])


def window(points: NDArray[np.float64], start_s: int) -> Window:
    stamps = start_s * S + np.linspace(0, S - 1, len(points)).astype(np.int64)
    return Window(points, stamps, SENSOR, FRAME, int(stamps[0]), int(stamps[-1]))


def parameters() -> Parameters:
    return build({"zone_m": 100.0})


def test_what_stands_around_the_vehicle_goes_with_the_report() -> None:
    pipeline = Pipeline(parameters(), (0.0, 0.0))
    scene = ground(1)
    hidden = np.hypot(scene[:, 0] - 8, scene[:, 1]) < 1.5
    report = pipeline.process(window(np.vstack([scene[~hidden], box(8.0, 0.0, 6.0)]), 0))
    around = report.nearby
    assert around is not None
    columns = around.columns_enu_m(3.0)
    assert len(columns)
    assert np.abs(columns[:, 0] - 8).max() < 1.6
    assert np.abs(columns[:, 1]).max() < 1.6
    assert columns[:, 2].max() == pytest.approx(6.0, abs=0.1)
    assert around.ground_below_m(SENSOR) == pytest.approx(0.0, abs=0.05)
    assert around.ground_below_m(np.array([8.0, 0.0])) == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize(("cell_m", "block_m"), [(0.1, 0.5), (0.2, 0.6), (0.25, 0.5), (0.5, 0.5), (0.7, 0.7)])
def test_blocks_are_whole_cells_and_no_smaller_than_half_a_metre(cell_m: float, block_m: float) -> None:
    own = build({"zone_m": 100.0, "cell_m": cell_m, "adaptive": "off"})
    report = Pipeline(own, (0.0, 0.0)).process(window(ground(1), 0))
    assert report.nearby is not None
    assert report.nearby.cell_m == pytest.approx(block_m)


def test_a_mast_reaches_as_high_as_its_highest_return() -> None:
    """The mean of its cell is lower, and most of its returns lie below that."""
    rng = np.random.default_rng(3)
    foot = np.array([8.1, 0.1]) + rng.uniform(-0.02, 0.02, (60, 2))
    mast = np.column_stack([foot, 6.0 * rng.random(60) ** 2])
    mast[:3, 2] = 6.0
    report = Pipeline(parameters(), (0.0, 0.0)).process(window(np.vstack([ground(1), mast]), 0))
    assert report.nearby is not None
    (column,) = report.nearby.columns_enu_m(4.0)
    assert np.hypot(column[0] - 8.1, column[1] - 0.1) < 0.6
    assert column[2] == pytest.approx(6.0, abs=0.1)


def test_what_lies_behind_the_field_of_view_stays_and_what_drove_off_leaves() -> None:
    pipeline = Pipeline(parameters(), (0.0, 0.0))
    first = np.vstack([ground(1), box(8.0, 0.0, 3.0)])
    pipeline.process(window(first, 0))
    elsewhere = ground(2)
    report = pipeline.process(window(elsewhere[elsewhere[:, 0] < 0], 1))
    assert report.nearby is not None
    assert len(report.nearby.columns_enu_m(1.0)), "turned away from it"
    for second in range(2, 40):  # seen through, longer than evidence is held
        report = pipeline.process(window(ground(second), second))
    assert report.nearby is not None
    assert not len(report.nearby.columns_enu_m(1.0)), "it drove off"


def test_ground_never_seen_is_unknown() -> None:
    pipeline = Pipeline(parameters(), (0.0, 0.0))
    scene = ground(1)
    report = pipeline.process(window(scene[scene[:, 0] < -3], 0))
    assert report.nearby is not None
    assert math.isnan(report.nearby.ground_below_m(np.array([5.0, 0.0, 9.0])))
    assert math.isnan(report.nearby.ground_below_m(np.array([5000.0, 0.0, 9.0])))
    assert math.isnan(report.nearby.ground_below_m(np.array([math.nan, 0.0, 9.0])))


def test_far_ground_comes_from_the_far_map() -> None:
    pipeline = Pipeline(parameters(), (0.0, 0.0))
    report = pipeline.process(window(np.vstack([ground(1, 35.0, 300_000), box(24.0, 4.0, 9.0)]), 0))
    assert report.nearby is not None
    columns = report.nearby.columns_enu_m(4.0)
    assert len(columns)
    assert np.abs(columns[:, 0] - 24).max() < 3.1


def test_the_ground_below_is_the_median_within_a_metre() -> None:
    near = patch([[math.nan, 1.0, 1.2, 9.0], [1.1, 1.1, 1.3, 9.0]])
    assert near.ground_below_m(np.array([0.25, 0.25])) == pytest.approx(1.1, abs=0.06)
    assert math.isnan(near.ground_below_m(np.array([-1.0, 0.2])))


def test_nothing_can_be_changed_and_a_sensor_of_unknown_place_has_no_surroundings() -> None:
    pipeline = Pipeline(parameters(), (0.0, 0.0))
    report = pipeline.process(window(ground(1), 0))
    assert report.nearby is not None
    with pytest.raises(ValueError, match="read-only"):
        report.nearby.top_m[0, 0] = 1
    points = ground(2)
    lost = Window(points, np.arange(len(points)), np.full(3, np.nan), FRAME, 0, len(points))
    assert Pipeline(parameters(), (0.0, 0.0)).process(lost).nearby is None


@pytest.mark.parametrize("mode", ["default", "source"])
def test_it_is_made_in_either_mode(mode: str) -> None:
    report = Pipeline(build({"zone_m": 100.0, "mode": mode}), (0.0, 0.0)).process(window(ground(1), 0))
    assert report.nearby is not None
    assert report.nearby.top_m.shape == report.nearby.ground_m.shape
    assert report.nearby.ground_below_m(SENSOR) == pytest.approx(0.0, abs=0.06)


def test_columns_stand_in_the_middles_of_their_cells() -> None:
    heights = Nearby(
        -3.0,
        7.0,
        0.5,
        *(np.array([[0, 5, np.nan], [9, 1, 6]], np.float32) for _ in "gt"),
        np.zeros((2, 3), bool),
    )
    found = heights.columns_enu_m(4.0)
    assert found.tolist() == [[-2.25, 7.25, 5.0], [-2.75, 7.75, 9.0], [-1.75, 7.75, 6.0]]


@pytest.mark.parametrize(("east_m", "north_m"), [(2.25, 4.75), (4.75, 2.25), (0.25, 5.75), (3.1, 3.4)])
def test_the_ground_below_is_the_median_of_the_cells_within_a_metre(east_m: float, north_m: float) -> None:
    """Each cell has a height of its own."""
    rng = np.random.default_rng(6)
    heights = rng.permutation(12 * 12).reshape(12, 12).astype(float)
    around = patch(heights.tolist())
    rows, cols = (np.abs((np.arange(12) + 0.5) * 0.5 - at) <= 1.0 for at in (north_m, east_m))
    assert around.ground_below_m(np.array([east_m, north_m])) == np.median(heights[rows][:, cols])


def block_at(around: Nearby, east_m: float, north_m: float) -> bool:
    row = math.floor((north_m - around.south_m) / around.cell_m)
    col = math.floor((east_m - around.west_m) / around.cell_m)
    return bool(around.landable[row, col])


def test_a_place_that_is_called_safe_when_selected_is_landable_and_no_other() -> None:
    pipeline = Pipeline(parameters(), (0.0, 0.0))
    report = pipeline.process(window(np.vstack([ground(1), box(8.0, 0.0, 1.0)]), 0))
    assert report.nearby is not None
    assert block_at(report.nearby, -5.0, 0.0)
    rows, cols = np.nonzero(report.nearby.landable)
    for k in np.random.default_rng(2).choice(len(rows), 40, replace=False).tolist():
        east = report.nearby.west_m + (cols[k] + 0.5) * report.nearby.cell_m
        north = report.nearby.south_m + (rows[k] + 0.5) * report.nearby.cell_m
        pipeline.select(np.array([east, north, 0.0]))
        assert pipeline.selected is not None
        assert pipeline.selected.state is PointState.SAFE
    assert not any(block_at(report.nearby, 8.0 + e, n) for e in (-1.0, 0.0, 1.0) for n in (-1.0, 0.0, 1.0))
    assert not any(block_at(report.nearby, 25.0, n) for n in (-5.0, 0.0, 5.0)), "nobody has seen it"


def test_ground_less_certain_than_asked_for_is_not_landable() -> None:
    own = build({"zone_m": 100.0, "min_certainty": 1.0})
    report = Pipeline(own, (0.0, 0.0)).process(window(ground(1), 0))
    assert report.nearby is not None
    assert not report.nearby.landable.any()
