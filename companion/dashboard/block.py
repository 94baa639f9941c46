"""A square of the map as a browser takes it: small numbers, coarser copies, compressed bytes."""

from __future__ import annotations

import gzip
import math
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz import SAFE, UNKNOWN, UNSAFE, DrawnTile

SIDE = 256  # cells along the side of a block
STEP_M = 0.005  # of heights
MIDDLE = 32_768
NO_HEIGHT = np.uint16(0)
NO_VALUE = np.uint8(255)
SLOPE_STEP_DEG, RELIEF_STEP_M, CERTAINTY_STEP = 0.25, 0.01, 0.005
# magic, cells along the side, west, south, cell, height of number 0, step of heights (m)
HEAD = struct.Struct("<4sIddddd")
MAGIC = b"SLZ1"

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
    rows, cols = tile.state.shape
    here = slice(row, row + rows), slice(col, col + cols)
    new = (
        (block.height, heights(tile.height_m, block.base_m)),
        (block.slope, steps(tile.slope_deg, SLOPE_STEP_DEG)),
        (block.relief, steps(tile.relief_m, RELIEF_STEP_M)),
        (block.certainty, steps(np.where(tile.state == UNKNOWN, np.nan, tile.certainty), CERTAINTY_STEP)),
        (block.state, tile.state),
    )
    changed = False
    for plane, values in new:
        if not np.array_equal(plane[here], values):
            plane[here] = values
            changed = True
    return changed


def clear(block: Block, row: int, col: int, side: int) -> None:
    """Forget a square of a block."""
    here = slice(row, row + side), slice(col, col + side)
    block.height[here] = NO_HEIGHT
    for plane in block.planes:
        plane[here] = NO_VALUE  # which is also `UNKNOWN`


def heights(height_m: NDArray[np.float32], base_m: float) -> NDArray[np.uint16]:
    """Return heights in steps above a base, 1 to 65535; 0 where unknown."""
    number = np.clip(np.rint((height_m - np.float32(base_m)) / np.float32(STEP_M)), 1, 65_535)
    return np.asarray(np.nan_to_num(number, nan=0.0), np.uint16)


def steps(values: NDArray[np.float32], step: float) -> Small:
    """Return values in steps, 254 at most; 255 where unknown."""
    number = np.clip(np.rint(values / np.float32(step)), 0, 254)
    return np.asarray(np.nan_to_num(number, nan=255.0), np.uint8)


def coarser(children: dict[tuple[int, int], Block], base_m: float) -> Block:
    """Return the block of cells twice as wide over four blocks, by their row and column 0 or 1.

    Of four cells: mean height of those known; the steepest, the greatest relief, the least certainty; unsafe
    where one is unsafe, else unknown where one is unknown. So what is small and bad stays in sight.
    """
    block, half = empty(base_m), SIDE // 2
    for (row, col), child in children.items():
        here = slice(row * half, (row + 1) * half), slice(col * half, (col + 1) * half)
        block.height[here] = _mean_height(child, base_m)
        for plane, fine in ((block.slope, child.slope), (block.relief, child.relief)):
            plane[here] = _known_most(fine)
        block.certainty[here] = _quarters(child.certainty).min(axis=0)
        block.state[here] = _worst(child.state)
    return block


def _quarters(plane: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the (4, n/2, n/2) cells of each square of four."""
    return np.stack([plane[0::2, 0::2], plane[0::2, 1::2], plane[1::2, 0::2], plane[1::2, 1::2]])


def _mean_height(child: Block, base_m: float) -> NDArray[np.uint16]:
    h = child.height
    four = np.stack([h[0::2, 0::2], h[0::2, 1::2], h[1::2, 0::2], h[1::2, 1::2]]).astype(np.int32)
    count = (four > 0).sum(axis=0)
    shift = round((child.base_m - base_m) / STEP_M)
    mean = four.sum(axis=0) // np.maximum(count, 1) + shift
    return np.where(count > 0, np.clip(mean, 1, 65_535), 0).astype(np.uint16)


def _known_most(fine: Small) -> Small:
    four = _quarters(fine).astype(np.int16)
    most = np.where(four == NO_VALUE, -1, four).max(axis=0)
    return np.where(most < 0, NO_VALUE, most).astype(np.uint8)


def _worst(fine: Small) -> Small:
    four = _quarters(fine)
    return np.where((four == UNSAFE).any(axis=0), UNSAFE, np.where((four == SAFE).all(axis=0), SAFE, UNKNOWN))


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
    return gzip.compress(body, compresslevel=1, mtime=0)
