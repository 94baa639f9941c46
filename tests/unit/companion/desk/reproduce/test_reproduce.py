"""Figures of a survey against a hand-made truth, and the page of the reproduction."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

import params
from companion.desk import reproduce
from companion.desk.evaluation import room_to_land
from companion.desk.reproduce import (
    instrument_data,
    landing_points,
    near_far,
    places,
    reliability,
    reproduction_page,
    run,
    source_scenes,
    square_filter,
    window_timing,
    zone_identities,
)
from companion.desk.reproduce.inclined_planes import SlopeError, slope_errors
from companion.desk.reproduce.places import Place, TrueSurroundings
from companion.desk.reproduce.scenarios import BY_SCENE, MODES, Scenario
from companion.desk.reproduce.source_scenes import run as run_case
from companion.desk.reproduce.survey_recording import FRAME, SurveyFlight, SurveyRecording, fly
from companion.desk.reproduce.truth_comparison import compare
from companion.runtime.errors import CompanionError, UsageError
from slz import Box, Grid, Obstacle, Pipeline, PointState, Surroundings, TerrainMaps, zone_mask
from slz.landing_point.judgement import unknown
from slz.terrain.layers import NAMED

SIDE_M = 30.0


def survey(**more: object) -> SurveyFlight:
    return SurveyFlight("plain", (0.0, 0.0, SIDE_M, SIDE_M), cell_m=0.5, **more)  # type: ignore[arg-type]


def recording(wall: bool) -> SurveyRecording:
    """Plane ground, flown over in one second; the wall from x = 20 on is in the truth, and seen or not.

    It slopes by a degree: level ground that is seen from above alone may be water.
    """
    rng = np.random.default_rng(1)
    points = rng.uniform(0, SIDE_M, (60_000, 3)).astype(np.float32)
    points[:, 2] = 0.02 * points[:, 0] + rng.normal(0, 0.02, len(points))
    if wall:
        points[points[:, 0] > 20, 2] += rng.uniform(0, 4, (points[:, 0] > 20).sum()).astype(np.float32)
    n = round(SIDE_M / 0.5)
    safe = np.ones((n, n), np.uint8)
    safe[:, 38:] = 0
    flat = np.zeros((n, n), np.float32)
    count = np.full(10, len(points) // 10)
    stamps = np.sort(rng.integers(0, 10**9, len(points)))
    sensor = np.tile([15.0, 15.0, 20.0], (10, 1))
    return SurveyRecording(
        survey(), points, stamps, sensor, count, safe, flat, flat, flat, {}, "made by hand"
    )


def scores(one: SurveyRecording) -> object:
    parameters = params.load("quadcopter", ["zone_m=60", "max_range_m=100", "angle_noise_deg=0"])
    pipeline = Pipeline(parameters, (15.0, 15.0))
    reports = [pipeline.process(window) for window in one.windows()]
    maps = pipeline.maps()
    assert maps is not None
    return compare(one, maps, reports[-1].zones, parameters)


def test_a_wall_that_is_seen_leaves_nothing_false() -> None:
    found = scores(recording(wall=True))
    assert found.false_safe_cells == 0  # type: ignore[attr-defined]
    assert found.area_error < 0.1  # type: ignore[attr-defined]
    assert found.recall > 0.9  # type: ignore[attr-defined]


def test_a_wall_that_is_not_seen_shows_as_false_safe_and_in_the_area() -> None:
    found = scores(recording(wall=False))
    share = 8 / 24  # x from 19 to 27 of 3 to 27
    assert found.false_safe == pytest.approx(share, abs=0.01)  # type: ignore[attr-defined]
    assert found.area_error == pytest.approx(share, abs=0.02)  # type: ignore[attr-defined]


def test_only_patches_with_the_safe_square_count_as_truth() -> None:
    safe = np.zeros((40, 40), bool)
    safe[2:20, 2:20] = True
    safe[25:30, 2:38] = True
    parameters = params.load("quadcopter", ["min_square_m=3"])
    kept = room_to_land(safe, Grid(0, 0, 0.5, 40, 40), parameters)
    assert kept[10, 10]
    assert not kept[27].any()


@pytest.mark.parametrize(("row", "col"), [(-2, -1), (3, 4), (20, 0), (0, -20), (1, 1)])
def test_of_a_zone_that_leaves_the_box_only_the_cells_within_count(row: int, col: int) -> None:
    cells = np.triu(np.ones((4, 4), np.uint8))
    zone = SimpleNamespace(box=Box(row, row + 4, col, col + 4), cells=cells)
    found = zone_mask((zone,), Box(1, 6, 2, 7))  # type: ignore[arg-type]
    for r in range(1, 6):
        for c in range(2, 7):
            within = row <= r < row + 4 and col <= c < col + 4
            assert found[r - 1, c - 2] == (within and cells[r - row, c - col] == 1)


def test_windows_hold_one_second_and_every_return() -> None:
    one = recording(wall=False)
    assert sum(len(window) for window in one.windows()) == len(one.points_enu_m)


def test_the_simulator_s_refusal_is_told(tmp_path: Path) -> None:
    with pytest.raises(CompanionError, match=r"could not fly nowhere: .*unknown"):
        fly(SurveyFlight("nowhere", (0.0, 0.0, 1.0, 1.0)), tmp_path)


def test_a_survey_is_flown_once_and_read_again(tmp_path: Path) -> None:
    plan = survey(point_rate_hz=10_000, speed_ms=20.0)
    first, again = fly(plan, tmp_path), fly(plan, tmp_path)
    np.testing.assert_array_equal(first.points_enu_m, again.points_enu_m)
    assert len(list(tmp_path.iterdir())) == 1
    assert first.safe.shape == (60, 60)


def test_the_plane_fit_beats_the_gradient_on_noisy_planes() -> None:
    for error in slope_errors():
        assert error.plane_rms_deg <= 0.35
        assert error.gradient_rms_deg > 3.0
        assert error.plane_share > 0.99


def test_the_page_holds_every_figure(tmp_path: Path) -> None:
    table = reproduction_page.slope_table([SlopeError(5.0, 3.39, 0.05, 0.21, 1.0)])
    markdown, html = reproduction_page.write(
        tmp_path, [reproduction_page.Section([table], [("a < b", [tmp_path / "a" / "safe.png"])], {})]
    )
    for text in (markdown.read_text("utf-8"), html.read_text("utf-8")):
        assert all(word in text for word in ("3.39", "0.21", "a/safe.png"))
    assert "a &lt; b" in html.read_text("utf-8")


def test_an_unknown_case_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--only 'x9': there are 1 stadium"):
        run(tmp_path, lambda what, done: None, "x9")


@pytest.fixture(scope="module")
def small() -> Scenario:
    """Return a field of the plain, large enough for one square of 24 m."""
    plan = SurveyFlight("plain", (-20.0, -20.0, 20.0, 20.0), speed_ms=20.0, point_rate_hz=20_000, cell_m=1.0)
    return Scenario("field", plan, ("min_boundary_points=40", "zone_m=200"))


@pytest.fixture(scope="module")
def surveys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("surveys")


@pytest.fixture
def blank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave empty files where maps would be drawn, which takes a second each."""

    def maps(folder: Path, *_: object) -> list[Path]:
        folder.mkdir(parents=True, exist_ok=True)
        return [terrain(folder / f"{layer}.png") for layer in ("dsm", "slope", "safe")]

    def terrain(path: Path, *_: object, **more: object) -> Path:
        path.touch()
        return path

    monkeypatch.setattr(square_filter, "save_maps", maps)
    monkeypatch.setattr(square_filter, "save_terrain", terrain)
    monkeypatch.setattr(zone_identities, "save_terrain", terrain)


