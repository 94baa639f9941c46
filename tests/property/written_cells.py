"""Cells of a map written by hand: a plane, with obstacles in single cells."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from slz.kernels.cells.cell_record import BOTTOM, HEIGHT, SPREAD, SUMMARY_LAYERS, TOP, WEIGHT

Cells = NDArray[np.float32]


def plane_with_obstacles(
    side: int, cell_m: float, slope: tuple[float, float], raised: Iterable[tuple[int, int, float]]
) -> Cells:
    """Return the summary of `side` x `side` cells of a plane that rises by `slope` to the east and north.

    raised: row, column and height over the plane of each obstacle (m).
    """
    row, col = np.mgrid[:side, :side] * cell_m
    cells = np.zeros((SUMMARY_LAYERS, side, side), np.float32)
    cells[[HEIGHT, BOTTOM, TOP]] = slope[0] * col + slope[1] * row
    cells[SPREAD], cells[WEIGHT] = 1e-6, 8
    for r, c, high_m in raised:
        cells[TOP, r, c] += high_m
    return cells
