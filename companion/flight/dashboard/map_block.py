"""Map block for the browser: quantised cells, coarser levels, compressed encoding."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.dashboard.quantise import (
    MIDDLE,
    NO_HEIGHT,
    NO_VALUE,
    halve,
    halve_heights,
    halve_states,
    quantise,
    quantise_heights,
)
from slz import UNKNOWN, DrawnTile
from slz.terrain.layers import Output, reaching

SIDE = 256  # cells per side of a block
# magic, cells per side, west, south, cell size, height of value 0, step of heights (m)
HEAD = struct.Struct("<4sIddddd")
MAGIC = b"SLZ1"
GZIP = 31  # zlib's window bits for the gzip format

Small = NDArray[np.uint8]


HEIGHT, *PLANES = reaching(Output.PAGE)
STEP_M = HEIGHT.step


@dataclass(slots=True, eq=False)
class Block:
    """Quantised layers of `SIDE` x `SIDE` cells, row 0 southernmost.

    height: in steps above `base_m`, 0 unknown. planes: the other layers by name, in their steps, 255 unknown.
    state: 0 unsafe, 1 safe, 255 unknown. version: increases with every change.
    """

    base_m: float
    height: NDArray[np.uint16]
    planes: dict[str, Small]
    state: Small
    version: int = 0


def empty(base_m: float) -> Block:
    """Return a block of unknown cells."""
    shape = SIDE, SIDE
    planes = {layer.name: np.full(shape, NO_VALUE) for layer in PLANES}
    return Block(base_m, np.zeros(shape, np.uint16), planes, np.full(shape, UNKNOWN))


def write(block: Block, row: int, col: int, tile: DrawnTile) -> bool:
    """Write a tile's maps to a block at a row and column; return whether anything changed.

    A layer that has a value where it is unknown, as the certainty, is unknown where the state is.
    """
    side = tile.state.shape[0]
    here = slice(row, row + side), slice(col, col + side)
    changed = quantise_heights(tile.layers[HEIGHT.name], block.base_m, STEP_M, block.height[here])
    for layer in PLANES:
        of_known = not math.isnan(layer.empty)
        values, plane = tile.layers[layer.name], block.planes[layer.name]
        changed |= quantise(values, layer.step, tile.state, of_known, plane[here])
    if not np.array_equal(block.state[here], tile.state):
        changed = True
        block.state[here] = tile.state
    return bool(changed)


def clear(block: Block, row: int, col: int, side: int) -> None:
    """Set a square of a block to unknown."""
    here = slice(row, row + side), slice(col, col + side)
    block.height[here] = NO_HEIGHT
    for plane in block.planes.values():
        plane[here] = NO_VALUE
    block.state[here] = UNKNOWN


def coarser(children: dict[tuple[int, int], Block], base_m: float) -> Block:
    """Return the block with cells twice as wide over four blocks, by their row and column 0 or 1.

    Of four cells: mean of the known heights; worst of the known values of any other layer; unsafe if one is
    unsafe, else unknown if one is unknown. So small hazards stay visible.
    """
    block, half = empty(base_m), SIDE // 2
    for (row, col), child in children.items():
        here = slice(row * half, (row + 1) * half), slice(col * half, (col + 1) * half)
        halve_heights(child.height, round((child.base_m - base_m) / STEP_M), block.height[here])
        for layer in PLANES:
            halve(child.planes[layer.name], layer.worst == "lowest", block.planes[layer.name][here])
        halve_states(child.state, block.state[here])
    return block


def values_at(block: Block, row: int, col: int) -> dict[str, float | None]:
    """Return the layers of a cell by name, None where unknown."""
    height = int(block.height[row, col])
    found = {HEIGHT.name: None if height == 0 else round(block.base_m + height * STEP_M, 3)}
    for layer in PLANES:
        number = block.planes[layer.name][row, col]
        found[layer.name] = None if number == NO_VALUE else round(float(number) * layer.step, 3)
    return found


def description() -> list[dict[str, Any]]:
    """Return what the page shows of each layer, in the order of the planes of a block."""
    return [
        {
            "name": layer.name,
            "title": layer.title,
            "unit": layer.unit,
            "digits": layer.digits,
            "step": layer.step,
            "full": None if math.isnan(layer.full) else layer.full,
            "button": Output.BUTTON in layer.outputs,
        }
        for layer in (HEIGHT, *PLANES)
    ]


def base_of(height_m: NDArray[np.float32]) -> float:
    """Return a base that keeps the heights around these in range: about 164 m below their median."""
    known = height_m[np.isfinite(height_m)]
    middle_m = float(np.median(known)) if known.size else 0.0
    return math.floor(middle_m) - MIDDLE * STEP_M


def encode(block: Block, west_m: float, south_m: float, cell_m: float) -> bytes:
    """Return a block as gzip: head, height differences along rows by low and high bytes, planes, states."""
    difference = np.diff(block.height, axis=1, prepend=np.uint16(0)).astype("<u2")
    parts = difference.view(np.uint8).reshape(SIDE, SIDE, 2)
    head = HEAD.pack(MAGIC, SIDE, west_m, south_m, cell_m, block.base_m, STEP_M)
    differences = [parts[:, :, byte].tobytes() for byte in (0, 1)]
    planes = *block.planes.values(), block.state
    body = b"".join([head, *differences, *(plane.tobytes() for plane in planes)])
    packer = zlib.compressobj(1, zlib.DEFLATED, GZIP, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
    return packer.compress(body) + packer.flush()
