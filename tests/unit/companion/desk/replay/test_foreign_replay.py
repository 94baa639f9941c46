"""Windows and maps from poses and returns of another program's recording, and restarts of the map."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from companion.desk.replay.foreign_replay import Rerun
from companion.flight.sensors.returns import Returns
from params import load
from slz import LocalFrame, Pipeline, Scan

SECOND = 1_000_000_000
HOME = LocalFrame(47.4, 8.5, 400.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def rerun() -> Rerun:
    return Rerun(load("quadcopter", ["cell_m=0.5", "zone_m=200"]), HOME)


def scan(second: float) -> Scan:
    """Return half a second of flat ground about the origin, seen from 20 m."""
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-15, 15, (5000, 2)), rng.normal(0, 0.01, 5000)])
    stamps = round(second * SECOND) + np.linspace(0, 0.49 * SECOND, len(points)).astype(np.int64)
    return Scan(points, stamps, np.array([0.0, 0.0, 20.0]), HOME)


def put(one: Rerun, second: float, east_m: float = 0.0) -> None:
    """Let the vehicle stand still in the air at a second."""
    lat, lon, alt = HOME.lla([east_m, 0.0, 20.0]).tolist()
    one.history.add_position(round(second * SECOND), lat, lon, alt, (0.0, 0.0, 0.0))


def placed(one: Rerun, *seconds: float, mapping: bool = True) -> list[bool]:
    """Hand over scans that are placed; return after each whether a report came of it."""
    return [one.hand_over(lambda at=at: one.add_placed(scan(at)), mapping) is not None for at in seconds]  # type: ignore[misc]


def test_a_window_is_mapped_with_its_last_scan_and_what_is_left_at_the_end() -> None:
    one = rerun()
    assert placed(one, 0.0, 0.5, 1.0, 1.5) == [False, True, False, False]
    assert [one.finish() is not None for _ in range(2)] == [True, False]
    assert (one.outcome.windows, one.returns) == (2, 20_000)
    assert one.span_ns == (0, 1_990_000_000)
    assert [place.tolist() for place in one.outcome.path_enu_m] == [[0, 0, 20], [0, 0, 20]]


@pytest.mark.parametrize(("standing", "mapping"), [(True, True), (False, False)])
def test_nothing_is_mapped_on_the_ground_nor_outside_of_the_span(standing: bool, mapping: bool) -> None:
    one = rerun()
    one.standing = standing
    assert not any(placed(one, 0.0, 0.5, 1.0, 1.5, mapping=mapping))
    assert one.finish() is None
    assert (one.outcome.windows, one.maps()) == (0, None)
    assert one.returns == 20_000  # they are known of all the same


def test_a_jump_of_the_position_begins_the_maps_anew() -> None:
    one = rerun()
    put(one, 0.0)
    put(one, 0.5)
    assert placed(one, 0.0, 0.5, 1.0)[1]
    put(one, 1.0, east_m=50.0)
    assert placed(one, 1.5) == [False]  # it may lie on both sides of the jump
    assert one.report is None
    assert one.maps() is None
    placed(one, 2.0, 2.5)
    assert one.finish() is not None
    assert one.maps() is not None


def test_a_window_that_the_pipeline_fails_on_costs_itself_only(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    one = rerun()

    def fail(_pipeline: Pipeline, _window: Any) -> Any:
        raise ArithmeticError("planted")

    with monkeypatch.context() as patch:
        patch.setattr(Pipeline, "process", fail)
        assert not any(placed(one, 0.0, 0.5, 1.0))
    assert "planted" in caplog.text
    assert placed(one, 1.5, 2.0)[0]
    assert (one.outcome.windows, one.outcome.failed, len(one.outcome.path_enu_m)) == (2, 1, 1)


def returns(second: float, n: int = 10) -> Returns:
    stamps = np.full(n, round(second * SECOND), np.int64)
    return Returns.plain(np.full((n, 3), 5.0, np.float32), stamps)


def test_spans_of_returns_and_of_poses_are_told_as_far_as_they_are_known() -> None:
    one = rerun()
    one.add_returns(returns(1.0, n=0))
    assert (one.returns, one.span_ns, one.poses_ns) == (0, None, None)
    one.add_returns(returns(1.0))
    assert (one.returns, one.span_ns, one.poses_ns) == (10, (SECOND, SECOND), None)
    for second in (2.0, 3.0):
        one.history.add_attitude(round(second * SECOND), LEVEL, (0.0, 0.0, 0.0))
        put(one, second)
        one.add_returns(returns(second))
    assert (one.returns, one.span_ns) == (30, (SECOND, 3 * SECOND))
    assert one.poses_ns == (2 * SECOND, 3 * SECOND)
