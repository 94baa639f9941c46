"""Recent returns around the vehicle: objects thinned, undecided ones that came back whole, no specks."""

from __future__ import annotations

import numpy as np

from companion.flight.mapping.recent_obstacles import RecentObstacles
from slz import LocalFrame, ReturnKind, Scan, SpeckDetector
from tests.unit.companion.flight.outputs.pose import pose

FRAME = LocalFrame(47.0, 8.0, 400.0)
S = 1_000_000_000
KINDS = [ReturnKind.OBJECT, ReturnKind.UNDECIDED, ReturnKind.SPECK]


def judged(points: list[list[float]], kinds: list[ReturnKind]) -> Scan:
    stamps = np.full(len(points), S)
    return Scan(np.array(points), stamps, np.zeros(3), FRAME, kinds=np.array(kinds, np.uint8))


def test_specks_are_no_obstacles_but_a_sign_of_life() -> None:
    seen = RecentObstacles(thin=1)
    seen.add(judged([[5.0, 0, 0], [6.0, 0, 0], [7.0, 0, 0]], KINDS))
    found = seen.level_frd_m(pose((0, 0, 0)), S)
    assert np.round(np.abs(found).max(axis=1)).tolist() == [5.0]
    seen = RecentObstacles(thin=1)
    seen.add(judged([[7.0, 0, 0]], [ReturnKind.SPECK]))
    assert len(seen.level_frd_m(pose((0, 0, 0)), S)) == 0
    assert seen.newest_ns == S


def test_an_undecided_return_is_an_obstacle_once_it_comes_back_until_it_is_old() -> None:
    """A wire returns again; a speck, of which a slow sensor decides nothing for seconds, does not."""
    detector = SpeckDetector()
    seen = RecentObstacles(detector)
    for number, aside_m in enumerate((0.0, 0.1)):
        lone = Scan(np.array([[4.0, aside_m, 0.0]]), np.full(1, S + number), np.zeros(3), FRAME)
        assert detector.classify(lone).tolist() == [ReturnKind.UNDECIDED]
        assert len(seen.level_frd_m(pose((0, 0, 0)), 2 * S)) == 2 * number
    assert len(seen.level_frd_m(pose((0, 0, 0)), 4 * S)) == 0
    seen.forget()
    assert len(seen.level_frd_m(pose((0, 0, 0)), 2 * S)) == 0
