"""Surface of a survey: kind of the ground, in squares of a fixed lattice, with their surroundings.

A square and the `MARGIN` around it are classified from all their points at once, because a lake is known by
its extent and its shores. The squares are those of the CRS, so the result is the same for any tile size.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.cell_sums import segments
from companion.desk.survey.tiled.lattice import UNIT_M, block_box, grown
from params import Parameters
from slz import Box
from slz.grid import common, within
from slz.kernels.surface.surface_record import (
    APART_M,
    COUNT,
    DEEP,
    HIGH,
    LOW,
    MEAN,
    N_LAYERS,
    NUMBERED,
    SEVERAL,
    SQUARES,
    SURFACE_FIELDS,
    TALL,
)
from slz.kernels.survey.surface_sums import BUILDING, CLASSES, LOW_PLANT, TALL_PLANT, add_sums, count_apart
from slz.surface.classification import Floats, SurfaceLayers, SurveyClasses, classify
from slz.surface.surface_kinds import SurfaceHere
from slz.surface.surface_map import CELL_M

SIDE, MARGIN = 1024, 256  # surface cells


@dataclass(frozen=True, slots=True)
class Part:
    """A square of surface cells: its number, the sorted files with points in reach, and its file."""

    row: int
    col: int
    sources: tuple[Path, ...]
    done: Path


@dataclass(frozen=True, slots=True)
class SurfaceParts:
    """Files of the parts of a survey's surface. cell_m: side of a near cell."""

    folder: Path
    cell_m: float

    @property
    def factor(self) -> int:
        """Near cells along the side of a surface cell."""
        return max(1, round(CELL_M / self.cell_m))

    def path(self, row: int, col: int) -> Path:
        return self.folder / f"{row}_{col}.surface"

    def parts(self, sources: Sequence[Path], whole: Box) -> list[Part]:
        """Return the parts that hold points of the survey, each with the files in its reach."""
        side, reach, held = SIDE * self.factor, MARGIN * self.factor, dict[tuple[int, int], set[Path]]()
        own = set[tuple[int, int]]()
        for path in sources:
            for row, col in array_file.read(path)[0]["blocks"].tolist():
                block = common(block_box(row, col), whole)
                if block.empty:
                    continue
                own.update(_keys(block, side))
                for key in _keys(grown(block, reach), side):
                    held.setdefault(key, set()).add(path)
        number = {path: k for k, path in enumerate(sources)}
        return [
            Part(*key, tuple(sorted(held[key], key=number.__getitem__)), self.path(*key))
            for key in sorted(own)
        ]

    def read(self, box: Box) -> SurfaceLayers:
        """Return the layers of a box of surface cells; zero where nothing was classified."""
        out = np.zeros((N_LAYERS, *box.shape), np.float32)
        for row, col in _keys(box, SIDE):
            values = _values(self.path(row, col))
            own = Box(row * SIDE, (row + 1) * SIDE, col * SIDE, (col + 1) * SIDE)
            part = common(own, box)
            if values is not None:
                out[(slice(None), *within(part, box))] = values[(slice(None), *within(part, own))]
        return SurfaceLayers(out)

    def over(self, box: Box) -> tuple[SurfaceLayers, NDArray[np.int64], NDArray[np.int64]]:
        """Return the layers under a box of near cells, and row and column in them of its rows and columns."""
        row, col = np.arange(box.row0, box.row1) // self.factor, np.arange(box.col0, box.col1) // self.factor
        found = self.read(Box(int(row[0]), int(row[-1]) + 1, int(col[0]), int(col[-1]) + 1))
        return found, row - row[0], col - col[0]

    def refused(self, box: Box, parameters: Parameters) -> NDArray[np.bool_] | None:
        """Return the mask of a box's near cells refused for their surface; None without such cells."""
        layers, row, col = self.over(box)
        refused = layers.refused(parameters)
        return refused[np.ix_(row, col)] if refused.any() else None

    def here(self, row: float, col: float, around: float) -> SurfaceHere:
        """Return the surface within a distance of a place; all in near cells of the lattice."""
        rows, cols = ([int(np.floor(at - around)), int(np.floor(at + around)) + 1] for at in (row, col))
        return self.over(Box(*rows, *cols))[0].here()


