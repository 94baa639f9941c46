"""Statistics of a stream: its rate, the deviation of its intervals, the age of its poses."""

from __future__ import annotations

from companion.flight.outputs.schedule import Cadence

MS = 1_000_000


def test_rate_jitter_and_age() -> None:
    cadence = Cadence(20.0)
    for at in (0, 50, 104, 150):
        cadence.record(at * MS, 15 * MS)
    assert cadence.summary() == {
        "count": 4,
        "hz": 20.0,
        "jitter_ms": {"p50": 4.0, "p99": 4.0, "max": 4.0},
        "pose_age_ms": {"p50": 15.0, "p99": 15.0, "max": 15.0},
    }


def test_a_pause_is_no_interval() -> None:
    cadence = Cadence(20.0)
    cadence.record(0)
    cadence.record(50 * MS)
    cadence.pause()
    cadence.record(9000 * MS)
    assert cadence.summary()["jitter_ms"]["max"] == 0


def test_what_was_never_sent_has_no_figures() -> None:
    assert Cadence(20.0).summary() == {"count": 0}
    assert "jitter_ms" not in Cadence(None).summary()


def test_messages_of_one_instant_have_no_rate() -> None:
    cadence = Cadence(20.0)
    cadence.record(5)
    cadence.record(5)
    assert cadence.summary() == {"count": 2}
