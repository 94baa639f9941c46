"""Signal handling: once, in the main thread, and deferred where required."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

from companion.runtime import interrupt
from companion.runtime.interrupt import Interrupted, Interrupts


@pytest.fixture
def interrupts(monkeypatch: pytest.MonkeyPatch) -> Iterator[Interrupts]:
    """Signals taken over; the program is not left, for the grace is never over."""
    monkeypatch.setattr(threading, "Timer", lambda *_: SimpleNamespace(start=lambda: None))
    made = Interrupts()
    before = signal.getsignal(signal.SIGTERM)
    with made.installed():
        yield made
    assert signal.getsignal(signal.SIGTERM) is before


def come(number: signal.Signals = signal.SIGTERM) -> None:
    os.kill(os.getpid(), number)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_raised_once_and_said_once(
    interrupts: Interrupts, capsys: pytest.CaptureFixture[str], number: signal.Signals, code: int
) -> None:
    with pytest.raises(Interrupted) as raised:
        come(number)
    assert raised.value.exit_code == code
    come(number)
    interrupts.report()
    interrupts.report()
    assert capsys.readouterr().err == f"slz: {raised.value}\n"


def test_a_signal_is_put_off_to_the_end_of_a_block_even_one_that_fails(interrupts: Interrupts) -> None:
    steps = []

    def fail() -> None:
        with interrupts.held():
            come()
            steps.append("after")
            raise OSError

    with pytest.raises(Interrupted):
        fail()
    assert steps == ["after"]


def test_signals_are_left_alone_where_the_program_is_no_main_thread() -> None:
    """Python hands signals to the main thread only, and refuses to install a handler from another."""

    def work() -> None:
        with Interrupts().installed():
            handlers.append(signal.getsignal(signal.SIGTERM))

    handlers: list[object] = []
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert handlers == [signal.getsignal(signal.SIGTERM)]


def test_a_signal_calls_what_handles_it(interrupts: Interrupts) -> None:
    steps: list[str] = []

    def work() -> None:
        with interrupts.handled_by(lambda: steps.append("handled")):
            come()
            steps.append("after")

    with pytest.raises(Interrupted):
        work()
    assert steps == ["handled", "after"]


def test_what_does_not_end_in_time_is_left_with_nothing_behind(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    steps: list[object] = []

    def fail() -> None:
        raise OSError

    monkeypatch.setattr(interrupt.os, "_exit", steps.append)
    timers: list[Callable[[], None]] = []

    def timer(_grace_s: float, leave: Callable[[], None]) -> SimpleNamespace:
        return SimpleNamespace(start=lambda: timers.append(leave))

    monkeypatch.setattr(threading, "Timer", timer)
    made = Interrupts()
    made.leftovers = [lambda: steps.append("made first"), fail, lambda: steps.append("made last")]
    with made.installed(), pytest.raises(Interrupted):
        come()
    (leave,) = timers
    leave()
    assert steps == ["made last", "made first", 143]
    assert capsys.readouterr().err == "slz: terminated\n"
