"""Figures of a survey against its truth, on a truth made by hand, and the page they end in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import params
from companion.errors import CompanionError, UsageError
from companion.evaluation import room_to_land
from companion.reproduce import page, run
from companion.reproduce.measure import compare
from companion.reproduce.planes import SlopeError, slope_errors
from companion.reproduce.recording import Recording, Survey, fly
from slz import Grid, Pipeline

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
    return Recording(survey(), points, stamps, sensor, count, safe, flat, flat, {}, "made by hand")


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
    markdown, html = page.write(tmp_path, [table], [("a < b", [tmp_path / "a" / "safe.png"])])
    for text in (markdown.read_text("utf-8"), html.read_text("utf-8")):
        assert all(word in text for word in ("3.39", "0.21", "a/safe.png"))
    assert "a &lt; b" in html.read_text("utf-8")


def test_an_unknown_case_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--only 'x9': there are 1 stadium"):
        run(tmp_path, lambda what, done: None, "x9")
