"""Planes through the returns of square windows of surface cells: level, gradient and residual."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.jit import kernel
from slz.kernels.surface.surface_record import GRADIENT, LEVEL, PLANE_LAYERS, RESIDUAL, N

PLANE_RADIUS = 2  # cells
SUMS = 10  # n, x, y, z, xx, yy, xy, xz, yz, zz
FEWEST = 8.0  # returns of a window that make a plane
FEWEST_CELLS = 5.0


@kernel
def smooth_planes(
    count: Array2D[np.float32],
    mean: Array2D[np.float32],
    squares: Array2D[np.float32],
    cell: float,
) -> Array3D[np.float32]:
    """Return (4, rows, cols): returns, height of the plane at the mean place, gradient and rms residual.

    The window of a cell spans `PLANE_RADIUS` cells to every side; the last three are NaN where it holds too
    few returns. Returns count at the centre of their cell.

    Parameters
    ----------
    count, mean, squares
        (rows, cols) of each cell: number, mean height (m) and sum of squared deviations (m2).
    cell
        Side of a cell (m).
    """
    rows, cols = count.shape
    out = np.full((PLANE_LAYERS, rows, cols), np.nan, np.float32)
    column, cells = np.zeros((cols, SUMS)), np.zeros(cols)  # sums over the rows of the window, by column
    base = 0.0
    for r in range(rows):
        for c in range(cols):
            if count[r, c] > 0 and base == 0.0:
                base = float(mean[r, c])
    for r in range(-PLANE_RADIUS, rows):
        for sign, row in ((1.0, r + PLANE_RADIUS), (-1.0, r - PLANE_RADIUS - 1)):
            if row < 0 or row >= rows:
                continue
            for c in range(cols):
                n = float(count[row, c])
                if n > 0.0:
                    z, y = float(mean[row, c]) - base, row * cell
                    n *= sign
                    cells[c] += sign
                    column[c, 0] += n
                    column[c, 2] += n * y
                    column[c, 3] += n * z
                    column[c, 5] += n * y * y
                    column[c, 8] += n * y * z
                    column[c, 9] += n * z * z + sign * float(squares[row, c])
        if r < 0:
            continue
        n = sx = sy = sz = sxx = syy = sxy = sxz = syz = szz = seen = 0.0
        for c in range(-PLANE_RADIUS, cols):
            for sign, at in ((1.0, c + PLANE_RADIUS), (-1.0, c - PLANE_RADIUS - 1)):
                if at < 0 or at >= cols:
                    continue
                x = at * cell
                n += sign * column[at, 0]
                seen += sign * cells[at]
                sx += sign * column[at, 0] * x
                sy += sign * column[at, 2]
                sz += sign * column[at, 3]
                sxx += sign * column[at, 0] * x * x
                syy += sign * column[at, 5]
                sxy += sign * column[at, 2] * x
                sxz += sign * column[at, 3] * x
                syz += sign * column[at, 8]
                szz += sign * column[at, 9]
            if c < 0:
                continue
            out[N, r, c] = n
            if n < FEWEST or seen < FEWEST_CELLS:
                continue
            mx, my, mz = sx / n, sy / n, sz / n
            xx, yy, xy = sxx / n - mx * mx, syy / n - my * my, sxy / n - mx * my
            xz, yz, zz = sxz / n - mx * mz, syz / n - my * mz, szz / n - mz * mz
            determinant = xx * yy - xy * xy
            if not determinant > 0.01 * cell**4:  # the cells are in a line
                continue
            a, b = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
            out[LEVEL, r, c] = base + mz
            out[GRADIENT, r, c] = np.sqrt(a * a + b * b)
            out[RESIDUAL, r, c] = np.sqrt(max(0.0, zz - a * xz - b * yz))
    return out
