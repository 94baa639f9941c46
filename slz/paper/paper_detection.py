"""Zone search by the paper's rule, updated incrementally (SLZ paper, section 3.3 and Algorithm 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.array_memory import demand_zeros
from slz.kernels.paper.zone_search import N_BOUNDARY, search_zones
from slz.kernels.raster.morphology import erode
from slz.paper.paper_terrain import PaperTerrain

Bits = NDArray[np.uint64]
LEAST_TRACE = 4096  # boundary cells that fit at least


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Component of the binary map that holds a safe square, with everything inside its contour.

    boundary_cells: (n, 2) traced rows and columns of the grid, from the first cell on. content: (rows, words)
    bitmap of the cells on and inside the contour, from the word of the box's first column on. n_cells: number
    of cells of the content.
    """

    box: Box
    boundary_cells: NDArray[np.int32]
    content: Bits
    n_cells: int

    @property
    def words(self) -> slice:
        """Words of the map that the content covers."""
        return slice(self.box.col0 >> 6, ((self.box.col1 - 1) >> 6) + 1)

    def holds(self, row: int, col: int) -> bool:
        """Return whether a cell is on or inside the contour."""
        box = self.box
        if not (box.row0 <= row < box.row1 and box.col0 <= col < box.col1):
            return False
        word = int(self.content[row - box.row0, (col >> 6) - (box.col0 >> 6)])
        return bool(word >> (col & 63) & 1)


class PaperDetection:
    """The zones of a terrain, found anew only where the safety of cells changed.

    A zone exists only where a safe square fits. A bitmap marks where squares fit, and components are traced
    from its bits only, so that the many components that are too small are never visited. A component is
    unchanged if no change touches its box.

    Parameters
    ----------
    least_side
        Side of the safe square, cells.
    least_boundary
        Boundary cells that a zone must have.
    """

    def __init__(self, terrain: PaperTerrain, least_side: int, least_boundary: int) -> None:
        self._terrain = terrain
        self.side, self._boundary = least_side, least_boundary
        self.squares, self._taken = (demand_zeros(terrain.safe_bits.shape, np.uint64) for _ in "st")
        self._parts: list[Part] = []
        self._longest = LEAST_TRACE
        self._found: tuple[Part, ...] = ()

    def update(self) -> tuple[Part, ...]:
        """Return the present zones in the order of their first cells; the same tuple if none changed.

        Everything inside a zone's contour belongs to it, so an inner component is no zone of its own. So a
        court inside a ring of safe ground is never found; `search_components` finds it.
        """
        changed = self._terrain.pop_changed_box()
        if changed.empty:
            return self._found
        try:
            return self._updated(changed)
        except BaseException:  # the next search repeats what this one missed
            self._terrain.changed = changed
            self._taken = demand_zeros(self._taken.shape, np.uint64)
            raise

    def _updated(self, changed: Box) -> tuple[Part, ...]:
        edges = erode(
            self._terrain.safe_bits, self.squares, self.side,
            changed.row0, changed.row1, changed.col0, changed.col1,
        )  # fmt: skip
        row0, row1, word0, word1 = edges
        kept = []
        for part in self._parts:
            box = part.box
            if _near(box, changed):
                row0, row1 = min(row0, box.row0), max(row1, box.row1)
                word0, word1 = min(word0, part.words.start), max(word1, part.words.stop)
            else:
                kept.append(part)
        fresh = self._traced(kept, row0, row1, word0, word1)
        if not fresh and len(kept) == len(self._parts):
            return self._found
        self._parts = sorted(kept + fresh, key=lambda part: tuple(part.boundary_cells[0].tolist()))
        self._found = _outermost(self._parts)
        return self._found

    def _traced(self, kept: list[Part], row0: int, row1: int, word0: int, word1: int) -> list[Part]:
        """Return the components with a square in a range of rows and words, except inside the kept ones."""
        taken = self._taken
        for part in kept:
            box, words = part.box, part.words
            if box.row0 < row1 and row0 < box.row1 and words.start < word1 and word0 < words.stop:
                taken[box.row0 : box.row1, words] |= part.content
        table, boundary, content, spread = search_zones(
            self._terrain.safe_bits, self.squares, taken, row0, row1, word0, word1, self._boundary,
            self._longest + self._longest // 4,
        )  # fmt: skip
        rows = table.tolist()
        self._longest = max([LEAST_TRACE, *(row[N_BOUNDARY] for row in rows)])
        low, high, left, right = spread.tolist()
        taken[low:high, left:right] = 0
        for part in kept:
            taken[part.box.row0 : part.box.row1, part.words] = 0
        return [_part(row, boundary, content) for row in rows]


def _part(row: list[int], boundary: NDArray[np.int32], content: Bits) -> Part:
    row0, row1, col0, col1, n_cells, n_boundary, boundary_at, content_at = row
    rows, words = row1 - row0, ((col1 - 1) >> 6) + 1 - (col0 >> 6)
    return Part(
        box=Box(row0, row1, col0, col1),
        boundary_cells=boundary[boundary_at : boundary_at + n_boundary],
        content=content[content_at : content_at + rows * words].reshape(rows, words),
        n_cells=n_cells,
    )


def _near(box: Box, changed: Box) -> bool:
    """Return whether a change is in a box or next to it."""
    rows = changed.row0 <= box.row1 and box.row0 <= changed.row1
    return rows and changed.col0 <= box.col1 and box.col0 <= changed.col1


def _outermost(parts: list[Part]) -> tuple[Part, ...]:
    """Return the parts, sorted by their first cells, that are not inside another one."""
    found: list[Part] = []
    for part in parts:
        row, col = part.boundary_cells[0].tolist()
        if not any(other.holds(row, col) for other in found):
            found.append(part)
    return tuple(found)
