"""A square of the map as a browser takes it: small numbers, coarser copies, compressed bytes."""

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

SIDE = 256  # cells along the side of a block
# magic, cells along the side, west, south, cell, height of number 0, step of heights (m)
HEAD = struct.Struct("<4sIddddd")
MAGIC = b"SLZ1"
GZIP = 31  # zlib's number for that format

Small = NDArray[np.uint8]


@dataclass(slots=True, eq=False)
class Block:
    """Maps of `SIDE` x `SIDE` cells in small numbers, row 0 the southernmost.

    height: in steps above `base_m`, 0 unknown. slope, relief, certainty: in their steps, 255 unknown. state:
    0 unsafe, 1 safe, 255 unknown. version: rises with every change.
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
    """Return a block of which nothing is known."""
    shape = SIDE, SIDE
    slope, relief, certainty = (np.full(shape, NO_VALUE) for _ in "src")
    return Block(base_m, np.zeros(shape, np.uint16), slope, relief, certainty, np.full(shape, UNKNOWN))


def write(block: Block, row: int, col: int, tile: DrawnTile) -> bool:
    """Put a tile's maps into a block at a row and column; tell whether anything changed."""
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
    """Forget a square of a block."""
    here = slice(row, row + side), slice(col, col + side)
    block.height[here] = NO_HEIGHT
    for plane in block.planes:
        plane[here] = NO_VALUE  # which is also `UNKNOWN`


def coarser(children: dict[tuple[int, int], Block], base_m: float) -> Block:
    """Return the block of cells twice as wide over four blocks, by their row and column 0 or 1.

    Of four cells: mean height of those known; the steepest, the greatest relief, the least certainty; unsafe
    where one is unsafe, else unknown where one is unknown. So what is small and bad stays in sight.
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
    """Return a base from which the heights around these are in range: 163 m below their middle, to 1 m."""
    known = height_m[np.isfinite(height_m)]
    middle_m = float(np.median(known)) if known.size else 0.0
    return math.floor(middle_m) - MIDDLE * STEP_M


def encode(block: Block, west_m: float, south_m: float, cell_m: float) -> bytes:
    """Return a block compressed (gzip): head, height differences along rows by low and high bytes, planes."""
    difference = np.diff(block.height, axis=1, prepend=np.uint16(0)).astype("<u2")
    parts = difference.view(np.uint8).reshape(SIDE, SIDE, 2)
    head = HEAD.pack(MAGIC, SIDE, west_m, south_m, cell_m, block.base_m, STEP_M)
    differences = [parts[:, :, byte].tobytes() for byte in (0, 1)]
    body = b"".join([head, *differences, *(plane.tobytes() for plane in block.planes)])
    packer = zlib.compressobj(1, zlib.DEFLATED, GZIP, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
    return packer.compress(body) + packer.flush()