@pytest.mark.usefixtures("blank")
def test_room_to_land_is_a_row_for_each_mode_and_four_pictures(
    small: Scenario, surveys: Path, tmp_path: Path
) -> None:
    told: list[str] = []
    found = square_filter.section([small], tmp_path, surveys, told.append)
    assert told == ["field, source mode", "field, default mode"]
    assert [row[0] for row in found.tables[0].rows] == told
    counts = found.figures["zones_without_and_with"].values()
    for (_, files), (without, with_it) in zip(found.pictures, counts, strict=True):
        assert [file.stem for file in files] == ["dsm", "slope", "safe_without_filter", "safe"]
        assert all(file.exists() for file in files)
        assert without >= with_it >= 1


@pytest.mark.usefixtures("blank")
def test_identities_count_fewer_numbers_with_reuse(small: Scenario, surveys: Path, tmp_path: Path) -> None:
    found = zone_identities.section([small], tmp_path, surveys, lambda what: None)
    without, source, default = found.figures["ids"]["field"]
    assert without >= source >= default == 1
    assert found.tables[0].rows[0][2:] == (str(without), str(source), str(default))
    assert all(file.exists() for _, files in found.pictures for file in files)


def test_timing_has_every_case_beside_the_paper_s_limit(
    small: Scenario, surveys: Path, tmp_path: Path
) -> None:
    outcome, _ = run_case(small.case("default"), surveys)
    found = window_timing.section([outcome], tmp_path)
    (row,) = found.tables[0].rows
    assert row[0] == "field, default mode"
    assert row[-1] == "< 600"
    assert outcome.ms_median <= outcome.ms_p99 <= outcome.ms_max
    assert found.pictures[0][1][0].exists()


