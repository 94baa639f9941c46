"""The page's loop beside a busy pipeline, on simulated time, and its answers."""

from __future__ import annotations

import json

import params
from companion.flight.dashboard.board import Board
from companion.flight.dashboard.browser_orders import Command, Facts
from companion.flight.dashboard.security.access import Access
from companion.flight.dashboard.security.address import parse_address
from companion.flight.dashboard.security.token_check import TokenCheck
from companion.flight.dashboard.site import MOST_WAIT_S, Site
from companion.flight.landing.situation import Reply
from companion.runtime.lockstep_loop import LockstepLoop
from tests.unit.companion.flight.dashboard.test_map_blocks import drawn, tile
from tests.unit.companion.flight.landing.flight import Flight, zone

MS = 1_000_000


async def refuse(order: Command) -> Reply:
    return Reply(False, "nobody is here")


def site_of(board: Board) -> Site:
    return Site(board, TokenCheck(Access(parse_address("127.0.0.1:8080"), None)), refuse, {})


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
        site = site_of(board)
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


async def test_zones_are_encoded_once_for_all_who_ask() -> None:
    board = Board(params.Parameters())
    site = site_of(board)
    asked = []
    for zones in ([zone(1, 5.0, 5.0)], [zone(1, 5.0, 5.0), zone(2, 30.0, 0.0)]):
        report = Flight(zones).situation().report
        assert report is not None
        board.set_report(report, 1.0)
        asked += [await site.collection(), await site.collection()]
    site.close()
    assert asked[0] is asked[1]
    assert asked[2] is asked[3]
    assert [len(json.loads(found)["features"]) for found in asked] == [1, 1, 2, 2]


def test_a_point_s_facts_are_those_of_the_map_that_knows_it() -> None:
    site = site_of(Board(params.Parameters()))
    site.pyramids.apply_changes("near", drawn(tile(state=0)))
    known = site.facts(Facts(id=1, do="facts", east_m=-49.9, north_m=-59.9))
    strange = site.facts(Facts(id=2, do="facts", east_m=500.0, north_m=0.0))
    site.close()
    expected = {
        "east_m": -49.9, "north_m": -59.9, "map": "near", "cell_m": 0.2, "height_m": 100.0,
        "slope_deg": 3.0, "relief_m": 0.12, "certainty": 0.9, "state": "unsafe",
    }  # fmt: skip
    assert {name: known[name] for name in expected} == expected
    assert strange == {"east_m": 500.0, "north_m": 0.0, "map": None, "state": "unknown"}
