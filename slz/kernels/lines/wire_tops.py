"""Wires over cells: their heights as tops of known ground."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.cells.cell_record import TOP, WEIGHT
from slz.kernels.jit import kernel


@kernel
def raise_tops(
    points: Array2D[np.float64],
    west: float,
    south: float,
    cell: float,
    reach: int,
    cells: Array3D[np.float32],
) -> None:
    """Raise the tops of the cells under points (n, 3); unknown cells stay unknown.

    Where the cell below a point is unknown, the known ones within `reach` cells are raised: they may make it
    count as seen.

    Parameters
    ----------
    cells
        (6, rows, cols) of `slz.kernels.cells.cell_statistics.summarise`, from (west, south) on.
    """
    rows, cols = cells.shape[1:]
    for i in range(len(points)):
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if r < -reach or c < -reach or r >= rows + reach or c >= cols + reach:
            continue
        z = np.float32(points[i, 2])
        inside = 0 <= r < rows and 0 <= c < cols
        if inside and cells[WEIGHT, r, c] > 0:
            cells[TOP, r, c] = max(cells[TOP, r, c], z)
            continue
        for rr in range(max(0, r - reach), min(rows, r + reach + 1)):
            for cc in range(max(0, c - reach), min(cols, c + reach + 1)):
                if cells[WEIGHT, rr, cc] > 0:
                    cells[TOP, rr, cc] = max(cells[TOP, rr, cc], z)