@pytest.mark.parametrize("mode", MODES)
def test_scenarios_fly_with_the_helicopter_s_profile_and_its_square(mode: str) -> None:
    case = BY_SCENE["hill"].case(mode)
    own = params.load(case.profile, case.settings)
    assert (own.mode, own.cell_m, own.min_square_m) == (mode, 10.0, 24.0)
    free = params.load(case.profile, BY_SCENE["hill"].case(mode, room=False).settings)
    assert free.min_square_m == 10.0


# ---- landing points -------------------------------------------------------------------------------


def around_a_block() -> TrueSurroundings:
    """Return the truth about (15.25, 15.25): a block of 2 x 4 m, 3 m high, whose near edge is 5 m east."""
    one = recording(wall=False)
    height = np.zeros((60, 60), np.float32)
    height[27:35, 40:44] = 3.0  # x from 20 to 22, y from 13.5 to 17.5
    regions = {"the_block": np.array([(20.0, 13.5), (22.0, 13.5), (22.0, 17.5), (20.0, 17.5)])}
    return TrueSurroundings(replace(one, height_m=height, regions=regions), 15.25, 15.25, 12.0)


def surroundings(*extents: tuple[float, float, float, float]) -> Surroundings:
    def obstacle(west: float, south: float, east: float, north: float) -> Obstacle:
        own = np.meshgrid(np.arange(west + 0.25, east, 0.5), np.arange(south + 0.25, north, 0.5))
        cells = np.column_stack([axis.ravel() for axis in own])
        return Obstacle((west + east) / 2, (south + north) / 2, 3.1, 3.1, cells, 0.5)

    listed = tuple(obstacle(*extent) for extent in extents)
    return Surroundings(12.0, listed, np.zeros(36))


def test_the_truth_around_a_point_is_a_block_and_its_horizon() -> None:
    truth = around_a_block()
    (block,) = truth.standing()
    assert block.extent_m == pytest.approx((20.0, 13.5, 22.0, 17.5))
    assert (block.height_m, block.area_m2, block.where) == (3.0, 8.0, "the block")
    assert truth.highest_m("the_block") == 3.0
    horizon = truth.horizon_deg(1.0)
    assert horizon[9] == pytest.approx(np.degrees(np.arctan2(3.0, 5.0)))
    raised = np.flatnonzero(horizon > 1).tolist()
    assert raised == [7, 8, 9, 10, 11]
    assert set(np.flatnonzero(truth.horizon_deg(1.0, 3.0) > 1).tolist()) >= set(raised)


