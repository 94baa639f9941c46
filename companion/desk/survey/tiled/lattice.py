"""Cell lattice of a survey, counted from the zero of its CRS: independent of tiles, files and strays."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from slz import Box
from slz.kernels.survey.point_binning import BLOCK

UNIT_M = 1e-4  # of heights, stored as 32-bit integers: up to 214 km
MOST_HEIGHT_M = 20_000.0  # no ground, cloud or aircraft with a LiDAR is higher or deeper


@dataclass(frozen=True, slots=True)
class Lattice:
    """Metres per unit of x, y and z of the CRS, and the side of a cell (m).

    Cell (row, col) covers y from row * cell_m / y_m and x from col * cell_m / x_m. Blocks are squares of
    `BLOCK` cells, tiles are squares of blocks; both begin at cell (0, 0).
    """

    x_m: float
    y_m: float
    z_m: float
    cell_m: float

    def document(self) -> dict[str, Any]:
        """Return the JSON object for a manifest."""
        return asdict(self)


def block_box(row: int, col: int) -> Box:
    """Return the cells of a block."""
    return Box(row * BLOCK, (row + 1) * BLOCK, col * BLOCK, (col + 1) * BLOCK)


def grown(box: Box, cells: int) -> Box:
    """Return a box grown by a margin."""
    return Box(box.row0 - cells, box.row1 + cells, box.col0 - cells, box.col1 + cells)
