"""Invented ground, its returns binned into surface cells by NumPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.surface.smooth_planes import smooth_planes
from slz.kernels.surface.surface_record import (
    APART_M,
    COUNT,
    DEEP,
    HIGH,
    LOW,
    MEAN,
    SQUARES,
    SURFACE_FIELDS,
    TALL,
)
from slz.surface import classification
from slz.surface.classification import SurfaceLayers, SurveyClasses, level_extents

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Shape = Callable[[Floats, Floats], Floats]
SUSPICION = 0.05  # probability of water above which ground is refused


@dataclass(frozen=True)
class SurfaceCells:
    """Evidence of a box of surface cells: (SURFACE_FIELDS, rows, cols), and side of a cell."""

    fields: NDArray[np.float32]
    cell_m: float

    @property
    def shape(self) -> tuple[int, int]:
        return self.fields.shape[1], self.fields.shape[2]

    @property
    def seen(self) -> Flags:
        return np.asarray(self.fields[COUNT] > 0)


def classify(
    cells: SurfaceCells,
    classes: SurveyClasses | None = None,
    shape: NDArray[np.float32] | None = None,
) -> SurfaceLayers:
    return classification.classify(cells.fields, cells.cell_m, classes, shape)


def cells_of(points: Floats, rows: int, cols: int, cell_m: float = 1.0) -> SurfaceCells:
    """Bin points (n, 3) into cells from (0, 0) on."""
    row, col = (np.floor(points[:, k] / cell_m).astype(int) for k in (1, 0))
    at, z, size = row * cols + col, points[:, 2], rows * cols
    n = np.bincount(at, minlength=size)
    mean = np.bincount(at, z, size) / np.maximum(n, 1)
    low, high = np.full(size, np.inf), np.full(size, -np.inf)
    np.minimum.at(low, at, z)
    np.maximum.at(high, at, z)
    off = z - mean[at]
    fields = np.zeros((SURFACE_FIELDS, size), np.float32)
    fields[COUNT], fields[MEAN], fields[SQUARES] = n, mean, np.bincount(at, off**2, size)
    fields[LOW], fields[HIGH] = np.where(n > 0, low, 0), np.where(n > 0, high, 0)
    fields[DEEP], fields[TALL] = (np.bincount(at, side * off > APART_M, size) for side in (-1, 1))
    return SurfaceCells(fields.reshape(SURFACE_FIELDS, rows, cols), cell_m)


def returns_of(
    height: Shape, side_m: float, per_m2: float = 4.0, noise_m: float = 0.012, seed: int = 1
) -> Floats:
    """Return scattered returns (n, 3) of a square of ground, whose height is a function of x and y."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side_m, (round(per_m2 * side_m**2), 2))
    z = height(xy[:, 0], xy[:, 1]) + rng.normal(0, noise_m, len(xy))
    return np.column_stack([xy, z])


def made(
    height: Shape, side_m: int = 80, per_m2: float = 4.0, noise_m: float = 0.012, seed: int = 1
) -> SurfaceCells:
    """Return the cells of a square of ground."""
    return cells_of(returns_of(height, side_m, per_m2, noise_m, seed), side_m, side_m)


def from_middle(x: Floats, y: Floats, middle_m: float = 40.0) -> Floats:
    return np.hypot(x - middle_m, y - middle_m)


def lake(radius_m: float = 20.0, bank: float = 0.1) -> Shape:
    """Level water amid an 80 m square, with banks that rise from its shore."""
    return lambda x, y: bank * np.maximum(0, from_middle(x, y) - radius_m)


def places(side: int) -> tuple[Floats, Floats]:
    """Return x and y of the cells' centres, (side, side) each."""
    at = np.arange(side) + 0.5
    x, y = np.meshgrid(at, at)
    return x, y


def emptied(cells: SurfaceCells, empty: Flags) -> SurfaceCells:
    """Return cells of which some were not seen."""
    return SurfaceCells(np.where(empty, np.float32(0), cells.fields), cells.cell_m)


def extents_of(cells: SurfaceCells) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float64]]:
    """Return labels and level of the extents of cells, and the log odds for water of each label."""
    f = cells.fields
    planes = smooth_planes(f[COUNT], f[MEAN], f[SQUARES], cells.cell_m)
    return level_extents(f, planes, cells.cell_m, is_far=True)


def with_fields(cells: SurfaceCells, values: Mapping[int, float | NDArray[Any]]) -> SurfaceCells:
    """Return cells with other fields."""
    fields = cells.fields.copy()
    for field, value in values.items():
        fields[field] = value
    return SurfaceCells(fields, cells.cell_m)
