"""Even falls: the surface of a river falls along it, by less than 0.5 %, and is a plane over some ten metres.

So is a lake in a survey whose heights are tilted. Ground that falls so little undulates by centimetres.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel_part
from slz.kernels.surface.masks import bounding_boxes

BLOCK_M = 16.0  # side of the blocks in which an extent that falls is a plane
FEW = 0.2  # cells2 added to the spread of a block: one of few cells has no gradient


@kernel_part
def even_falls(
    labels: Array2D[np.int32], height: Array2D[np.float32], falling: Array1D[np.bool_], cell: float
) -> tuple[Array2D[np.float64], Array1D[np.float64], Array1D[np.float64]]:
    """Fit planes to the blocks of extents that may fall.

    Return (rows, cols) the height above them, and of each label its variance, and the mean gradient.

    Parameters
    ----------
    labels, falling
        (rows, cols) of the extents, 0 for none, and whether each label is one that may fall.
    """
    n, side, off, steep = len(falling), int(BLOCK_M / cell), np.zeros(labels.shape), np.zeros(labels.shape)
    size, variance, gradient = np.zeros(n), np.zeros(n), np.zeros(n)
    any_falls = False
    for label in range(1, n):
        any_falls |= falling[label]
    if not any_falls:
        return off, variance, gradient
    boxes = bounding_boxes(labels, n, 0)
    for label in range(1, n):
        if falling[label]:
            box = boxes[label]
            for row in range(box[0] // side * side, box[1] + 1, side):
                for col in range(box[2] // side * side, box[3] + 1, side):
                    _fit(labels, height, label, row, col, side, cell, off, steep)
    for k in range(labels.size):
        own = labels.flat[k]
        if falling[own]:
            size[own] += 1
            variance[own] += off.flat[k] * off.flat[k]
            gradient[own] += steep.flat[k]
    for label in range(1, n):
        if size[label] > 0:
            variance[label], gradient[label] = variance[label] / size[label], gradient[label] / size[label]
    return off, variance, gradient


@kernel_part
def _fit(
    labels: Array2D[np.int32],
    height: Array2D[np.float32],
    label: int,
    row: int,
    col: int,
    side: int,
    cell: float,
    off: Array2D[np.float64],
    steep: Array2D[np.float64],
) -> None:
    """Write heights above the plane through a label's cells in the block from a cell on, and its gradient."""
    n = mx = my = mz = xx = yy = xy = xz = yz = 0.0
    end_row, end_col = min(row + side, labels.shape[0]), min(col + side, labels.shape[1])
    for r in range(row, end_row):
        for c in range(col, end_col):
            if labels[r, c] == label:
                n, mx, my, mz = n + 1, mx + cell * c, my + cell * r, mz + height[r, c]
    if n == 0:
        return
    mx, my, mz = mx / n, my / n, mz / n
    for r in range(row, end_row):
        for c in range(col, end_col):
            if labels[r, c] == label:
                x, y, z = cell * c - mx, cell * r - my, height[r, c] - mz
                xx, yy, xy, xz, yz = xx + x * x, yy + y * y, xy + x * y, xz + x * z, yz + y * z
    xx, yy, xy, xz, yz = xx / n + FEW * cell**2, yy / n + FEW * cell**2, xy / n, xz / n, yz / n
    determinant = xx * yy - xy * xy
    a, b = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    for r in range(row, end_row):
        for c in range(col, end_col):
            if labels[r, c] == label:
                x, y, z = cell * c - mx, cell * r - my, height[r, c] - mz
                off[r, c] = z - a * x - b * y
                steep[r, c] = math.hypot(a, b)
