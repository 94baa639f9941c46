"""Player of a recording: pause, speed and seek."""

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from companion.desk.replay.player import Player, Step
from slz import Report

SECOND = 1_000_000_000
FAST = 1e9


class Tape:
    """Ten steps, a second apart."""

    def __init__(self) -> None:
        self.begun = 0
        self.taken: list[float] = []
        self.moved = threading.Condition()
        self.player = Player(self.open_run, self.step, self.on_begin, speed=FAST)
        self.thread = threading.Thread(target=self.player.run, daemon=True)

    def open_run(self) -> tuple[Any, Iterator[Step]]:
        def take(_mapping: bool) -> Report | None:
            return None

        return None, iter([(5 * SECOND + k * SECOND, take) for k in range(10)])

    def on_begin(self) -> None:
        with self.moved:
            self.begun += 1
            self.moved.notify_all()

    def step(self, _playing: Any, at_s: float, _stamp_ns: int, _report: Report | None) -> None:
        with self.moved:
            self.taken.append(at_s)
            self.moved.notify_all()

    def until(self, done: Callable[[], bool]) -> None:
        with self.moved:
            assert self.moved.wait_for(done, 10)


@pytest.fixture
def tape() -> Iterator[Tape]:
    made = Tape()
    yield made
    made.player.close()
    if made.thread.is_alive():
        made.thread.join(10)
    assert not made.thread.is_alive()


def test_all_steps_are_taken_in_order_and_the_end_is_told(tape: Tape) -> None:
    tape.thread.start()
    tape.until(lambda: len(tape.taken) == 10)
    assert tape.taken == list(range(10))
    assert tape.player.length_s == 9


def test_going_back_begins_anew_and_runs_up_to_there(tape: Tape) -> None:
    tape.thread.start()
    tape.until(lambda: len(tape.taken) == 10)
    tape.player.set_speed(0)
    tape.player.go_to(3.0)
    tape.until(lambda: tape.begun == 2 and len(tape.taken) >= 13)
    assert tape.taken[10:13] == [0, 1, 2]  # those before the second asked for are not waited for


def test_a_held_tape_moves_on_when_told_to(tape: Tape) -> None:
    tape.player.set_speed(0)
    tape.thread.start()
    tape.until(lambda: tape.begun == 1)
    assert tape.taken == []
    tape.player.set_speed(FAST)
    tape.until(lambda: len(tape.taken) == 10)


def test_going_ahead_passes_over_what_lies_between(tape: Tape) -> None:
    tape.player.set_speed(0)
    tape.player.go_to(6.0)
    tape.thread.start()
    tape.until(lambda: len(tape.taken) >= 6)
    assert tape.taken[:6] == list(range(6))
    assert tape.begun == 1


def test_going_back_in_the_middle_begins_anew(tape: Tape) -> None:
    tape.player.set_speed(0)
    tape.player.go_to(6.0)
    tape.thread.start()
    tape.until(lambda: len(tape.taken) == 6)
    tape.player.go_to(2.0)
    tape.until(lambda: tape.begun == 2 and len(tape.taken) == 8)
    assert tape.taken[6:] == [0, 1]
    assert not tape.player.ended


def test_a_second_beyond_the_end_is_the_end_and_going_back_is_still_possible(tape: Tape) -> None:
    tape.player.set_speed(0)
    tape.player.go_to(1000.0)
    tape.thread.start()
    tape.until(lambda: len(tape.taken) == 10)
    tape.player.go_to(3.0)
    tape.until(lambda: len(tape.taken) >= 13)
    assert (tape.begun, tape.taken[10:13]) == (2, [0, 1, 2])