def classify_part(part: Part, parts: SurfaceParts, whole: Box, interval: tuple[int, int], datum: int) -> int:
    """Classify the surface of a part and write it; the file of an earlier run is reused. Return its cells."""
    if part.done.exists():
        return SIDE * SIDE
    factor = parts.factor
    wide = Box(
        (part.row * SIDE - MARGIN) * factor,
        ((part.row + 1) * SIDE + MARGIN) * factor,
        (part.col * SIDE - MARGIN) * factor,
        ((part.col + 1) * SIDE + MARGIN) * factor,
    )
    held = _cut(wide, whole, factor)
    shape = held.shape[0] // factor, held.shape[1] // factor
    fields, classes = _cells(part.sources, held, shape, factor, whole, interval, datum)
    classified = classify(fields, parts.cell_m * factor, classes)
    row, col = held.row0 // factor - part.row * SIDE, held.col0 // factor - part.col * SIDE
    own = Box(max(0, row), min(SIDE, row + shape[0]), max(0, col), min(SIDE, col + shape[1]))
    out = np.zeros((N_LAYERS, SIDE, SIDE), np.float16)
    out[:, own.row0 : own.row1, own.col0 : own.col1] = classified.values[
        :, own.row0 - row : own.row1 - row, own.col0 - col : own.col1 - col
    ]
    array_file.write(part.done, {"values": out})
    return SIDE * SIDE


def _cut(box: Box, whole: Box, factor: int) -> Box:
    """Return the part of a box within the survey, in whole surface cells."""
    low, high = common(box, whole), factor - 1
    return Box(
        low.row0 // factor * factor,
        (low.row1 + high) // factor * factor,
        low.col0 // factor * factor,
        (low.col1 + high) // factor * factor,
    )


def _cells(
    sources: Sequence[Path],
    box: Box,
    shape: tuple[int, int],
    factor: int,
    whole: Box,
    interval: tuple[int, int],
    datum: int,
) -> tuple[Floats, SurveyClasses]:
    sums, extreme = np.zeros((5, *shape), np.int64), np.zeros((*shape, 2), np.int32)
    classes, fields = np.zeros((*shape, CLASSES), np.int32), np.zeros((SURFACE_FIELDS, *shape), np.float32)
    for part in segments(sources, box):
        at = block_box(part.row, part.col)
        add_sums(
            part.cells, part.heights, part.marks, at.row0 - box.row0, at.col0 - box.col0, factor,
            *interval, datum, sums, extreme, classes,
        )  # fmt: skip
    n = np.maximum(sums[0], 1)
    mean = sums[1] / n
    deep, tall = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    for part in segments(sources, box):
        at = block_box(part.row, part.col)
        count_apart(
            part.cells, part.heights, at.row0 - box.row0, at.col0 - box.col0, factor, *interval,
            mean + datum, APART_M / UNIT_M, deep, tall,
        )  # fmt: skip
    fields[COUNT], fields[MEAN] = sums[0], mean * UNIT_M
    fields[SQUARES] = np.maximum(sums[2] - n * mean**2, 0) * UNIT_M**2
    fields[LOW], fields[HIGH] = (extreme[..., 0] - datum) * UNIT_M, (extreme[..., 1] - datum) * UNIT_M
    fields[DEEP], fields[TALL], fields[NUMBERED], fields[SEVERAL] = deep, tall, sums[3], sums[4]
    shares = np.moveaxis(classes, 2, 0).astype(np.float32)
    prior = SurveyClasses(shares[BUILDING], shares[LOW_PLANT], shares[TALL_PLANT], shares.sum(axis=0))
    return fields, prior


def _keys(box: Box, side: int) -> Iterator[tuple[int, int]]:
    return itertools.product(
        range(box.row0 // side, (box.row1 - 1) // side + 1),
        range(box.col0 // side, (box.col1 - 1) // side + 1),
    )


def _values(path: Path) -> NDArray[Any] | None:
    return array_file.read(path)[0]["values"] if path.exists() else None
