"""Data sent to one browser, each item once."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from starlette.websockets import WebSocket

import params
from companion.flight.dashboard.board import Board
from companion.flight.dashboard.security.access import Role
from companion.flight.dashboard.site import Site
from companion.flight.dashboard.viewer import MOST_PER_S, PATH_PART, Viewer
from companion.flight.landing.situation import Reply
from companion.runtime.lockstep_loop import LockstepLoop
from tests.unit.companion.flight.dashboard.test_site import site_of


class Shown:
    """A site and one browser, without a socket."""

    def __init__(self) -> None:
        self.board = Board(params.load())
        self.site = site_of(self.board)
        self.viewer = Viewer(self.site, cast(WebSocket, None), Role.VIEWER)

    def path(self) -> list[tuple[int, int, list[Any]]]:
        """Return the parts of the path that are new to the browser: number, beginning and points."""
        news = [json.loads(text) for text in self.viewer.pending_messages()]
        return [(m["number"], m["from"], m["points"]) for m in news if m["t"] == "path"]


@pytest.fixture
def shown() -> Iterator[Shown]:
    made = Shown()
    yield made
    made.site.close()


def test_a_path_is_sent_point_by_point_as_it_grows(shown: Shown) -> None:
    shown.board.add_position((1.0, 0.0, 5.0))
    assert shown.path() == [(0, 0, [[1.0, 0.0, 5.0]])]
    assert shown.path() == []
    shown.board.add_position((2.0, 0.0, 5.0))
    assert shown.path() == [(0, 1, [[2.0, 0.0, 5.0]])]


def test_a_path_that_was_thinned_is_sent_from_its_beginning(shown: Shown) -> None:
    for k in range(4):
        shown.board.add_position((float(k), 0.0, 5.0))
    shown.path()
    shown.board.path, shown.board.path_number = shown.board.path[::2], 1
    assert shown.path() == [(1, 0, [[0.0, 0.0, 5.0], [2.0, 0.0, 5.0]])]


def test_a_long_path_comes_in_parts(shown: Shown) -> None:
    for k in range(PATH_PART + 1):
        shown.board.add_position((float(k), 0.0, 5.0))
    assert [(at, len(points)) for _, at, points in shown.path()] == [(0, PATH_PART)]
    assert [(at, len(points)) for _, at, points in shown.path()] == [(PATH_PART, 1)]


class Sender:
    """A browser that sends messages, on the simulated clock, and the answers it gets."""

    def __init__(self, role: Role = Role.OPERATOR) -> None:
        self.carried_out: list[tuple[str, float]] = []
        self.told: list[dict[str, Any]] = []
        steps = itertools.count(1_000_000, 1_000_000)
        self.loop = LockstepLoop(lambda: next(steps))
        self.role = role
        self.began_s = 0.0

    async def answer(self, order: Any, _seen: int | None) -> Reply:
        """Carry out an order; stopping a recording takes three seconds."""
        if order.do == "record":
            await asyncio.sleep(3.0)
        self.carried_out.append((order.do, round(self.loop.time() - self.began_s, 1)))
        return Reply(True, "")

    def sends(self, *texts: str) -> None:
        """Send messages at once, and hear for four seconds."""
        site = SimpleNamespace(answer=self.answer, refused=0, facts=lambda _question: {})
        site.board, site.serving, site.about = SimpleNamespace(run=0), True, {}
        site.give_way = asyncio.Event().wait  # for ever: nothing is shown

        async def script() -> None:
            self.began_s = self.loop.time()
            inbox: asyncio.Queue[dict[str, str]] = asyncio.Queue()
            for text in texts:
                inbox.put_nowait({"type": "websocket.receive", "text": f"1 {text}"})

            async def send_text(text: str) -> None:
                if (document := json.loads(text)).get("t") != "about":
                    self.told.append(document)

            async def accept() -> None:
                pass

            socket = SimpleNamespace(accept=accept, receive=inbox.get, send_text=send_text, close=None)
            viewer = asyncio.create_task(Viewer(cast(Site, site), cast(WebSocket, socket), self.role).run())
            await asyncio.sleep(4.0)
            viewer.cancel()
            await asyncio.gather(viewer, return_exceptions=True)

        try:
            self.loop.run_until_complete(script())
        finally:
            self.loop.close()


def test_an_abort_does_not_wait_for_what_was_ordered_before() -> None:
    browser = Sender()
    browser.sends('{"id": 1, "do": "record", "on": false}', '{"id": 2, "do": "abort"}')
    assert browser.carried_out == [("abort", 0.0), ("record", 3.0)]
    assert [message["id"] for message in browser.told] == [2, 1]


def test_an_abort_is_carried_out_and_answered_after_however_many_questions() -> None:
    browser = Sender()
    questions = [f'{{"id": {k}, "do": "facts", "east_m": 1, "north_m": 1}}' for k in range(MOST_PER_S)]
    browser.sends(*questions, '{"id": 99, "do": "abort"}', '{"id": 100, "do": "land_best"}')
    assert browser.carried_out == [("abort", 0.0)]
    assert browser.told[-1] == {"t": "reply", "id": 99, "ok": True, "reason": ""}


def test_who_may_only_look_may_not_abort() -> None:
    browser = Sender(Role.VIEWER)
    browser.sends('{"id": 1, "do": "abort"}')
    assert browser.carried_out == []
    assert not browser.told[0]["ok"]
