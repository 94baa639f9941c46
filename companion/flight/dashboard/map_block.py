"""Map block for the browser: quantised cells, coarser levels, compressed encoding."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.flight.dashboard.quantise import (
    MIDDLE,
    NO_HEIGHT,
    NO_VALUE,
    STEP_M,
    halve,
    quantise,
)
from slz import UNKNOWN, DrawnTile

SIDE = 256  # cells per side of a block
# magic, cells per side, west, south, cell size, height of value 0, step of heights (m)
HEAD = struct.Struct("<4sIddddd")
MAGIC = b"SLZ1"
GZIP = 31  # zlib's window bits for the gzip format

Small = NDArray[np.uint8]


@dataclass(slots=True, eq=False)
class Block:
    """Quantised maps of `SIDE` x `SIDE` cells, row 0 southernmost.

    height: in steps above `base_m`, 0 unknown. slope, relief, certainty: in their steps, 255 unknown. state:
    0 unsafe, 1 safe, 255 unknown. version: increases with every change.
    """

    base_m: float
    height: NDArray[np.uint16]
    slope: Small
    relief: Small
    certainty: Small
    state: Small
    version: int = 0

    @property
    def planes(self) -> tuple[Small, Small, Small, Small]:
        return self.slope, self.relief, self.certainty, self.state


def empty(base_m: float) -> Block:
    """Return a block of unknown cells."""
    shape = SIDE, SIDE
    slope, relief, certainty = (np.full(shape, NO_VALUE) for _ in "src")
    return Block(base_m, np.zeros(shape, np.uint16), slope, relief, certainty, np.full(shape, UNKNOWN))


def write(block: Block, row: int, col: int, tile: DrawnTile) -> bool:
    """Write a tile's maps to a block at a row and column; return whether anything changed."""
    side = tile.state.shape[0]
    here = slice(row, row + side), slice(col, col + side)
    return bool(
        quantise(
            tile.height_m,
            tile.slope_deg,
            tile.relief_m,
            tile.certainty,
            tile.state,
            block.base_m,
            block.height[here],
            block.slope[here],
            block.relief[here],
            block.certainty[here],
            block.state[here],
        )
    )


def clear(block: Block, row: int, col: int, side: int) -> None:
    """Set a square of a block to unknown."""
    here = slice(row, row + side), slice(col, col + side)
    block.height[here] = NO_HEIGHT
    for plane in block.planes:
        plane[here] = NO_VALUE  # equals `UNKNOWN`


def coarser(children: dict[tuple[int, int], Block], base_m: float) -> Block:
    """Return the block with cells twice as wide over four blocks, by their row and column 0 or 1.

    Of four cells: mean of the known heights; greatest slope and relief, least certainty; unsafe if one is
    unsafe, else unknown if one is unknown. So small hazards stay visible.
    """
    block, half = empty(base_m), SIDE // 2
    for (row, col), child in children.items():
        here = slice(row * half, (row + 1) * half), slice(col * half, (col + 1) * half)
        shift = round((child.base_m - base_m) / STEP_M)
        halve(
            child.height,
            child.slope,
            child.relief,
            child.certainty,
            child.state,
            shift,
            block.height[here],
            block.slope[here],
            block.relief[here],
            block.certainty[here],
            block.state[here],
        )
    return block


def base_of(height_m: NDArray[np.float32]) -> float:
    """Return a base that keeps the heights around these in range: about 164 m below their median."""
    known = height_m[np.isfinite(height_m)]
    middle_m = float(np.median(known)) if known.size else 0.0
    return math.floor(middle_m) - MIDDLE * STEP_M


def encode(block: Block, west_m: float, south_m: float, cell_m: float) -> bytes:
    """Return a block as gzip: head, height differences along rows by low and high bytes, planes."""
    difference = np.diff(block.height, axis=1, prepend=np.uint16(0)).astype("<u2")
    parts = difference.view(np.uint8).reshape(SIDE, SIDE, 2)
    head = HEAD.pack(MAGIC, SIDE, west_m, south_m, cell_m, block.base_m, STEP_M)
    differences = [parts[:, :, byte].tobytes() for byte in (0, 1)]
    body = b"".join([head, *differences, *(plane.tobytes() for plane in block.planes)])
    packer = zlib.compressobj(1, zlib.DEFLATED, GZIP, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
    return packer.compress(body) + packer.flush()
