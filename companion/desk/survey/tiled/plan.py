"""Work plan of a tiled survey: files cut into pieces, the manifest of the work folder, the tiles."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from companion.desk.clouds.cloud_source import Source
from companion.desk.clouds.las import LasSource
from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.derive_tiles import Tile
from companion.desk.survey.tiled.lattice import Lattice, grown
from companion.desk.survey.tiled.sort_points import Piece
from companion.desk.survey.tiled.tile_store import Key, TileLayout
from companion.runtime.errors import UsageError
from params import Parameters
from slz import Box
from slz.grid import common
from slz.kernels.survey.point_binning import BLOCK

PIECE = 4_000_000  # points sorted at a time
VERSION = 3  # version of the files in a work folder
TILE_CELLS = 1024
DRAWN = ("surface", "tiles", "zones", "drawings")  # folders of files made from the sorted points
MANIFEST, USED = "manifest.json", "used.json"


def pieces(
    files: Sequence[Path],
    sources: Sequence[Source],
    crs: str | None,
    folder: Path,
    vertical_unit: str | None = None,
) -> list[Piece]:
    """Cut LAS and LAZ files into pieces; other files, and those with an index (COPC), are one piece.

    Names of pieces depend on the file's position among all files, not on which files could be opened.
    """
    place = {path: k for k, path in enumerate(files)}
    out: list[Piece] = []
    for source in sources:
        step = PIECE if isinstance(source, LasSource) and source.seekable else source.n_points
        for first in range(0, source.n_points, step):
            stop = min(first + step, source.n_points)
            name = f"{place[source.path]}-{first}.sorted"
            out.append(Piece(len(out), source.path, crs, first, stop, folder / name, vertical_unit))
    return out


def tile_side(tile_m: float | None, cell_m: float) -> int:
    """Return the cells along a tile's side: the number of whole blocks that covers `tile_m`."""
    if tile_m is None:
        return TILE_CELLS
    return BLOCK * max(1, math.ceil(tile_m / cell_m / BLOCK - 1e-9))


def manifest(
    files: Sequence[Path],
    crs: str | None,
    parameters: Parameters,
    lattice: Lattice,
    side: int,
    vertical_unit: str | None = None,
) -> dict[str, Any]:
    """Return everything that the files of a work folder depend on."""
    states = [(path.resolve(), path.stat()) for path in files]
    return {
        "version": VERSION,
        "files": [[str(path), state.st_size, state.st_mtime_ns] for path, state in states],
        "crs": crs,
        "vertical_unit": vertical_unit,
        "parameters": parameters.model_dump(),
        "set": sorted(parameters.model_fields_set & {"coverage_m", "max_zones"}),
        "lattice": lattice.document(),
        "tile_cells": side,
        "piece": PIECE,
    }


def claim(folder: Path, wanted: dict[str, Any]) -> bool:
    """Make a work folder, or resume that of an interrupted survey; return whether there was one.

    Raises
    ------
    UsageError
        It belongs to a survey of other files or parameters.
    """
    path = folder / MANIFEST
    wanted = json.loads(json.dumps(wanted))
    if path.exists():
        try:
            found = json.loads(path.read_text("utf-8"))
        except ValueError:
            found = {}
        differing = sorted(name for name in {*wanted, *found} if wanted.get(name) != found.get(name))
        if differing:
            raise UsageError(
                f"{folder}: an unfinished survey lies there, with other {', '.join(differing)}: run that one"
                " again to finish it, remove the folder, or name another by --out"
            )
        return True
    folder.mkdir(parents=True, exist_ok=True)
    with array_file.atomic_file(path) as unfinished:
        unfinished.path.write_text(json.dumps(wanted), "utf-8")
    return False


def record_sources(folder: Path, used: Sequence[Path]) -> None:
    """Record the sorted files that the maps are derived from; remove maps derived from others.

    A file that an earlier run could not read may be readable now; maps without it would be wrong.
    """
    path = folder / USED
    wanted = json.dumps([str(one.relative_to(folder)) for one in used])
    if path.exists() and path.read_text("utf-8") == wanted:
        return
    path.unlink(missing_ok=True)  # first, so that an interrupted removal is repeated
    for part in DRAWN:
        if (folder / part).exists():
            shutil.rmtree(folder / part)
        (folder / part).mkdir()
    with array_file.atomic_file(path) as unfinished:
        unfinished.path.write_text(wanted, "utf-8")


def tiles(layout: TileLayout, sources: Sequence[Path], margin: int) -> list[Tile]:
    """Return the tiles that hold points, each with the sorted files that hold points in its reach."""
    reach: dict[Key, set[Path]] = {}
    held: set[Key] = set()
    for path in sources:
        arrays, _ = array_file.read(path)
        seen: set[Key] = set()
        for row, col in arrays["blocks"].tolist():
            block = common(Box(row * BLOCK, (row + 1) * BLOCK, col * BLOCK, (col + 1) * BLOCK), layout.whole)
            if block.empty:
                continue
            held.update(layout.keys(block))
            seen.update(layout.keys(grown(block, margin)))
        for key in seen:
            reach.setdefault(key, set()).add(path)
    number = {path: k for k, path in enumerate(sources)}
    return [
        Tile(*key, layout.box(key), tuple(sorted(reach[key], key=number.__getitem__)), layout.path(key))
        for key in sorted(held)
    ]


def spacing(sources: Sequence[Source], box: Box, lattice: Lattice) -> float:
    """Return the distance between neighbouring 32-bit coordinates (CRS units); 0 if all are 64-bit."""
    if not any(source.single for source in sources):
        return 0.0
    largest = max(
        max(abs(box.row0), abs(box.row1)) * lattice.cell_m / lattice.y_m,
        max(abs(box.col0), abs(box.col1)) * lattice.cell_m / lattice.x_m,
    )
    return float(np.spacing(np.float32(largest)))
