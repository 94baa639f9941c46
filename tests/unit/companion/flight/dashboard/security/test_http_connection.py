"""Closing of connections, check by check."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from companion.flight.dashboard.security.http_connection import MOST_LOOKS, Connection


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


def connected() -> tuple[Any, Wire]:
    wire, made = Wire(), Connection.__new__(Connection)
    wire.protocol = made
    parts: Any = {"transport": wire, "loop": SimpleNamespace(call_later=lambda *_: None), "cycle": None}
    vars(made).update(parts)
    return made, wire


def test_a_connection_that_is_used_between_looks_is_kept_and_an_idle_one_is_not() -> None:
    made, wire = connected()
    for _ in range(20):
        made.cycle = SimpleNamespace(response_complete=True)
        made._look()
    assert not wire.aborted
    made._look()
    assert wire.aborted


def test_a_request_may_take_its_time_but_not_for_ever() -> None:
    made, wire = connected()
    made.cycle = SimpleNamespace(response_complete=False)
    for _ in range(MOST_LOOKS - 1):
        made._look()
    assert not wire.aborted
    made._look()
    assert wire.aborted


def test_the_channel_of_a_browser_is_left_alone() -> None:
    made, wire = connected()
    wire.protocol = object()
    for _ in range(20):
        made._look()
    assert not wire.aborted
