"""What fits into this machine's memory, asked before it is used."""

from __future__ import annotations

import math
import os

from companion.errors import UsageError

SHARE = 0.7  # of the machine's memory
MOST_CELLS = 200_000_000


def total_bytes() -> int:
    """Return the machine's memory."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_points(n_points: int, bytes_per_point: int) -> None:
    """Refuse more points than fit."""
    most = int(SHARE * total_bytes() / bytes_per_point)
    if n_points > most:
        raise UsageError(
            f"{n_points} points do not fit into memory, {most} would: map fewer files at a time, or thin them"
        )


def check_cells(width_m: float, height_m: float, cell_m: float, box_bytes: int, square_bytes: int) -> None:
    """Refuse a grid that does not fit; say which cell would.

    box_bytes: memory per cell of the extent. square_bytes: address space per cell of the square around it,
    whose untouched pages take no memory, but must be granted.
    """
    box = width_m * height_m / cell_m**2
    square = (max(width_m, height_m) / cell_m) ** 2
    budget = SHARE * total_bytes()
    excess = max(box / MOST_CELLS, box * box_bytes / budget, square * square_bytes / budget)
    if excess > 1:
        fits = math.ceil(cell_m * math.sqrt(excess) * 1.01 * 100) / 100
        raise UsageError(
            f"{width_m:.0f} m x {height_m:.0f} m are too many cells of {cell_m:g} m:"
            f" --cell-m {fits:g} would do, or map fewer files at a time"
        )
