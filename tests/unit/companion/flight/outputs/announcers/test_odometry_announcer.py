"""What the pilot is told of an external odometry."""

from __future__ import annotations

from companion.flight.outputs.announcers.odometry_announcer import OdometryAnnouncer

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
