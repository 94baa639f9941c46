"""The page's loop beside a pipeline that computes, on simulated time."""

from __future__ import annotations

import params
from companion.dashboard.access import Access
from companion.dashboard.address import parse_address
from companion.dashboard.board import Board
from companion.dashboard.orders import Command
from companion.dashboard.site import MOST_WAIT_S, Site
from companion.landing.situation import Reply
from companion.simulated import LockstepLoop

MS = 1_000_000


async def refuse(order: Command) -> Reply:
    return Reply(False, "nobody is here")


def waited_s(busy_s: float) -> float:
    """Return how long the page keeps still while a window is computed for so long."""
    clock = [0]

    def advance() -> int:
        clock[0] += MS
        return clock[0]

    loop = LockstepLoop(advance)

    async def script() -> float:
        begun_s = loop.time()
        board = Board(params.Parameters())
        board.computing = lambda: loop.time() < begun_s + busy_s
        site = Site(board, Access(parse_address("127.0.0.1:8080"), None), refuse, {})
        await site.give_way()
        site.close()
        return loop.time() - begun_s

    try:
        return loop.run_until_complete(script())
    finally:
        loop.close()


def test_the_page_keeps_still_while_a_window_is_computed() -> None:
    assert 0.1 <= waited_s(busy_s=0.1) < 0.12


def test_the_page_waits_for_no_window_longer_than_its_limit() -> None:
    assert MOST_WAIT_S <= waited_s(busy_s=60.0) < MOST_WAIT_S + 0.02


def test_the_page_waits_for_nothing_when_none_is_computed() -> None:
    assert waited_s(busy_s=0.0) == 0.0
