"""Boundary point filter: removal of collinear points (SLZ paper, section 3.4.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.polygons.contour import corner_indices


def without_collinear(boundary_cells: NDArray[np.int32]) -> NDArray[np.int32]:
    """Drop points between two neighbours in the same row or the same column (SLZ paper, Algorithm 2).

    The algorithm as printed also loses corners where a run in x meets a diagonal. Here a point is dropped
    only between two neighbours of its row, or of its column, so the polygon is unchanged.

    Parameters
    ----------
    boundary_cells
        (n, 2) rows and columns of a closed contour.
    """
    return boundary_cells[corner_indices(np.ascontiguousarray(boundary_cells, np.int32))]
