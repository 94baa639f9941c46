"""Ground of the last seconds' reports, without what has come since."""

from __future__ import annotations

import numpy as np
import pytest

from slz import Nearby
from slz.moving.raised_returns import KEPT_NS, RecentGround

S = 1_000_000_000


def report(raised_m: float = 0.0, west_m: float = -5.0, cell_m: float = 0.5) -> Nearby:
    """Return level ground of 20 x 20 blocks, and something of a height at 0.2, 0.2 m."""
    ground = np.zeros((20, 20), np.float32)
    top = ground.copy()
    row, col = (int((0.2 - corner) // cell_m) for corner in (-5.0, west_m))
    top[row, col] = raised_m
    return Nearby(west_m, -5.0, cell_m, ground, top, np.zeros(ground.shape, bool))


def top_at(recent: RecentGround, nearby: Nearby, now_ns: int, east_m: float = 0.2) -> float:
    ground = recent.add(nearby, now_ns)
    row, col = (
        int((place - corner) // ground.cell_m)
        for place, corner in ((0.2, ground.south_m), (east_m, ground.west_m))
    )
    return float(ground.top_m[row, col])


def test_what_came_is_left_out_until_it_has_stood_for_long() -> None:
    recent = RecentGround()
    assert top_at(recent, report(), S) == 0.0
    assert top_at(recent, report(1.7), 2 * S) == 0.0
    assert top_at(recent, report(1.7), S + KEPT_NS) == 0.0
    assert top_at(recent, report(1.7), 2 * S + KEPT_NS) == pytest.approx(1.7)


def test_what_stood_when_the_ground_was_first_seen_is_part_of_it() -> None:
    recent = RecentGround()
    assert top_at(recent, report(1.7), S) == pytest.approx(1.7)
    assert top_at(recent, report(2.5), 2 * S) == pytest.approx(2.5)


@pytest.mark.parametrize("west_m", [-5.0, -4.5, -4.75, -5.3, -6.0])
def test_the_reports_of_a_vehicle_that_moves_are_laid_over_each_other(west_m: float) -> None:
    recent = RecentGround()
    top_at(recent, report(), S)
    assert top_at(recent, report(1.7, west_m), 2 * S) == 0.0


def test_a_wall_stays_where_it_is_when_the_vehicle_moves_by_part_of_a_block() -> None:
    recent = RecentGround()
    top_at(recent, report(1.7), S)
    for west_m in (-4.75, -5.2):
        assert top_at(recent, report(1.7, west_m), 2 * S) == pytest.approx(1.7)


def test_blocks_of_another_size_and_older_times_begin_anew() -> None:
    recent = RecentGround()
    top_at(recent, report(), 5 * S)
    assert top_at(recent, report(1.7), 2 * S) == pytest.approx(1.7)
    recent.forget()
    top_at(recent, report(), S)
    assert top_at(recent, report(1.7, cell_m=0.4), 2 * S) == pytest.approx(1.7)
    top_at(recent, report(), 3 * S)
    recent.forget()
    assert top_at(recent, report(1.7), 4 * S) == pytest.approx(1.7)
