"""Map derivation of a tile, block by block, from the points of the tile and of a margin around it.

A block is derived from its own evidence and that of exactly `Reach.margin` cells around it. Plane sums thus
start at the same cell on any tile, and the result is the same to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.cell_sums import Sums, join_cell_sums
from companion.desk.survey.tiled.lattice import UNIT_M, block_box, grown
from companion.desk.survey.tiled.surface_parts import SurfaceParts
from params import Parameters
from slz import UNKNOWN, Box
from slz.grid import common, within
from slz.kernels.cells.cell_statistics import summary
from slz.kernels.survey.point_binning import BLOCK, evidence_of
from slz.terrain.derive import derive, reach_of
from slz.terrain.layers import Output, reaching

KEPT = reaching(Output.SURVEY)
NEVER_S = 1e12
Maps = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Tile:
    """A square of blocks: its box, the sorted files with points in reach, and the output file."""

    row: int
    col: int
    box: Box
    sources: tuple[Path, ...]
    drawn: Path


@dataclass(frozen=True, slots=True)
class Ground:
    """Values that all tiles share: the box, trusted heights, zero of heights, parameters, surface."""

    whole: Box
    interval: tuple[int, int]
    datum: int
    parameters: Parameters
    surface: SurfaceParts


def draw_tile(tile: Tile, ground: Ground) -> dict[str, Any]:
    """Derive a tile's maps and write them over the common cells of its box and the survey's.

    Returns
    -------
    Notes: box, n_used, n_outliers and the number of cells by state. The file of an earlier run is reused.
    """
    if tile.drawn.exists():
        return array_file.read(tile.drawn)[1]
    p = ground.parameters
    margin = reach_of(p, p.cell_m).margin
    sums = join_cell_sums(tile.sources, tile.box, margin, ground.whole, ground.interval, p.cell_m)
    box = common(tile.box, ground.whole)
    maps: Maps = {layer.name: np.full(box.shape, layer.empty, np.float32) for layer in KEPT}
    maps["state"] = np.full(box.shape, UNKNOWN, np.uint8)
    for row in range(box.row0 // BLOCK, (box.row1 - 1) // BLOCK + 1):
        for col in range(box.col0 // BLOCK, (box.col1 - 1) // BLOCK + 1):
            _draw_block(block_box(row, col), sums, margin, ground, box, maps)
    count = np.bincount(maps["state"].ravel(), minlength=256)
    notes = {
        "box": [box.row0, box.row1, box.col0, box.col1],
        "n_used": sums.n_used,
        "n_outliers": sums.n_outliers,
        "unsafe": int(count[0]),
        "safe": int(count[1]),
        "unknown": int(count[UNKNOWN]),
    }
    array_file.write(tile.drawn, maps, notes)
    return notes


def _draw_block(block: Box, sums: Sums, margin: int, ground: Ground, box: Box, maps: Maps) -> None:
    """Derive one block into the maps of a box; a block without points is skipped."""
    p = ground.parameters
    wide = grown(block, margin)
    held = common(wide, sums.box)
    there = within(held, sums.box)
    count = sums.count[there]
    if not count.any():
        return
    evidence = evidence_of(
        count, sums.total[there], sums.extreme[there], ground.datum, UNIT_M, p.range_noise_m
    )
    if held != wide:
        some, evidence = evidence, np.zeros((*wide.shape, *evidence.shape[2:]), np.float32)
        evidence[within(held, wide)] = some
    cells = summary(evidence, 0.0, NEVER_S)
    values, verdict = derive(cells, reach_of(p, p.cell_m), p.cell_m, p, ground.surface.refused(wide, p))
    part = common(block, box)
    out, here = within(part, box), within(part, block)
    for layer in KEPT:
        maps[layer.name][out] = values[layer.at][here]
        if layer.empty == layer.empty:
            np.nan_to_num(maps[layer.name][out], copy=False, nan=layer.empty)
    maps["state"][out] = verdict[0][here]
