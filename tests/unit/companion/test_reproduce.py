"""Figures of a survey against its truth, on a truth made by hand, and the page they end in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import params
from companion.errors import CompanionError, UsageError
from companion.evaluation import room_to_land
from companion.reproduce import identities, landing_points, near_far, page, reliability, room, run, timing
from companion.reproduce.around import Around
from companion.reproduce.measure import compare
from companion.reproduce.places import Place
from companion.reproduce.planes import SlopeError, slope_errors
from companion.reproduce.recording import Recording, Survey, fly
from companion.reproduce.scenarios import BY_SCENE, MODES, Scenario
from companion.reproduce.scenes import run as run_case
from slz import Box, Grid, Obstacle, Pipeline, Surroundings, zone_mask

SIDE_M = 30.0


def survey(**more: object) -> Survey:
    return Survey("plain", (0.0, 0.0, SIDE_M, SIDE_M), cell_m=0.5, **more)  # type: ignore[arg-type]


def recording(wall: bool) -> Recording:
    """Flat ground, flown over in one second; the wall from x = 20 on is in the truth, and seen or not."""
    rng = np.random.default_rng(1)
    points = rng.uniform(0, SIDE_M, (60_000, 3)).astype(np.float32)
    points[:, 2] = rng.normal(0, 0.02, len(points))
    if wall:
        points[points[:, 0] > 20, 2] += rng.uniform(0, 4, (points[:, 0] > 20).sum()).astype(np.float32)
    n = round(SIDE_M / 0.5)
    safe = np.ones((n, n), np.uint8)
    safe[:, 38:] = 0
    flat = np.zeros((n, n), np.float32)
    count = np.full(10, len(points) // 10)
    stamps = np.sort(rng.integers(0, 10**9, len(points)))
    sensor = np.tile([15.0, 15.0, 20.0], (10, 1))
    return Recording(survey(), points, stamps, sensor, count, safe, flat, flat, flat, {}, "made by hand")


def scores(one: Recording) -> object:
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
        fly(Survey("nowhere", (0.0, 0.0, 1.0, 1.0)), tmp_path)


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
    table = page.slope_table([SlopeError(5.0, 3.39, 0.05, 0.21, 1.0)])
    markdown, html = page.write(
        tmp_path, [page.Section([table], [("a < b", [tmp_path / "a" / "safe.png"])], {})]
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
    plan = Survey("plain", (-20.0, -20.0, 20.0, 20.0), speed_ms=20.0, point_rate_hz=20_000, cell_m=1.0)
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

    monkeypatch.setattr(room, "save_maps", maps)
    monkeypatch.setattr(room, "save_terrain", terrain)
    monkeypatch.setattr(identities, "save_terrain", terrain)


@pytest.mark.usefixtures("blank")
def test_room_to_land_is_a_row_for_each_mode_and_four_pictures(
    small: Scenario, surveys: Path, tmp_path: Path
) -> None:
    told: list[str] = []
    found = room.section([small], tmp_path, surveys, told.append)
    assert told == ["field, source mode", "field, default mode"]
    assert [row[0] for row in found.tables[0].rows] == told
    counts = found.figures["zones_without_and_with"].values()
    for (_, files), (without, with_it) in zip(found.pictures, counts, strict=True):
        assert [file.stem for file in files] == ["dsm", "slope", "safe_without_filter", "safe"]
        assert all(file.exists() for file in files)
        assert without >= with_it >= 1


@pytest.mark.usefixtures("blank")
def test_identities_count_fewer_numbers_with_reuse(small: Scenario, surveys: Path, tmp_path: Path) -> None:
    found = identities.section([small], tmp_path, surveys, lambda what: None)
    without, source, default = found.figures["ids"]["field"]
    assert without >= source >= default == 1
    assert found.tables[0].rows[0][2:] == (str(without), str(source), str(default))
    assert all(file.exists() for _, files in found.pictures for file in files)


def test_timing_has_every_case_beside_the_paper_s_limit(
    small: Scenario, surveys: Path, tmp_path: Path
) -> None:
    outcome, _ = run_case(small.case("default"), surveys)
    found = timing.section([outcome], tmp_path)
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


def around_a_block() -> Around:
    """Return the truth about (15.25, 15.25): a block of 2 x 4 m, 3 m high, whose near edge is 5 m east."""
    one = recording(wall=False)
    height = np.zeros((60, 60), np.float32)
    height[27:35, 40:44] = 3.0  # x from 20 to 22, y from 13.5 to 17.5
    regions = {"the_block": np.array([(20.0, 13.5), (22.0, 13.5), (22.0, 17.5), (20.0, 17.5)])}
    return Around(replace(one, height_m=height, regions=regions), 15.25, 15.25, 12.0)


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
