"""Types of the kernel tables that represent a world (built in ``sitl.world.world``)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array1D, Array2D

F64 = NDArray[np.float64]

INF = math.inf

GroundTable = tuple[Array2D[np.float64], Array2D[np.uint8], Array1D[np.float64]]
"""(posts z (ny, nx), kind (ny-1, nx-1), [x0, y0, post_m])."""
SolidTable = tuple[Array1D[np.uint8], Array2D[np.float64], Array1D[np.uint8]]
"""(shape (n,), row (n, 8), kind (n,))."""
GridTable = tuple[
    Array1D[np.float64], Array2D[np.float64], Array2D[np.float64], Array1D[np.int32], Array1D[np.int32]
]
"""([cell_m, z_floor, z_top], ground top (cy, cx), any top (cy, cx), start (cells + 1,), item (k,))."""
MoverTable = tuple[Array1D[np.uint8], Array2D[np.float64], Array1D[np.uint8], Array2D[np.float64]]
"""SolidTable of moving solids, and their bounding spheres (n, 4)."""
OpaqueTable = tuple[GroundTable, SolidTable, GridTable, MoverTable]
"""All that stops a ray."""
WireTable = tuple[
    Array2D[np.float64],
    Array1D[np.int64],
    Array1D[np.float64],
    Array2D[np.float64],
    Array2D[np.float64],
    Array1D[np.int32],
    Array1D[np.int32],
]
"""(row (n, 8): ends, radius, reflectance; number of the solid (n,); [cell_m, x0, y0, low, top]; low (cy, cx)
and top (cy, cx) of what may touch a footprint; start (cells + 1,), item (k,))."""
LayerTable = tuple[Array2D[np.float64], Array2D[np.uint8], Array2D[np.float64], Array1D[np.float64]]
"""(water level (ny-1, nx-1), plant (ny-1, nx-1), plants (k, 6) as in ``Plants.row``, [top])."""
