"""Memory limits: refusal of clouds and grids that do not fit into this machine's memory."""

from __future__ import annotations

import math
import os
from pathlib import Path

from companion.runtime.errors import UsageError

SHARE = 0.7  # of the machine's memory
MOST_CELLS = 200_000_000
POINT_BYTES = 130  # per point at the peak of a survey, measured
BOX_BYTES = 160  # per cell of the cloud's extent, measured
SQUARE_BYTES = 64  # per cell of the square around it: the largest array, whose unused pages take no memory


def total_bytes() -> int:
    """Return the machine's physical memory."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_points(n_points: int) -> None:
    """Refuse more points than fit."""
    most = int(SHARE * total_bytes() / POINT_BYTES)
    if n_points > most:
        raise UsageError(
            f"{n_points} points do not fit into memory, {most} would: map fewer files at a time, or thin them"
        )


def check_bytes(n_bytes: int, path: Path) -> None:
    """Refuse a file with a part that must be held at once and does not fit."""
    most = int(SHARE * total_bytes())
    if n_bytes > most:
        raise UsageError(f"{path}: its {n_bytes} bytes do not fit into memory, {most} would: split it")


def check_cells(width_m: float, height_m: float, cell_m: float, n_points: int) -> None:
    """Refuse a grid that does not fit beside the points; the error names a cell size that would."""
    box = width_m * height_m / cell_m**2
    square = (max(width_m, height_m) / cell_m) ** 2
    memory = total_bytes()
    room = max(SHARE * memory - n_points * POINT_BYTES, 0.05 * memory)
    excess = max(box / MOST_CELLS, box * BOX_BYTES / room, square * SQUARE_BYTES / (0.9 * memory))
    if excess > 1:
        fits = math.ceil(cell_m * math.sqrt(excess) * 1.01 * 100) / 100
        raise UsageError(
            f"{width_m:.0f} m x {height_m:.0f} m are too many cells of {cell_m:g} m:"
            f" --cell-m {fits:g} would do, or map fewer files at a time"
        )
