"""Sorting of a piece of a file into blocks: the first step of a survey, and the only one that decodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.cloud import open_source
from companion.desk.clouds.cloud_source import Source
from companion.desk.clouds.crs import from_option
from companion.desk.clouds.las import Columns, LasSource
from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.lattice import MOST_HEIGHT_M, UNIT_M, Lattice
from companion.runtime.errors import UsageError
from slz.kernels.survey.point_binning import BLOCK, by_block, count_heights, count_lines, place, rehash

MOST_BLOCKS = 1 << 12  # initial capacity
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Piece:
    """Points `first` to `stop` of a file, and the path of its sorted file."""

    number: int
    path: Path
    crs: str | None
    first: int
    stop: int
    sorted: Path
    vertical_unit: str | None = None


@dataclass(frozen=True, slots=True)
class SortOutcome:
    """Result of sorting a piece: the reason it could not be read, or None."""

    number: int
    broken: str | None


def sort_piece(piece: Piece, lattice: Lattice, bin_m: float) -> SortOutcome:
    """Sort the points of a piece and write them; an existing sorted file is kept.

    The file holds, by block: blocks (n, 2) row and column, ends (n,), low and high (n,) of the heights;
    cells, heights and marks of the points; the number of points in each row and column of cells, and in each
    bin of heights.
    """
    if piece.sorted.exists():
        return SortOutcome(piece.number, None)
    sorter = _Sorter(lattice)
    try:
        given = from_option(piece.crs, piece.vertical_unit) if piece.crs else None
        source = open_source(piece.path, given, piece.vertical_unit)
        for columns in _columns(source, piece):
            sorter.add(columns)
    except UsageError as error:
        return SortOutcome(piece.number, str(error))
    arrays, notes = sorter.sorted(bin_m)
    array_file.write(piece.sorted, arrays, notes)
    return SortOutcome(piece.number, None)


def _columns(source: Source, piece: Piece) -> Iterator[Columns]:
    if isinstance(source, LasSource):
        yield from source.columns(piece.first, piece.stop)
        return
    for chunk in source.chunks():
        x, y, z = (np.ascontiguousarray(chunk.points[:, axis]) for axis in range(3))
        unmarked = np.zeros(len(x), np.uint8)
        yield Columns(x, y, z, np.ones(len(x), bool), unmarked, chunk.n_read, chunk.dropped)


class _Sorter:
    """Counting sort of points by block."""

    def __init__(self, lattice: Lattice) -> None:
        self._scales = (
            lattice.x_m / lattice.cell_m,
            lattice.y_m / lattice.cell_m,
            lattice.z_m / UNIT_M,
            MOST_HEIGHT_M / UNIT_M,
        )
        self._blocks = np.zeros((MOST_BLOCKS, 2), np.int64)
        self._slots = np.full(4 * MOST_BLOCKS, -1, np.int64)
        self._n_blocks = 0
        self._parts: list[
            tuple[NDArray[np.uint16], NDArray[np.int32], NDArray[np.int32], NDArray[np.uint8]]
        ] = []
        self._n_read = 0
        self._dropped: Counter[str] = Counter()

    def add(self, columns: Columns) -> None:
        """Add points; those beyond the lattice's range count as strays."""
        size = len(columns.x)
        cell, height, block = np.empty(size, np.uint16), np.empty(size, np.int32), np.empty(size, np.int32)
        mark = np.empty(size, np.uint8)
        n = -1
        while n < 0:
            n, self._n_blocks = place(
                columns.x, columns.y, columns.z, columns.keep, *self._scales,
                self._blocks, self._slots, self._n_blocks, columns.mark, cell, height, block, mark,
            )  # fmt: skip
            if n < 0:
                self._widen()
        self._n_read += columns.n_read
        self._dropped.update(columns.dropped)
        self._dropped["stray"] += int(np.count_nonzero(columns.keep)) - n
        self._parts.append((cell[:n], height[:n], block[:n], mark[:n]))

    def _widen(self) -> None:
        """Quadruple the capacity for blocks."""
        old = self._blocks[: self._n_blocks]
        self._blocks = np.zeros((4 * len(self._blocks), 2), np.int64)
        self._blocks[: len(old)] = old
        self._slots = np.full(4 * len(self._blocks), -1, np.int64)
        rehash(self._blocks, self._n_blocks, self._slots)

    def sorted(self, bin_m: float) -> tuple[Arrays, dict[str, Any]]:
        """Return the arrays and notes of a sorted file, blocks in the order of rows and columns."""
        cell, height, block, mark = (np.concatenate([part[k] for part in self._parts]) for k in range(4))
        self._parts.clear()
        order = np.lexsort(self._blocks[: self._n_blocks].T[::-1])
        blocks = self._blocks[order]
        rank = np.empty(self._n_blocks, np.int32)
        rank[order] = np.arange(self._n_blocks, dtype=np.int32)
        block = rank[block]
        ends = np.cumsum(np.bincount(block, minlength=self._n_blocks)).astype(np.int64)
        cells, heights, marks = np.empty_like(cell), np.empty_like(height), np.empty_like(mark)
        begins = np.concatenate([[0], ends[:-1]]).astype(np.int64)
        by_block(block, cell, height, mark, begins, cells, heights, marks)
        starts = np.concatenate([[0], ends[:-1]]).astype(np.int64)[: len(ends)]
        some = len(heights) > 0
        arrays: Arrays = {
            "blocks": blocks,
            "ends": ends,
            "low": np.minimum.reduceat(heights, starts) if some else np.empty(0, np.int32),
            "high": np.maximum.reduceat(heights, starts) if some else np.empty(0, np.int32),
            "cells": cells,
            "heights": heights,
            "marks": marks,
            "bins": _bins(heights, bin_m),
            **_lines(blocks, ends, cells),
        }
        return arrays, {"n_read": self._n_read, "dropped": dict(self._dropped)}


def _bins(heights: NDArray[np.int32], bin_m: float) -> NDArray[np.int64]:
    """Return (n, 2) numbers of the height bins that hold points, and their counts."""
    units = bin_m / UNIT_M
    first, last = (int(np.floor(edge / units)) for edge in (-MOST_HEIGHT_M / UNIT_M, MOST_HEIGHT_M / UNIT_M))
    count = np.zeros(last - first + 1, np.int64)
    count_heights(heights, units, first, count)
    held = np.flatnonzero(count)
    return np.column_stack([held + first, count[held]])


def _lines(blocks: NDArray[np.int64], ends: NDArray[np.int64], cells: NDArray[np.uint16]) -> Arrays:
    """Return (n, 2) numbers of the rows, and of the columns, of cells that hold points, and their counts."""
    lines: list[dict[int, NDArray[np.int64]]] = [{}, {}]
    begin = 0
    for (row, col), end in zip(blocks.tolist(), ends.tolist(), strict=True):
        rows = lines[0].setdefault(row, np.zeros(BLOCK, np.int64))
        cols = lines[1].setdefault(col, np.zeros(BLOCK, np.int64))
        count_lines(cells[begin:end], rows, cols)
        begin = end
    return {"rows": _listed(lines[0]), "cols": _listed(lines[1])}


def _listed(lines: dict[int, NDArray[np.int64]]) -> NDArray[np.int64]:
    parts = [np.empty((0, 2), np.int64)]
    for number, count in sorted(lines.items()):
        held = np.flatnonzero(count)
        parts.append(np.column_stack([held + number * BLOCK, count[held]]))
    return np.concatenate(parts)
