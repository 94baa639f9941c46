"""What the pilot is told of an external odometry."""

from __future__ import annotations

from companion.flight.landing.situation import Severity
from companion.flight.outputs.announcers.lidar_announcer import AGAIN_NS, LidarAnnouncer
from companion.flight.outputs.announcers.odometry_announcer import OdometryAnnouncer
from tests.unit.companion.flight.sensors.diagnosis.faults import pause
from tests.unit.companion.flight.sensors.diagnosis.streams import Bench, loop_of

STEP_NS = 250_000_000


class Script:
    """An odometry that is used or not, and what is told of it."""

    def __init__(self) -> None:
        self.why = "silent"
        self.now_ns = 0
        self.announcer = OdometryAnnouncer(self, print)

    def why_not(self, now_ns: int) -> str:
        assert now_ns == self.now_ns
        return self.why

    def run(self, seconds: float, why: str) -> list[tuple[str, str]]:
        self.why, told = why, []
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.now_ns += STEP_NS
            told += [(severity.name, text) for severity, text in self.announcer.update(self.now_ns)]
        return told


USED = ("INFO", "SLZ: odometry used: the map follows it")
SILENT = ("WARNING", "SLZ: odometry not used: silent")


def test_the_beginning_and_the_end_of_its_use_are_told() -> None:
    script = Script()
    assert script.run(10, "silent") == []  # it may come later
    assert script.run(10, "needs 5 m of way") == []
    assert script.run(5, "") == [USED]
    assert script.run(0.75, "silent") == []
    assert script.run(5, "") == []
    assert script.run(5, "silent") == [SILENT]


def test_one_that_cannot_be_used_is_told_from_the_start() -> None:
    assert Script().run(5, "stamps of another clock") == [
        ("WARNING", "SLZ: odometry not used: stamps of another clock")
    ]


def test_the_same_is_told_once_a_minute_at_most() -> None:
    script = Script()
    told = [line for _ in range(10) for why in ("", "silent") for line in script.run(3, why)]
    assert told == [USED, SILENT]
    assert script.run(10, "") == [USED]
    assert script.run(10, "silent") == [SILENT]


def test_an_odometry_that_was_used_and_begins_anew_is_told() -> None:
    script = Script()
    script.run(5, "")
    assert script.run(5, "needs 5 m of way") == [("WARNING", "SLZ: odometry not used: needs 5 m of way")]


def test_without_odometry_nothing_is_told() -> None:
    assert OdometryAnnouncer(None, print).update(0) == []


# Announcements of LiDAR faults: once each, with their end, and not again at once.


S = 1_000_000_000


def test_a_fault_is_told_once_then_its_end_and_not_again_within_a_minute() -> None:
    bench = Bench(loop_of("vlp16"))
    announcer = LidarAnnouncer(bench.stream.diagnosis, lambda text, severity: None)
    at_s = 0.0

    def fly(seconds: float) -> list[tuple[Severity, str]]:
        nonlocal at_s
        news = []
        for _ in range(round(seconds * 2)):
            bench.feed(bench.arrivals(bench.number_at(at_s), bench.number_at(at_s + 0.5)))
            at_s += 0.5
            news += announcer.update(round(at_s * S))
        return news

    def pause_now() -> None:
        nonlocal at_s
        bench.feed(pause(1.2)(bench, bench.number_at(at_s), bench.number_at(at_s + 1.5)))
        at_s += 1.5

    assert fly(5) == []
    pause_now()
    assert fly(3) == [(Severity.WARNING, "SLZ: LiDAR paused for 1.2 s")]
    assert fly(8) == [(Severity.NOTICE, "SLZ: over: LiDAR paused for 1.2 s")]
    pause_now()
    assert fly(12) == []
    assert fly(AGAIN_NS / S - 28) == []
    pause_now()
    assert [text for _, text in fly(3)] == ["SLZ: LiDAR paused for 1.2 s"]


def test_a_sensor_without_diagnosis_says_nothing() -> None:
    assert LidarAnnouncer(None, lambda text, severity: None).update(0) == []
