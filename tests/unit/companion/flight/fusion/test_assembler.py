"""Assembly of scans from scripted batches and poses, once poses bracket them."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.sensors.returns import Returns
from params import Parameters
from slz import ReturnKind, Scan, SpeckDetector
from tests.unit.companion.flight.fusion.flights import HOME, MS, Flight, returns_of

P = Parameters()
BATCH = 10


class Rig:
    """A flight, its history and an assembler."""

    def __init__(self) -> None:
        self.flight, self.history = Flight(), PoseHistory(P, HOME)
        self.scans: list[Scan] = []
        self.assembler = ScanAssembler(P, self.history, self.scans.append)

    def pose(self, *times_ms: int) -> None:
        for time_ms in times_ms:
            self.flight.report_attitude(self.history, time_ms * MS)
            self.flight.report_position(self.history, time_ms * MS)

    def batch(self, start_ms: int, n: int = 100) -> None:
        self.assembler.add(self.returns(start_ms, n))

    @staticmethod
    def returns(start_ms: int, n: int = 100) -> Returns:
        stamps = (start_ms * MS + np.linspace(0, 9.9 * MS, n)).astype(np.int64)
        return returns_of(np.full((n, 3), 5.0), stamps)


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_returns_wait_for_the_pose_after_them(rig: Rig) -> None:
    rig.pose(0, 20, 40)
    for start in range(0, 90, BATCH):
        rig.batch(start)
    assert not rig.scans
    rig.pose(60, 80)
    rig.batch(90)
    (scan,) = rig.scans
    assert scan.stamp_ns[0] == 0
    assert 50 * MS <= scan.stamp_ns[-1] - scan.stamp_ns[0] <= 60 * MS
    assert scan.stamp_ns[-1] <= 80 * MS


def test_every_return_comes_out_once_in_order(rig: Rig) -> None:
    for start in range(0, 1000, BATCH):
        if start % 20 == 0:
            rig.pose(start)
        rig.batch(start)
    stamps = np.concatenate([scan.stamp_ns for scan in rig.scans])
    assert (np.diff(stamps) > 0).all()
    assert stamps[0] == 0
    assert stamps[-1] > 900 * MS
    assert len(stamps) % 100 == 0
    assert rig.assembler.statistics()["without_pose"] == 0


def test_returns_that_no_pose_follows_are_dropped_and_counted(rig: Rig) -> None:
    rig.pose(0, 20)
    for start in range(0, 700, BATCH):
        rig.batch(start)
    assert not rig.scans
    # The first two batches had their poses; the newest return, at 699.9 ms, gave up on what ended by 199.8.
    assert rig.assembler.statistics()["stale"] == 100 * len(range(20, 190, BATCH))
    rig.pose(*range(640, 760, 20))
    for start in range(700, 760, BATCH):
        rig.batch(start)
    assert rig.scans
    assert rig.scans[0].stamp_ns[0] >= 640 * MS or rig.scans[0].stamp_ns[-1] <= 20 * MS


def test_what_waits_when_the_recording_ends_is_placed_or_counted(rig: Rig) -> None:
    rig.pose(0, 20)
    for start in range(0, 40, BATCH):
        rig.batch(start)
    assert not rig.scans
    rig.pose(32)  # after the last returns, of which the newest are of 39.9 ms
    rig.assembler.finish()
    (scan,) = rig.scans
    assert len(scan.stamp_ns) == 300
    assert rig.assembler.statistics()["stale"] == 100
    rig.assembler.finish()
    assert len(rig.scans) == 1


def test_a_gap_of_the_poses_is_not_bridged(rig: Rig) -> None:
    for start in range(0, 2000, BATCH):
        if start % 20 == 0 and not 500 < start < 1200:
            rig.pose(start)
        rig.batch(start)
    stamps = np.concatenate([scan.stamp_ns for scan in rig.scans])
    assert not ((stamps > 500 * MS) & (stamps < 1200 * MS)).any()
    assert stamps[-1] > 1800 * MS


def test_a_pause_of_the_sensor_ends_a_scan(rig: Rig) -> None:
    rig.pose(*range(0, 2020, 20))
    for start in (0, 10, 1000, 1010, 1020, 1030, 1040, 1050, 1060):
        rig.batch(start)
    assert [int(scan.stamp_ns[0]) // MS for scan in rig.scans] == [0, 1000]
    assert max(int(scan.stamp_ns[-1] - scan.stamp_ns[0]) for scan in rig.scans) < 100 * MS


def test_a_clock_set_back_does_not_block_what_follows(rig: Rig) -> None:
    rig.pose(*range(0, 220, 20))
    rig.batch(900_000)
    for start in range(0, 200, BATCH):
        rig.batch(start)
    assert rig.scans
    assert rig.assembler.statistics()["stale"] == 100


def test_waiting_returns_are_bounded(rig: Rig) -> None:
    rig.pose(0, 20)
    big = returns_of(np.full((500_000, 3), 5.0), np.full(500_000, 50 * MS))
    for _ in range(10):
        rig.assembler.add(big)
    assert rig.assembler.statistics()["stale"] >= 3_000_000


def test_an_empty_batch_is_nothing(rig: Rig) -> None:
    rig.assembler.add(returns_of(np.zeros((0, 3)), np.zeros(0, np.int64)))
    assert not rig.scans


def test_each_return_is_judged_where_somebody_judges(rig: Rig) -> None:
    judging = ScanAssembler(P, rig.history, rig.scans.append, SpeckDetector())
    rig.pose(*range(0, 400, 20))
    for start in range(0, 300, BATCH):
        rig.batch(start)
        judging.add(rig.returns(start))
    plain = [scan for scan in rig.scans if scan.kinds is None]
    judged = [scan.kinds for scan in rig.scans if scan.kinds is not None]
    assert len(plain) == len(judged) > 2
    assert set(np.concatenate(judged)) <= {ReturnKind.OBJECT, ReturnKind.UNDECIDED}
    assert judging.statistics()["specks"] == 0
