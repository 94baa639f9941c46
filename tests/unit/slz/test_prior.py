"""Prior from a survey: known at once, and overridden by any live return."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNKNOWN, UNSAFE, Grid, LocalFrame, Pipeline, PointState, Report, Window
from slz.prior import CERTAINTY, FIRST_ID, Prior, PriorTerrain, Surveyed

FRAME = LocalFrame(47.0, 8.0, 400.0)
CELLS, OFFSET_M = 256, 37.0  # the survey's heights have another datum
PARAMETERS = params.build({"zone_m": 80.0, "memory_mb": 64.0})
Points = NDArray[np.float64]


def surveyed(safe: bool = True) -> Surveyed:
    """Flat ground 256 m x 256 m; a lake, unknown, and a wood, unsafe, on it."""
    grid = Grid(-128.0, -128.0, 1.0, CELLS, CELLS)
    state = np.full((CELLS, CELLS), SAFE if safe else UNSAFE, np.uint8)
    state[:, 150:160] = UNSAFE
    state[100:110, :] = UNKNOWN
    flat = np.zeros((CELLS, CELLS), np.float32)
    return Surveyed(grid, state, flat - np.float32(OFFSET_M), flat)


def ground(half_m: float = 12.0, n: int = 20_000, seed: int = 0) -> Points:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-half_m, half_m, (n, 2)), rng.normal(0, 0.02, n)])


def window(points: Points, second: float) -> Window:
    stamps = (second * 1e9 + np.linspace(0, 0.9e9, len(points))).astype(np.int64)
    return Window(points, stamps, np.array([0.0, 0.0, 30.0]), FRAME, int(stamps[0]), int(stamps[-1]))


def flown(*windows: Points, survey: Surveyed | None = None) -> tuple[Pipeline, list[Report]]:
    pipeline = Pipeline(PARAMETERS, prior=lambda _frame, _place: survey or surveyed())
    return pipeline, [pipeline.process(window(points, k)) for k, points in enumerate(windows)]


def holding(report: Report, east: float, north: float) -> list[int]:
    assert report.prior is not None
    row, col = report.prior.grid.index(east, north)
    return [zone.id for zone in report.prior.zones if zone.holds(row, col)]


def test_far_zones_are_known_with_the_first_window_and_as_uncertain_as_they_are() -> None:
    _, (report,) = flown(ground())
    assert report.prior is not None
    assert len(report.prior.zones) == 4  # the wood and the lake part them
    assert all(holding(report, *place) for place in ((-100, 100), (100, 100), (-100, -100), (100, -100)))
    assert all(zone.id >= FIRST_ID for zone in report.prior.zones)
    for zone in report.prior.zones:
        assert zone.best.certainty == CERTAINTY < PARAMETERS.min_certainty
        assert zone.best.enu_m[2] == pytest.approx(0.0, abs=0.05)  # in the map's heights


def test_what_live_maps_know_is_no_ground_of_the_survey_s() -> None:
    _, (report,) = flown(ground())
    assert report.near.zones
    assert not holding(report, 0.0, 5.0)
    assert holding(report, 40.0, 100.0) or holding(report, -40.0, 100.0)


def test_a_point_of_the_survey_alone_is_never_safe() -> None:
    pipeline, (report,) = flown(ground())
    assert report.prior is not None
    for second, zone in enumerate(report.prior.zones, start=1):
        pipeline.select(zone.best.enu_m)
        selected = pipeline.process(window(ground(), second)).selected
        assert selected is not None
        assert selected.state is PointState.UNKNOWN
        assert selected.judged_by == "none"


@pytest.mark.parametrize("up_m", [2.0, -2.0])
def test_one_return_that_contradicts_takes_the_ground_at_once_and_for_good(up_m: float) -> None:
    pipeline, (before,) = flown(ground())
    assert before.prior is not None
    best = before.prior.zones[0].best.enu_m
    one = np.array([[best[0], best[1], up_m]])
    beside = one + np.array([[0.1, 0, 0], [0, 0.1, 0], [0.1, 0.1, 0.1], [-0.1, 0, 0]])  # lest it be alone
    after = pipeline.process(window(np.vstack([ground(), one, beside]), 1))
    for east in (-1.0, 0.0, 1.0):  # nor do footprints that reach over it
        assert not holding(after, best[0] + east, best[1])
    assert after.prior is not None
    assert all(np.hypot(*(zone.best.enu_m - best)[:2]) > 1 for zone in after.prior.zones)
    for second in range(2, 9):
        after = pipeline.process(window(ground(), second))
    assert not holding(after, best[0], best[1])


def test_returns_on_the_surveyed_ground_contradict_nothing_whatever_the_datum() -> None:
    far = ground(100.0, 40_000)
    _, reports = flown(ground(), far, far + np.array([0, 0, 0.2]))
    assert reports[-1].prior is not None
    assert (
        sum(zone.n_safe for zone in reports[-1].prior.zones)
        > 0.9 * sum(zone.n_safe for zone in reports[0].prior.zones if reports[0].prior) - 60 * 60
    )


def test_a_survey_of_other_ground_is_given_up_where_it_was_hit() -> None:
    rng = np.random.default_rng(4)
    wrong = replace(surveyed(), height_m=rng.uniform(0, 30, (CELLS, CELLS)).astype(np.float32))
    sparse = ground(90.0, 4_000)  # live maps know nothing there
    _, (as_surveyed,) = flown(sparse)
    _, (report,) = flown(sparse, survey=wrong)
    assert as_surveyed.prior is not None
    assert report.prior is not None
    within = [sum(holding(r, x, 60.0) != [] for x in range(-80, 10)) for r in (as_surveyed, report)]
    assert within[0] > 80
    assert within[1] < 0.4 * within[0]  # returns hit one cell in eight, and spoil the footprints about it


def test_the_live_maps_are_the_same_with_a_survey_and_without() -> None:
    views = [ground(seed=k) for k in range(3)]
    _, reports = flown(*views)
    alone = Pipeline(PARAMETERS)
    for report, points, second in zip(reports, views, range(3), strict=True):
        own = alone.process(window(points, second))
        for mine, theirs in ((report.near, own.near), (report.far, own.far)):
            assert [(z.id, z.area_m2, z.certainty) for z in mine.zones] == [
                (z.id, z.area_m2, z.certainty) for z in theirs.zones
            ]


def test_without_ground_there_is_no_prior_and_no_harm() -> None:
    pipeline = Pipeline(PARAMETERS, prior=lambda _frame, _place: None)
    assert pipeline.process(window(ground(), 0)).prior is None


def followed(east_m: float, north_m: float) -> Surveyed:
    """Return flat ground about a place, which is surveyed from 300 m east on."""
    grid = Grid(round(east_m) - 64.0, round(north_m) - 64.0, 1.0, 128, 128)
    state = np.full((128, 128), UNKNOWN, np.uint8)
    state[:, max(0, round(300 - grid.west_m)) :] = SAFE
    flat = np.zeros((128, 128), np.float32)
    return Surveyed(grid, state, flat, flat)


def test_a_flight_that_begins_off_the_survey_knows_it_when_it_comes_there() -> None:
    asked: list[float] = []

    def source(_frame: LocalFrame, place: Points) -> Surveyed | None:
        asked.append(float(place[0]))
        return followed(*place[:2].tolist()) if place[0] > 240 else None

    prior = Prior(source, PARAMETERS)
    for second, east in enumerate(range(0, 401, 20)):
        prior.update(np.empty((0, 3)), np.array([east, 0.0, 30.0]), FRAME, float(second), ())
    assert asked[:4] == [0, 100, 200, 300]  # not with every window
    assert prior.zones


def test_contradicted_ground_stays_out_when_the_flight_comes_back_to_it() -> None:
    prior = Prior(lambda _frame, place: followed(*place[:2].tolist()), PARAMETERS)
    flat = ground() + np.array([400.0, 0, 0])
    wall = flat.copy()
    wall[np.hypot(flat[:, 0] - 400, flat[:, 1]) < 3, 2] = 5.0
    for second, (east, points) in enumerate(
        [(400, flat), (400, wall), (600, flat[:0]), (700, flat[:0]), (400, flat)]
    ):
        prior.update(points, np.array([east, 0.0, 30.0]), FRAME, 10.0 * second, ())
        held = (
            [zone for zone in prior.zones if zone.holds(*prior.terrain.grid.index(400.0, 0.0))]
            if prior.terrain
            else []
        )
        assert bool(held) == (second == 0)
    assert prior.zones


def level_survey(_frame: LocalFrame, place: Points) -> Surveyed:
    """Return level ground about a place."""
    grid = Grid(round(float(place[0])) - 128.0, round(float(place[1])) - 128.0, 1.0, CELLS, CELLS)
    flat = np.zeros((CELLS, CELLS), np.float32)
    return Surveyed(grid, np.full((CELLS, CELLS), SAFE, np.uint8), flat, flat)


def over(east_m: float, up_m: float, second: float, frame: LocalFrame = FRAME, sensor: bool = True) -> Window:
    """Return a window over level ground, which a drifting barometer shows so high."""
    points = ground(seed=round(second)) + np.array([east_m, 0.0, up_m])
    place = np.array([east_m if sensor else np.nan, 0.0, 30.0 + up_m])
    return replace(window(points, second), sensor_enu_m=place, frame=frame)


def test_the_survey_s_heights_follow_the_drift_of_the_live_maps() -> None:
    """It is looked at every 5 s, in which the barometer drifts 0.5 m."""
    pipeline = Pipeline(PARAMETERS, prior=level_survey)
    for second in range(24):
        report = pipeline.process(over(0.0, 0.1 * second, second))
    assert report.prior is not None
    for zone in (*report.near.zones[:1], *report.prior.zones):
        assert zone.best.enu_m[2] == pytest.approx(2.3, abs=0.5)
        assert zone.corners_enu_m[:, 2].mean() == pytest.approx(2.3, abs=0.5)


def test_a_clock_that_steps_back_does_not_keep_the_survey_over_what_live_maps_know() -> None:
    pipeline = Pipeline(PARAMETERS, prior=level_survey)
    pipeline.process(over(0.0, 0.0, 5000))
    for second in range(8):
        report = pipeline.process(over(4.0 * second, 0.0, 1000 + second))
    assert not holding(report, 16.0, 5.0)


def test_zones_of_a_survey_in_another_frame_are_others() -> None:
    pipeline = Pipeline(PARAMETERS, prior=level_survey)
    first = pipeline.process(over(0.0, 0.0, 0))
    second = pipeline.process(over(0.0, 0.0, 1, frame=LocalFrame(10.0, 20.0, 0.0)))
    assert first.prior is not None
    assert second.prior is not None
    ids = [{zone.id for zone in report.prior.zones} for report in (first, second) if report.prior]
    assert ids[0]
    assert ids[1]
    assert not ids[0] & ids[1]


def test_a_window_without_the_sensor_s_place_asks_for_no_other_ground() -> None:
    asked = []

    def source(frame: LocalFrame, place: Points) -> Surveyed:
        asked.append(float(place[0]))
        return level_survey(frame, place)

    pipeline = Pipeline(PARAMETERS, prior=source)
    for second, sensor in enumerate((True, False, True)):
        report = pipeline.process(over(5000.0, 0.0, second, sensor=sensor))
    assert asked == [5000.0]
    assert report.prior is not None
    assert report.prior.grid.west_m == 5000.0 - 128.0


def test_a_best_point_that_a_live_map_finds_unsafe_is_given_up_before_the_next_look() -> None:
    """Boxes stand on ground the survey knows nothing against, too little of it to contradict the survey."""
    pipeline = Pipeline(PARAMETERS, prior=level_survey)
    before = pipeline.process(over(0.0, 0.0, 0))
    assert before.prior is not None
    best = before.prior.zones[0].best.enu_m
    prior = pipeline.method.prior
    assert prior is not None
    assert prior.terrain is not None
    unsafe = replace(
        level_survey(FRAME, best), state=np.full((CELLS, CELLS), UNSAFE, np.uint8)
    )  # what a live map would say about the best point
    live = PriorTerrain(unsafe)
    hidden = np.zeros((CELLS, CELLS), bool)
    prior.update(np.empty((0, 3)), np.array([0.0, 0.0, 30.0]), FRAME, 0.5, (live,))
    assert not np.array_equal(prior.terrain.hidden, hidden)
    assert not any(zone.holds(*prior.terrain.grid.index(*best[:2].tolist())) for zone in prior.zones)


def test_a_new_map_asks_for_the_survey_again_and_its_zones_get_new_numbers() -> None:
    asked: list[LocalFrame] = []

    def source(frame: LocalFrame, _place: Points) -> Surveyed:
        asked.append(frame)
        return surveyed()

    pipeline = Pipeline(PARAMETERS, prior=source)
    before = pipeline.process(window(ground(), 0))
    pipeline.begin_new_map()
    after = pipeline.process(window(ground(), 1))
    assert len(asked) == 2
    assert before.frame == after.frame == FRAME
    assert before.prior is not None
    assert after.prior is not None
    numbers = {zone.id for zone in before.prior.zones}
    assert len(after.prior.zones) == len(numbers) == 4
    assert min(zone.id for zone in after.prior.zones) > max(numbers)
