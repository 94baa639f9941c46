"""Methods of the benchmark: what each must and must not call safe."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.desk.open_benchmark.landing_task import (
    SAFE,
    UNKNOWN,
    CellGrid,
    FlownReturns,
    LandingMethod,
    LandingTask,
)
from companion.desk.open_benchmark.methods import METHODS, REFERENCE, method_of_file
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.open_benchmark.flights_over import SMALL, flight

MIDDLE = np.s_[15:35, 15:35]  # their surroundings are seen, too
every_method = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)


def copied(returns: FlownReturns) -> list[np.ndarray]:
    return [returns.points_m.copy(), returns.stamp_s.copy(), returns.window.copy(), returns.sensors_m.copy()]


@every_method
def test_level_ground_is_safe_and_the_input_is_kept(method: LandingMethod) -> None:
    returns = flight(lambda x, y: 0 * x)
    before = copied(returns)
    answer = method.judge(returns, SMALL)
    assert (answer.state[MIDDLE] == SAFE).mean() > 0.9
    if answer.probability is not None:
        assert np.nanmin(answer.probability[MIDDLE]) > 0.5
        assert np.array_equal(np.isnan(answer.probability), answer.state == UNKNOWN)
    assert all(np.array_equal(a, b) for a, b in zip(before, copied(returns), strict=True))


@every_method
def test_steep_ground_is_never_safe(method: LandingMethod) -> None:
    answer = method.judge(flight(lambda x, y: np.tan(np.radians(20.0)) * x), SMALL)
    assert not (answer.state == SAFE)[MIDDLE].any()


@every_method
def test_a_block_of_a_metre_is_not_safe(method: LandingMethod) -> None:
    answer = method.judge(flight(lambda x, y: 1.0 * ((abs(x) < 0.6) & (abs(y) < 0.6))), SMALL)
    rim = answer.state[25, [22, 27]]  # footprints across its sides
    assert not (rim == SAFE).any()


@every_method
def test_ground_that_nothing_returned_from_is_not_safe(method: LandingMethod) -> None:
    returns = flight(lambda x, y: 0 * x)
    seen = returns.points_m[:, 0] < 0.0
    west = FlownReturns(
        returns.points_m[seen], returns.stamp_s[seen], returns.window[seen], returns.sensors_m
    )
    assert not (method.judge(west, SMALL).state[:, 35:] == SAFE).any()


def test_a_flight_over_more_than_one_map_is_judged_as_a_whole() -> None:
    returns = flight(lambda x, y: 0.05 * x, half_m=20.0)
    window = np.clip((returns.points_m[:, 0] + 20) // 8, 0, 4).astype(np.int64)
    order = np.argsort(window, kind="stable")
    sensors = np.column_stack([np.linspace(-16, 16, 5), np.zeros(5), np.full(5, 20.0)])
    flown = FlownReturns(returns.points_m[order], np.linspace(0, 4.9, len(order)), window[order], sensors)
    strip = LandingTask(CellGrid(-20.0, -5.0, 0.2, 50, 200))
    state = method_named("slz (this project)").judge(flown, strip).state
    assert (state[:, 10:-10] == SAFE).mean() > 0.9


def method_named(name: str) -> LandingMethod:
    return next(method for method in METHODS if method.name == name)


def test_shares_of_limits_say_what_the_maps_say() -> None:
    returns = flight(lambda x, y: 0.12 * np.maximum(x, 0) + 0.5 * (np.hypot(x + 2, y) < 0.4))
    told = [answer for method in METHODS if (answer := method.judge(returns, SMALL)).limit_share is not None]
    assert len(told) == 3
    for answer in told:
        share = answer.limit_share
        assert share is not None
        assert 0 < (answer.state == SAFE).sum() < SMALL.grid.rows * SMALL.grid.cols
        assert np.array_equal(answer.state == SAFE, share < 1)


def test_the_reference_calls_all_seen_ground_safe() -> None:
    answer = REFERENCE.judge(flight(lambda x, y: 3 * x), SMALL)
    assert (answer.state == SAFE).mean() > 0.99


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (None, "there is no such file"),
        ("1 / 0", "ZeroDivisionError"),
        ("x = 1", "it needs METHOD"),
        ("class M: name = 'm'\nMETHOD = M()", "it needs METHOD"),
    ],
)
def test_unusable_method_files_are_refused(tmp_path: Path, text: str | None, complaint: str) -> None:
    path = tmp_path / "own.py"
    if text is not None:
        path.write_text(text, "utf-8")
    with pytest.raises(UsageError, match=complaint):
        method_of_file(path)
