"""What one browser is sent, and that it is sent once."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, cast

import pytest
from starlette.websockets import WebSocket

import params
from companion.dashboard.access import Role
from companion.dashboard.board import Board
from companion.dashboard.viewer import PATH_PART, Viewer
from tests.unit.companion.dashboard.test_site import site_of


class Shown:
    """A site and one browser, without a socket."""

    def __init__(self) -> None:
        self.board = Board(params.load())
        self.site = site_of(self.board)
        self.viewer = Viewer(self.site, cast(WebSocket, None), Role.VIEWER)

    def path(self) -> list[tuple[int, int, list[Any]]]:
        """Return the parts of the path that are new to the browser: number, beginning and points."""
        news = [json.loads(text) for text in self.viewer.news()]
        return [(m["number"], m["from"], m["points"]) for m in news if m["t"] == "path"]


@pytest.fixture
def shown() -> Iterator[Shown]:
    made = Shown()
    yield made
    made.site.close()


def test_a_path_is_sent_point_by_point_as_it_grows(shown: Shown) -> None:
    shown.board.fly((1.0, 0.0, 5.0))
    assert shown.path() == [(0, 0, [[1.0, 0.0, 5.0]])]
    assert shown.path() == []
    shown.board.fly((2.0, 0.0, 5.0))
    assert shown.path() == [(0, 1, [[2.0, 0.0, 5.0]])]


def test_a_path_that_was_thinned_is_sent_from_its_beginning(shown: Shown) -> None:
    for k in range(4):
        shown.board.fly((float(k), 0.0, 5.0))
    shown.path()
    shown.board.path, shown.board.path_number = shown.board.path[::2], 1
    assert shown.path() == [(1, 0, [[0.0, 0.0, 5.0], [2.0, 0.0, 5.0]])]


def test_a_long_path_comes_in_parts(shown: Shown) -> None:
    for k in range(PATH_PART + 1):
        shown.board.fly((float(k), 0.0, 5.0))
    assert [(at, len(points)) for _, at, points in shown.path()] == [(0, PATH_PART)]
    assert [(at, len(points)) for _, at, points in shown.path()] == [(PATH_PART, 1)]
