"""Announcements of LiDAR faults: once each, with their end, and not again at once."""

from __future__ import annotations

from companion.flight.landing.situation import Severity
from companion.flight.outputs.announcers.lidar_announcer import AGAIN_NS, LidarAnnouncer
from tests.unit.companion.flight.sensors.diagnosis.faults import pause
from tests.unit.companion.flight.sensors.diagnosis.streams import Bench, loop_of

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
