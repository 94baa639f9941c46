"""Dense arrays of surface cells, from which the rules tell the kinds of surface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.neighbourhood import greatest_around
from slz.kernels.surface.smooth_planes import smooth_planes
from slz.kernels.surface.surface_record import (
    COUNT,
    GRADIENT,
    LEVEL,
    MEAN,
    RESIDUAL,
    SQUARES,
    SURFACE_FIELDS,
    N,
)

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
PLANE_RADIUS = 2  # cells


@dataclass(frozen=True)
class SurfaceCells:
    """Evidence of a box of surface cells.

    fields: (SURFACE_FIELDS, rows, cols) of `slz.kernels.surface.surface_record`. cell_m: side of a cell.
    """

    fields: Floats
    cell_m: float

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.fields.shape[1], self.fields.shape[2]

    @cached_property
    def seen(self) -> Flags:
        """Cells with a return whose height counts."""
        return np.asarray(self.fields[COUNT] > 0)

    @property
    def mean_m(self) -> Floats:
        """Mean height of the returns; meaningless where nothing was seen."""
        return np.asarray(self.fields[MEAN])

    @cached_property
    def spread_m(self) -> Floats:
        """Standard deviation of the heights within a cell, 0 where nothing was seen."""
        n = np.maximum(self.fields[COUNT], 1)
        return np.asarray(np.sqrt(np.maximum(self.fields[SQUARES], 0) / n), np.float32)

    @cached_property
    def _planes(self) -> Floats:
        count, mean, squares = (np.ascontiguousarray(self.fields[f]) for f in (COUNT, MEAN, SQUARES))
        return smooth_planes(count, mean, squares, PLANE_RADIUS, self.cell_m)

    @property
    def n_around(self) -> Floats:
        """Returns of the window around a cell, `PLANE_RADIUS` cells to every side."""
        return np.asarray(self._planes[N])

    @property
    def level_m(self) -> Floats:
        """Height of the plane through that window."""
        return np.asarray(self._planes[LEVEL])

    @property
    def gradient(self) -> Floats:
        """Gradient of that plane."""
        return np.asarray(self._planes[GRADIENT])

    @property
    def residual_m(self) -> Floats:
        """Residual of that plane, root mean square."""
        return np.asarray(self._planes[RESIDUAL])

    def coarser(self) -> SurfaceCells:
        """Return the shape of the ground in cells twice as wide; other fields are left empty."""
        rows, cols = (-(-n // 2) for n in self.shape)
        parts = np.zeros((SURFACE_FIELDS, 2 * rows, 2 * cols), np.float32)
        parts[:, : self.shape[0], : self.shape[1]] = self.fields
        parts = parts.reshape(SURFACE_FIELDS, rows, 2, cols, 2)
        count, mean = parts[COUNT].astype(np.float64), parts[MEAN].astype(np.float64)
        total = count.sum(axis=(1, 3))
        middle = (count * mean).sum(axis=(1, 3)) / np.maximum(total, 1)
        off = mean - middle[:, None, :, None]
        out = np.zeros((SURFACE_FIELDS, rows, cols), np.float32)
        out[COUNT], out[MEAN] = total, middle
        out[SQUARES] = (parts[SQUARES] + count * off**2).sum(axis=(1, 3))
        return SurfaceCells(out, 2 * self.cell_m)


def around(flags: Flags, radius: int) -> Flags:
    """Return the cells within squares of `radius` cells around the flagged ones."""
    return greatest_around(flags.astype(np.int32), radius) > 0


def averages(own: NDArray[np.int32], values: NDArray[np.floating], n: int) -> NDArray[np.float64]:
    """Return the average of the values of each of n labels, 0 where none is."""
    return np.asarray(np.bincount(own, values, n) / np.maximum(np.bincount(own, minlength=n), 1))


def with_margin(labels: NDArray[np.int32], n: int, margin: int) -> Iterator[tuple[int, tuple[slice, slice]]]:
    """Yield each label from 1 to n - 1 that is there, and the slices of its cells with a margin."""
    for label, found in enumerate(ndimage.find_objects(labels, n - 1), start=1):
        if found is not None:
            rows, cols = found
            yield (
                label,
                (
                    slice(max(0, rows.start - margin), rows.stop + margin),
                    slice(max(0, cols.start - margin), cols.stop + margin),
                ),
            )