def test_what_was_found_is_set_beside_the_block() -> None:
    truth = around_a_block()
    (pair,) = truth.pairs(surroundings((5.0, 5.0, 6.0, 6.0), (19.8, 13.5, 22.0, 17.0)))
    assert pair.found is not None
    assert pair.edge_error_m == pytest.approx(0.5)
    assert pair.height_error_m == pytest.approx(0.1)
    assert truth.phantoms(surroundings((5.0, 5.0, 6.0, 6.0), (19.0, 13.5, 19.8, 17.0)), 0.5) == 1
    (missed,) = truth.pairs(surroundings())
    assert missed.found is None
    assert missed.edge_error_m == np.inf


def test_a_landing_point_has_its_rows_and_two_pictures_in_each_mode(
    small: Scenario, surveys: Path, tmp_path: Path
) -> None:
    told: list[str] = []
    place = Place("field", small.survey, (0.0, 0.0), ("cell_m=1", "footprint_m=3", "coverage_m=3"))
    found = landing_points.section([place], tmp_path, surveys, told.append)
    assert told == ["field, source mode", "field, default mode"]
    obstacles, horizons = found.tables
    assert [row[:2] for row in obstacles.rows] == [(name, "none") for name in told]
    assert [row[0] for row in horizons.rows] == told
    assert horizons.rows[1][1] == "safe"
    assert [file.name for _, files in found.pictures for file in files] == 2 * ["around.png", "horizon.png"]
    assert all(file.exists() for _, files in found.pictures for file in files)


# ---- certainty ------------------------------------------------------------------------------------


def test_bins_count_certainties_beside_the_truth() -> None:
    certainty = np.array([0.0, 0.005, 0.3, 0.35, 0.99, 0.9995, 1.0], np.float32)
    true = np.array([0, 0, 0, 1, 1, 0, 1], bool)
    bins = reliability.Bins.of(certainty, true, certainty > 0.9)
    assert bins.cells.tolist() == [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 2][-15:]
    assert bins.called.sum() == 3
    assert bins.wrong.tolist() == [*14 * [0], 1]
    assert bins.share[5] == 0.5
    both = bins + bins
    assert both.cells.sum() == 14
    assert both.error == pytest.approx(bins.error)
    assert bins.error == pytest.approx((0.005 + abs(0.65 - 1) + 0.01 + 0.9995) / 7, abs=1e-6)


def test_only_known_cells_within_the_margin_count(tmp_path: Path) -> None:
    one = recording(wall=True)
    parameters = params.load("quadcopter", ["zone_m=60", "max_range_m=100", "angle_noise_deg=0"])
    pipeline = Pipeline(parameters, (15.0, 15.0))
    for window in one.windows():
        pipeline.process(window)
    maps = pipeline.maps()
    assert maps is not None
    counted = reliability.count(one, maps)
    most = ((SIDE_M - 6) / parameters.cell_m) ** 2
    assert 0.6 * most < counted.cells.sum() <= 1.01 * most
    found = reliability.section({"by hand": counted}, tmp_path)
    assert len(found.tables[0].rows) == len(reliability.EDGES) - 1
    assert found.figures["certainty"]["by_survey"]["by hand"] == round(counted.error, 5)
    assert found.pictures[0][1][0].exists()


# ---- near and far ---------------------------------------------------------------------------------


def test_a_climb_is_told_as_near_and_far_windows(tmp_path: Path) -> None:
    plan = survey(point_rate_hz=10_000, speed_ms=10.0, spacing_m=10.0, height_m=12.0, climb_m=50.0)
    climb = near_far.Climb("a climb", plan, ("cell_m=1", "footprint_m=3", "coverage_m=3"))
    told: list[str] = []
    found = near_far.section([climb], tmp_path, tmp_path / "surveys", told.append)
    assert told == ["a climb, source mode", "a climb, default mode"]
    assert [row[:2] for row in found.tables[0].rows] == [(name, m) for name in told for m in ("near", "far")]
    for name in told:
        figures = found.figures["near_and_far"][name]
        assert 0 < figures["windows_far"] < figures["windows"]
        assert figures["changes"] == 1
    assert all(file.exists() for _, files in found.pictures for file in files)


def test_only_a_climb_changes_a_survey_s_name() -> None:
    assert not any("climb" in option for option in survey().options())
    assert "--climb=50" in survey(climb_m=50.0).options()


