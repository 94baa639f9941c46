"""Invariants of a report, each violated once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from companion.flight.mapping.report_invariants import BrokenInvariantError, Invariants
from slz import SAFE, UNKNOWN, UNSAFE, Pipeline, PointState, Report, SelectedPoint
from slz.grid import Box
from tests.unit.slz.hand_made import flat, returns, window

S = 1_000_000_000


class Verdicts:
    """A map of one state."""

    def __init__(self, state: int = SAFE) -> None:
        self._state = state

    def state(self, which: str, box: Box) -> NDArray[np.uint8]:
        return np.full(box.shape, self._state, np.uint8)


@pytest.fixture(scope="module")
def report() -> Report:
    """A report with one zone in each map."""
    p = params.load("quadcopter", ["zone_m=60", "min_boundary_points=10"])
    ground = returns(flat(160, 160), 0.15, -12.0, -12.0)
    found = Pipeline(p, (0.0, 0.0)).process(window(ground, 0.0, (0.0, 0.0, 10.0)))
    assert found.near.zones
    assert found.far.zones
    return replace(found, stamp_ns=100 * S)


def check(report: Report, state: int = SAFE, now_ns: int = 100 * S) -> None:
    Invariants().check(report, Verdicts(state), now_ns)


def with_zone(report: Report, **changes: Any) -> Report:
    zone = replace(report.near.zones[0], **changes)
    return replace(report, near=replace(report.near, zones=(zone,)))


def test_a_sound_report_passes(report: Report) -> None:
    check(report)


@pytest.mark.parametrize("state", [UNSAFE, UNKNOWN])
def test_no_zone_lies_over_what_is_not_safe(report: Report, state: int) -> None:
    with pytest.raises(BrokenInvariantError, match="are not safe in the near map"):
        check(report, state)


def test_a_landing_point_lies_in_its_zone(report: Report) -> None:
    best = report.near.zones[0].best
    away = replace(best, enu_m=best.enu_m + np.array([100.0, 0.0, 0.0]))
    with pytest.raises(BrokenInvariantError, match="lies outside"):
        check(with_zone(report, best=away))


@pytest.mark.parametrize("changes", [{"certainty": 1.1}, {"certainty": float("nan")}, {"area_m2": 0.0}])
def test_numbers_are_such_as_can_be(report: Report, changes: dict[str, float]) -> None:
    with pytest.raises(BrokenInvariantError, match="numbers that cannot be"):
        check(with_zone(report, **changes))


def test_a_number_belongs_to_one_zone(report: Report) -> None:
    with pytest.raises(BrokenInvariantError, match="is there 2 times"):
        check(with_zone(report, id=report.far.zones[0].id))


@pytest.mark.parametrize(
    ("now_s", "words"), [(103.5, "late"), (99.5, "ahead of time"), (102.5, None), (100.0, None)]
)
def test_a_report_is_of_now(report: Report, now_s: float, words: str | None) -> None:
    if words is None:
        check(report, now_ns=round(now_s * S))
        return
    with pytest.raises(BrokenInvariantError, match=words):
        check(report, now_ns=round(now_s * S))


def test_time_goes_on(report: Report) -> None:
    invariants = Invariants()
    invariants.check(report, Verdicts(), 100 * S)
    with pytest.raises(BrokenInvariantError, match="before that of the last"):
        invariants.check(report, Verdicts(), 100 * S)
    invariants.check(replace(report, stamp_ns=100 * S + 1), Verdicts(), 100 * S)


def test_a_point_is_safe_by_a_map(report: Report) -> None:
    nan = float("nan")
    point = SelectedPoint(np.zeros(3), PointState.SAFE, "none", 0.0, nan, nan, nan, None, None)
    with pytest.raises(BrokenInvariantError, match="safe in no map"):
        check(replace(report, selected=point))
