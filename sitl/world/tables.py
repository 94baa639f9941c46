"""Types of the kernel tables that represent a world (built in ``sitl.world.world``)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
I32 = NDArray[np.int32]

INF = math.inf
WATER_KIND = 12

GroundTable = tuple[F64, U8, F64]
"""(posts z (ny, nx), kind (ny-1, nx-1), [x0, y0, post_m])."""
SolidTable = tuple[U8, F64, U8]
"""(shape (n,), row (n, 8), kind (n,))."""
GridTable = tuple[F64, F64, F64, I32, I32]
"""([cell_m, z_floor, z_top], ground top (cy, cx), any top (cy, cx), start (cells + 1,), item (k,))."""
MoverTable = tuple[U8, F64, U8, F64]
"""SolidTable of moving solids, and their bounding spheres (n, 4)."""

F2 = types.Array(types.float64, 2, "C")
F1 = types.Array(types.float64, 1, "C")
U2 = types.Array(types.uint8, 2, "C")
U1 = types.Array(types.uint8, 1, "C")
I1 = types.Array(types.int32, 1, "C")
_tuple: Any = types.Tuple
GROUND = _tuple((F2, U2, F1))
SOLIDS = _tuple((U1, F2, U1))
GRID = _tuple((F1, F2, F2, I1, I1))
MOVERS = _tuple((U1, F2, U1, F2))