# ---- the whole -------------------------------------------------------------------------------------


def test_a_run_tells_of_every_case_and_the_certainty_of_default_mode_only(
    small: Scenario, surveys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[tuple[str, float]] = []
    judged: list[str] = []

    def certainty(counted: Mapping[str, reliability.Bins], _out: Path) -> reproduction_page.Section:
        judged.extend(counted)
        return reproduction_page.Section([], [], {})

    (tmp_path / "surveys").symlink_to(surveys)
    monkeypatch.setattr(reproduce, "CASES", (small.case("source"), small.case("default")))
    monkeypatch.setattr(reproduce, "save_maps", lambda folder, *_: [folder / "safe.png"])
    monkeypatch.setattr(reproduce, "slope_errors", lambda: [SlopeError(5.0, 3.39, 0.05, 0.21, 1.0)])
    monkeypatch.setattr(reliability, "section", certainty)
    found = run(tmp_path, lambda what, share: told.append((what, share)), "field, ")
    names = ["field, source mode", "field, default mode"]
    assert [what for what, _ in told] == [*names, "planes", "done"]
    assert [share for _, share in told] == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert list(found["scenes"]) == names
    assert all(scene["zones"] >= 1 for scene in found["scenes"].values())
    assert found["slope_rms_deg"] == {"5": [3.39, 0.21]}
    assert judged == ["field, default mode"]
    assert [Path(file).name for file in found["files"]] == ["index.md", "index.html"]
    text = Path(found["files"][0]).read_text("utf-8")
    assert all(name in text for name in (*names, "field_source_mode/safe.png", "time_per_window.png"))


def test_an_instrument_alone_is_run_from_what_was_recorded_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []

    def section(data: dict[str, np.ndarray], out: Path) -> reproduction_page.Section:
        return reproduction_page.Section([], [], {"radar": [*data["truth_m"].tolist(), out.name]})

    (tmp_path / "surveys").mkdir()
    np.savez(tmp_path / "surveys" / f"radar_seed{instrument_data.SEED}.npz", truth_m=np.arange(3.0))
    monkeypatch.setattr("companion.desk.reproduce.radar_section.section", section)
    found = run(tmp_path, lambda what, _share: told.append(what), "radar")
    assert found["radar"] == [0.0, 1.0, 2.0, "radar"]
    assert told == ["radar", "done"]
    assert "scenes" not in found


@pytest.mark.parametrize(("said", "why"), [("a\nno room\n", "no room"), ("", "no reason given")])
def test_why_an_instrument_could_not_be_recorded_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str, why: str
) -> None:
    def fail(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(command, 3, "", said)

    monkeypatch.setattr(instrument_data, "subprocess", SimpleNamespace(run=fail))
    with pytest.raises(CompanionError, match=f"could not record the flash: {why}"):
        run(tmp_path, lambda _what, _share: None, "flash")
    assert list((tmp_path / "surveys").iterdir()) == []


# ---- what is not there -----------------------------------------------------------------------------


def silent() -> SurveyRecording:
    """Return a survey that no return came back in."""
    return replace(recording(wall=False), count=np.zeros(10, np.int64))


def test_a_second_without_a_return_is_no_window() -> None:
    one = recording(wall=False)
    count = np.concatenate([np.zeros(10, np.int64), one.count, np.zeros(10, np.int64)])
    longer = replace(one, count=count, sensor_enu_m=np.tile(one.sensor_enu_m, (3, 1)))
    assert [len(window) for window in longer.windows()] == [len(one.points_enu_m)]


NOTHING: dict[ModuleType, Callable[[Path], object]] = {
    source_scenes: lambda out: run_case(source_scenes.Case("the field", survey(), 1.0), out),
    near_far: lambda out: near_far.section(
        [near_far.Climb("the field", survey())], out, out, lambda _what: None
    ),
    places: lambda out: places.watch(Place("the field", survey(), (15.0, 15.0)), "default", out),
}


@pytest.mark.parametrize("module", NOTHING)
def test_a_survey_in_which_nothing_was_seen_is_said_to_be_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, module: ModuleType
) -> None:
    monkeypatch.setattr(module, "fly", lambda *_: silent())
    with pytest.raises(RuntimeError, match=r"the field.*: nothing was seen"):
        NOTHING[module](tmp_path)


