"""Derived tiles as one raster: read over any window, and labelled without effect of borders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.derive_tiles import KEPT
from companion.desk.survey.tiled.tile_labels import Members, join_components, label_tile
from companion.desk.survey.tiled.tile_store import HELD, Store, TileLayout
from companion.desk.survey.tiled.tiled_zones import Work, describe_zones
from companion.desk.survey.tiled.zone_file import load
from slz import SAFE, UNKNOWN, UNSAFE, Box
from tests.unit.companion.desk.survey.tiled.ground import parameters

WHOLE = Box(-2, 13, 5, 22)  # of five rows and six columns of tiles, those at the rim cut
SIDE = 4


def tiles(folder: Path, state: np.ndarray) -> TileLayout:
    """Write the tiles of a survey, of which only the state is of interest."""
    layout = TileLayout(folder, SIDE, WHOLE, 0.5)
    for key in layout.keys(WHOLE):
        box = layout.held(key)
        part = state[layout.local(box).slices]
        layers = {"state": part} | {layer.name: part.astype(np.float32) for layer in KEPT}
        array_file.write(layout.path(key), layers, {"box": [box.row0, box.row1, box.col0, box.col1]})
    return layout


@pytest.fixture
def state() -> np.ndarray:
    return np.random.default_rng(4).choice(np.array([SAFE, UNSAFE, UNKNOWN], np.uint8), WHOLE.shape)


def test_any_window_is_read_whatever_tiles_it_lies_on(tmp_path: Path, state: np.ndarray) -> None:
    layout = tiles(tmp_path, state)
    store = Store(layout)
    assert len(list(layout.keys(WHOLE))) > HELD
    np.testing.assert_array_equal(store.state(layout.grid.everything), state)
    np.testing.assert_array_equal(store.state(Box(3, 9, 1, 12)), state[3:9, 1:12])
    np.testing.assert_array_equal(store.layer("height_m", Box(3, 9, 1, 12)), state[3:9, 1:12])


def test_what_lies_beyond_the_survey_or_was_not_drawn_is_unknown(tmp_path: Path, state: np.ndarray) -> None:
    layout = tiles(tmp_path, state)
    layout.path((1, 2)).unlink()  # no point lay there
    rows, cols = WHOLE.shape
    wanted = np.full((rows + 12, cols + 12), UNKNOWN, np.uint8)
    wanted[6:-6, 6:-6] = state
    wanted[6:-6, 6:-6][layout.local(layout.held((1, 2))).slices] = UNKNOWN
    around = Box(-6, rows + 6, -6, cols + 6)
    np.testing.assert_array_equal(Store(layout).state(around), wanted)
    for beyond in (Box(rows, rows + 1, 0, cols), Box(0, rows, -1, 0), Box(4, 4, 0, cols)):
        assert (Store(layout).state(beyond) == UNKNOWN).all()
        assert np.isnan(Store(layout).layer("height_m", beyond)).all()


def test_a_zone_over_more_tiles_than_are_held_is_one_and_whole(tmp_path: Path, state: np.ndarray) -> None:
    state[:] = SAFE
    state[7, 3:14] = UNSAFE
    layout = tiles(tmp_path, state)
    found = join_components({key: label_tile(layout, key, 3) for key in layout.keys(WHOLE)})
    assert len(found) == 1
    assert found[0].extent == WHOLE
    members = Members(Store(layout))
    for window in (WHOLE, Box(3, 9, 6, 11), Box(2, 8, 7, 12)):
        cells = members.cells(found[0], window)
        np.testing.assert_array_equal(cells, state[layout.local(window).slices] == SAFE)


def test_a_zone_whose_only_square_hangs_on_its_corner_is_found_and_has_a_place(
    tmp_path: Path, state: np.ndarray
) -> None:
    """The few cells of that square belong to it, for it is what makes it a zone."""
    state[:] = UNSAFE
    state[3, 2:13] = SAFE
    state[4:6, 13:15] = SAFE
    layout = tiles(tmp_path, state)
    found = join_components({key: label_tile(layout, key, 2) for key in layout.keys(WHOLE)})
    work = Work(tuple(found), tmp_path / "0.zones")
    assert describe_zones(work, layout, parameters("min_square_m=1.0", "min_boundary_points=4")) == 1
    (one,) = load(work.done)
    assert one.zone.cells.sum() == 15
    assert one.first == (5 << 32) + 14
