"""Connected components of safe ground per tile, joined across the borders of tiles by union-find.

Each tile is labelled alone. Every label's record has its extent, the first cell at which a safe square of
the least side ends, and the labels along the tile's four edges. Labels that touch across a border, corners
included, belong to one zone, transitively.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from companion.desk.survey.tiled.tile_store import Key, Store, TileLayout
from slz import SAFE, Box
from slz.grid import common, within
from slz.kernels.polygons.boundary_tracing import squares

NONE = np.iinfo(np.int64).max
Labels = NDArray[np.int32]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TileLabels:
    """Records of the labels 1 to n of a tile.

    extent: (n, 4) row0, row1, col0, col1 of the lattice. first: (n,) row * 2^32 + column, from the survey's
    corner, of the first cell in raster order at which a safe square ends, or `NONE`. edges: labels along
    the south, north, west and east edge of the tile, 0 where not safe.
    """

    key: Key
    extent: Ints
    first: Ints
    edges: tuple[Labels, Labels, Labels, Labels]


@dataclass(frozen=True, slots=True)
class CandidateZone:
    """Candidate zone: its extent, its first square's cell, and its labels by tile."""

    extent: Box
    first: int
    parts: tuple[tuple[Key, tuple[int, ...]], ...]


def label_components(state: NDArray[np.uint8]) -> Labels:
    """Return the labels of safe cells, 8-connected; the same state always has the same labels."""
    label, _ = ndimage.label(state == SAFE, np.ones((3, 3)))
    return np.asarray(label, np.int32)


def label_tile(layout: TileLayout, key: Key, least_side: int) -> TileLabels:
    """Label a tile; squares may begin in cells of the tiles before it, so those are read, too."""
    store, box = Store(layout), layout.held(key)
    local = layout.local(box)
    label = label_components(store.state(local))
    before = least_side - 1
    wide = Box(local.row0 - before, local.row1, local.col0 - before, local.col1)
    side = squares((store.state(wide) == SAFE).astype(np.uint8))[before:, before:]
    places = ndimage.find_objects(label)
    extent = np.array(
        [[r.start + box.row0, r.stop + box.row0, c.start + box.col0, c.stop + box.col0] for r, c in places],
        np.int64,
    ).reshape(-1, 4)
    first = np.full(len(places), NONE, np.int64)
    rows, cols = np.nonzero(side >= least_side)
    number = ((rows + local.row0).astype(np.int64) << 32) + cols + local.col0
    np.minimum.at(first, label[rows, cols] - 1, number)
    edges = (label[0].copy(), label[-1].copy(), label[:, 0].copy(), label[:, -1].copy())
    return TileLabels(key, extent, first, edges)


def join_components(tiles: Mapping[Key, TileLabels]) -> list[CandidateZone]:
    """Return all zones that hold a safe square, in the order of their first squares."""
    keys = sorted(tiles)
    start = dict(zip(keys, np.cumsum([0, *(len(tiles[key].extent) for key in keys)]).tolist(), strict=False))
    total = sum(len(tile.extent) for tile in tiles.values())
    if not total:
        return []
    links = np.concatenate([np.empty((0, 2), np.int64), *_links(tiles, keys, start)])
    graph = coo_array((np.ones(len(links), np.int8), (links[:, 0], links[:, 1])), shape=(total, total))
    count, root = connected_components(graph, directed=False)
    first = np.full(count, NONE, np.int64)
    np.minimum.at(first, root, np.concatenate([tiles[key].first for key in keys]))
    extents = np.concatenate([tiles[key].extent for key in keys])
    low, high = np.full((count, 2), NONE, np.int64), np.full((count, 2), -NONE, np.int64)
    np.minimum.at(low, root, extents[:, [0, 2]])
    np.maximum.at(high, root, extents[:, [1, 3]])
    own = np.repeat(np.arange(len(keys)), [len(tiles[key].extent) for key in keys])
    order = np.argsort(root, kind="stable")
    bounds = np.searchsorted(root[order], np.arange(count + 1))
    found = []
    for k in np.argsort(first, kind="stable").tolist():
        if first[k] == NONE:
            break
        members = order[bounds[k] : bounds[k + 1]]
        parts = tuple(
            (keys[t], tuple((members[own[members] == t] - start[keys[t]] + 1).tolist()))
            for t in np.unique(own[members]).tolist()
        )
        box = Box(int(low[k, 0]), int(high[k, 0]), int(low[k, 1]), int(high[k, 1]))
        found.append(CandidateZone(box, int(first[k]), parts))
    return found


def _links(tiles: Mapping[Key, TileLabels], keys: Iterable[Key], start: Mapping[Key, int]) -> Iterable[Ints]:
    """Yield the pairs of labels that touch across a border, numbered through all tiles."""
    for row, col in keys:
        _, north, _, east = tiles[row, col].edges
        at = start[row, col]
        for key, mine, theirs in (((row + 1, col), north, 0), ((row, col + 1), east, 2)):
            if key in tiles:
                yield _touching(mine, tiles[key].edges[theirs]) + np.array([at, start[key]])
        for key, mine, edge, end in (
            ((row + 1, col + 1), north[-1:], 0, 0),
            ((row + 1, col - 1), north[:1], 0, -1),
        ):
            if key in tiles:
                theirs_at = tiles[key].edges[edge][[end]]
                yield _touching(mine, theirs_at) + np.array([at, start[key]])


def _touching(mine: Labels, theirs: Labels) -> Ints:
    """Return the pairs (less 1) of labels of two adjacent edges that touch, corners included."""
    pairs = [np.empty((0, 2), np.int64)]
    for shift in (-1, 0, 1):
        a = mine[max(0, -shift) : len(mine) - max(0, shift)]
        b = theirs[max(0, shift) : len(theirs) + min(0, shift)]
        both = (a > 0) & (b > 0)
        pairs.append(np.column_stack([a[both], b[both]]).astype(np.int64) - 1)
    return np.unique(np.concatenate(pairs), axis=0)


class Members:
    """Membership masks of zones, from the labels of the tiles."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._labels: dict[Key, Labels] = {}

    def cells(self, zone: CandidateZone, window: Box) -> NDArray[np.uint8]:
        """Return 1 for the cells of a window (lattice) that belong to the zone, else 0."""
        layout = self._store.layout
        out = np.zeros(window.shape, np.uint8)
        for key, numbers in zone.parts:
            box = layout.held(key)
            part = common(box, window)
            if part.empty:
                continue
            label = self._label(key)
            table = np.zeros(int(label.max()) + 1, np.uint8)
            table[list(numbers)] = 1
            out[within(part, window)] = table[label[within(part, box)]]
        return out

    def _label(self, key: Key) -> Labels:
        if key not in self._labels:
            if len(self._labels) >= 8:
                del self._labels[next(iter(self._labels))]
            layout = self._store.layout
            self._labels[key] = label_components(self._store.state(layout.local(layout.held(key))))
        return self._labels[key]