def watched(around: Surroundings | None) -> places.ObservedPoint:
    """Return a point at 15, 15 of a plain, near the block, and what was found around it."""
    blank = np.zeros((60, 60), np.float32)
    grid, box = Grid(0.0, 0.0, 0.5, 60, 60), Box(0, 60, 0, 60)
    maps = TerrainMaps(FRAME, grid, box, dict.fromkeys(NAMED, blank), np.ones((60, 60), np.uint8))
    point = replace(unknown(np.array([15.0, 15.0, 0.0])), state=PointState.SAFE, surroundings=around)
    place = Place("field", survey(), (15.0, 15.0))
    return places.ObservedPoint(place, "default", point, around_a_block(), maps, params.load())


def test_a_point_around_which_nothing_is_known_has_no_obstacles_to_compare() -> None:
    with pytest.raises(RuntimeError, match="field: nothing is known around the point"):
        _ = watched(None).surroundings


def test_obstacles_around_a_landing_point_stand_beside_the_truth_and_wide_ones_have_their_height(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels: list[str] = []
    annotate = Axes.annotate

    def noted(axes: Axes, text: str, *given: Any, **more: Any) -> Any:
        labels.append(text)
        return annotate(axes, text, *given, **more)

    made = watched(surroundings((5.0, 5.0, 6.0, 6.0), (19.8, 13.5, 22.0, 17.0)))  # 1 m and 2.6 m wide
    monkeypatch.setattr(Axes, "annotate", noted)
    monkeypatch.setattr(landing_points, "MODES", ("default",))
    monkeypatch.setattr(landing_points, "fly", lambda *_: None)
    monkeypatch.setattr(landing_points, "watch", lambda *_: made)
    found = landing_points.section([made.place], tmp_path, tmp_path, lambda _what: None)
    name = "field, default mode"
    obstacles, horizons = found.tables
    edges = "4.8 to 6.8, -1.5 to 2.0", "5.0 to 7.0, -1.5 to 2.5"
    assert obstacles.rows == [(name, "the block", *edges, "3.10", "3.00")]
    assert [row[:4] for row in horizons.rows] == [(name, "safe", "2", "1")]
    figures = found.figures["landing_points"][name]
    assert (figures["missed"], figures["worst_edge_m"], figures["worst_height_m"]) == (0, 0.5, 0.1)
    assert labels == ["3.1 m"]


def test_beyond_the_survey_s_edge_the_true_horizon_is_unknown() -> None:
    horizon = TrueSurroundings(recording(wall=False), 0.25, 15.25, 5.0).horizon_deg(1.0)
    assert np.isnan(horizon[27])  # west
    assert horizon[[0, 9, 18]].tolist() == [0, 0, 0]


def test_without_a_known_cell_there_is_no_calibration_error() -> None:
    none = np.zeros(0, bool)
    assert np.isnan(reliability.Bins.of(np.zeros(0, np.float32), none, none).error)


@pytest.mark.usefixtures("blank")
def test_where_no_zone_is_left_none_is_the_largest(
    small: Scenario, surveys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(square_filter, "MODES", ("default",))
    barren = replace(small, settings=("min_boundary_points=100000", "zone_m=200"))
    found = square_filter.section([barren], tmp_path, surveys, lambda _what: None)
    assert found.tables[0].rows == [("field, default mode", "0", "0", "0", "0", "none")]


def test_a_flight_that_stays_low_has_no_row_of_far_windows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(near_far, "MODES", ("default",))
    monkeypatch.setattr(near_far, "fly", lambda *_: recording(wall=False))
    found = near_far.section([near_far.Climb("low", survey())], tmp_path, tmp_path, lambda _what: None)
    assert [row[:3] for row in found.tables[0].rows] == [("low, default mode", "near", "1")]
    assert found.figures["near_and_far"]["low, default mode"]["windows_far"] == 0
