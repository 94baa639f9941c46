"""Closing of connections, check by check."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from uvicorn.config import Config
from uvicorn.server import ServerState

from companion.flight.dashboard.security.http_connection import MOST_LOOKS, Connection
from companion.flight.dashboard.security.incidents import Incidents


class Wire:
    """A transport that notes its end."""

    def __init__(self) -> None:
        self.protocol: Any = None
        self.aborted = False

    def is_closing(self) -> bool:
        return self.aborted

    def get_protocol(self) -> Any:
        return self.protocol

    def abort(self) -> None:
        self.aborted = True

    def get_extra_info(self, _name: str) -> None:
        return None


class Timer:
    """A loop whose time comes when it is told."""

    def __init__(self) -> None:
        self.due: list[Callable[[], None]] = []

    def time(self) -> float:
        return 0.0

    def call_later(self, _delay_s: float, work: Callable[[], None]) -> None:
        self.due.append(work)

    def run_once(self) -> None:
        """Do what is due; the connection looks once."""
        due, self.due = self.due, []
        for work in due:
            work()


async def nothing(_scope: Any, _receive: Any, _send: Any) -> None:
    """Answer no request."""


def connected() -> tuple[Any, Wire, Timer]:
    wire, timer = Wire(), Timer()
    loop: Any = timer
    made = Connection(
        Config(nothing, log_config=None), ServerState(), {}, loop, incidents=Incidents(timer.time)
    )
    transport: Any = wire
    wire.protocol = made
    made.connection_made(transport)
    return made, wire, timer


def test_a_connection_that_is_used_between_looks_is_kept_and_an_idle_one_is_not() -> None:
    made, wire, timer = connected()
    for _ in range(20):
        made.cycle = SimpleNamespace(response_complete=True)
        timer.run_once()
    assert not wire.aborted
    timer.run_once()
    assert wire.aborted


def test_a_request_may_take_its_time_but_not_for_ever() -> None:
    made, wire, timer = connected()
    made.cycle = SimpleNamespace(response_complete=False)
    for _ in range(MOST_LOOKS - 1):
        timer.run_once()
    assert not wire.aborted
    timer.run_once()
    assert wire.aborted


def test_the_channel_of_a_browser_is_left_alone() -> None:
    _, wire, timer = connected()
    wire.protocol = object()
    for _ in range(20):
        timer.run_once()
    assert not wire.aborted
