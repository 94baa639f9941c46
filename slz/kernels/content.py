"""What a contour encloses, and which of it is one component (SLZ paper Algorithm 1), 64 cells at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import ALL, LAST, NONE, ONE, Bits, popcount, prefix_xor, signed
from slz.kernels.jit import kernel
from slz.kernels.tour import EAST, WEST


@kernel("int64(int32[:, ::1], uint8[::1], int64, int64, int64, uint64[:, ::1])")
def fill(
    path: NDArray[np.int32], edges: NDArray[np.uint8], n: int, row0: int, word0: int, content: Bits
) -> Any:
    """Set the cells on and inside a tour in a box that holds zeros; return how many there are.

    A row's cells are inside between a western and an eastern edge: mark where that changes, add up modulo 2.
    """
    rows, words = content.shape
    for i in range(n):
        r, c = path[i, 0] - row0, path[i, 1] - 64 * word0
        if edges[i] & WEST:
            content[r, c >> 6] ^= ONE << np.uint64(c & 63)
        if edges[i] & EAST and (c + 1) >> 6 < words:
            content[r, (c + 1) >> 6] ^= ONE << np.uint64((c + 1) & 63)
    count = np.uint64(0)
    for r in range(rows):
        inside = NONE
        for w in range(words):
            word = prefix_xor(content[r, w]) ^ inside
            content[r, w] = word
            count += popcount(word)
            inside = ALL if word >> LAST else NONE
    return signed(count)


@kernel("uint64(uint64, uint64)")
def _down(room: np.uint64, set_: np.uint64) -> np.uint64:
    """Spread set cells towards lower columns as far as the room goes."""
    for shift in (1, 2, 4, 8, 16, 32):
        set_ |= room & (set_ >> np.uint64(shift))
        room &= room >> np.uint64(shift)
    return set_


@kernel("boolean(uint64[:, ::1], uint64[:, ::1], int64, int64)")
def _spread(room: Bits, part: Bits, r: int, other: int) -> bool:
    """Spread a part into row r from itself and from another row beside it; tell whether it grew there."""
    words = room.shape[1]
    carry, changed = NONE, False
    for w in range(words):
        free, old = room[r, w], part[r, w]
        if free == old:
            carry = old >> LAST
            continue
        near = part[other, w]
        wide = near | (near << ONE) | (near >> ONE)
        if w > 0:
            wide |= part[other, w - 1] >> LAST
        if w < words - 1:
            wide |= part[other, w + 1] << LAST
        new = (old | (wide & free)) | (carry & free)
        if new != NONE:
            new |= (free ^ (free + new)) & free  # runs through to the end of each stretch of room
        carry = new >> LAST
        if new != old:
            part[r, w], changed = new, True
    if not changed:
        return False
    carry = NONE
    for w in range(words - 1, -1, -1):
        free, old = room[r, w], part[r, w]
        if free == old:
            carry = (old & ONE) << LAST
            continue
        new = old | (carry & free)
        if new != NONE:
            new = _down(free, new)
        carry = (new & ONE) << LAST
        part[r, w] = new
    return True


@kernel("uint64[:, ::1](uint64[:, ::1], int64, int64)")
def component(room: Bits, row: int, col: int) -> Bits:
    """Return the 8-connected component of a set cell.

    Rows are gone through up and down, and only those beside one in which the part grew since.
    """
    rows = room.shape[0]
    part = np.zeros(room.shape, np.uint64)
    part[row, col >> 6] = ONE << np.uint64(col & 63)
    from_south, from_north = np.zeros(rows + 2, np.bool_), np.zeros(rows + 2, np.bool_)  # with a margin
    _spread(room, part, row, row)
    from_south[row + 2] = from_north[row] = True
    low, high, moved = row, row, True
    while moved:
        moved = False
        for r in range(max(1, low), rows):
            if not from_south[r + 1]:
                if r > high:
                    break
                continue
            from_south[r + 1] = False
            if _spread(room, part, r, r - 1):
                from_south[r + 2] = from_north[r] = True
                high, moved = max(high, r), True
        for r in range(min(rows - 2, high), -1, -1):
            if not from_north[r + 1]:
                if r < low:
                    break
                continue
            from_north[r + 1] = False
            if _spread(room, part, r, r + 1):
                from_south[r + 2] = from_north[r] = True
                low, moved = min(low, r), True
    return part


@kernel("uint64[:, ::1](uint64[:, ::1], uint64[:, ::1], int64, int64, int64, int64)")
def part_of(content: Bits, safe: Bits, row0: int, word0: int, row: int, col: int) -> Bits:
    """Return the component of a safe cell, by the map's row and column, that lies in a content."""
    room = np.empty_like(content)
    for i in range(content.shape[0]):
        for j in range(content.shape[1]):
            room[i, j] = content[i, j] & safe[row0 + i, word0 + j]
    return component(room, row - row0, col - 64 * word0)
