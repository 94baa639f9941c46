"""Board between companion and page: published values, and withheld ones."""

from __future__ import annotations

from typing import cast

import pytest

import params
from companion.flight.dashboard import board as boards
from companion.flight.dashboard.board import Board
from slz import Drawn, Pipeline
from tests.unit.companion.flight.dashboard.test_map_blocks import drawn, tile


class Maps:
    """Stands in for a pipeline: hands over what is given by the map's name, None where there is no map."""

    def __init__(self, **given: Drawn) -> None:
        self._given = given
        self.anew: list[bool] = []

    def drawn(self, name: str, _most: int, *, anew: bool) -> Drawn | None:
        self.anew.append(anew)
        return self._given.get(name)


def look(board: Board, maps: Maps, anew: bool = False) -> bool:
    return board.copy_map_changes(cast(Pipeline, maps), anew=anew)


def test_only_maps_that_changed_are_put_up() -> None:
    board = Board(params.load())
    board.viewers = 1
    changed, gone = drawn(tile()), drawn(gone=((0, 0),))
    assert look(board, Maps(near=changed, far=drawn()))
    assert look(board, Maps(far=gone))
    assert look(board, Maps())
    assert list(board.map_changes) == [("near", changed), ("far", gone)]


def test_maps_are_looked_at_for_a_viewer_and_not_ahead_of_the_page() -> None:
    board, maps = Board(params.load()), Maps(near=drawn(tile()))
    assert not look(board, maps)
    board.viewers = 1
    while look(board, maps, anew=True):
        pass
    assert len(board.map_changes) == len(maps.anew) / 2 == boards.MOST_BATCHES
    assert all(maps.anew)


def test_a_vehicle_that_stands_does_not_lengthen_its_path() -> None:
    board = Board(params.load())
    for enu_m in ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), (1.0, 2.0, 4.0), (1.0, 2.0, 3.0)):
        board.add_position(enu_m)
    assert board.path == [(1.0, 2.0, 3.0), (1.0, 2.0, 4.0), (1.0, 2.0, 3.0)]


def test_a_long_path_is_thinned_and_the_page_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boards, "MOST_PATH", 4)
    board = Board(params.load())
    for k in range(5):
        board.add_position((float(k), 0.0, 0.0))
    assert [east for east, _, _ in board.path] == [0, 2, 4]
    assert board.path_number == 1
