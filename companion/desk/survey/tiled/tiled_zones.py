"""Zone description across tiles: each zone is computed whole from all tiles it covers.

A zone whose extent holds more than `MOST_CELLS` cells is cut along lines of a fixed lattice. It then fits
into memory, and its parts are the same for any tile size; each part that holds a safe square is a zone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from companion.desk.survey.findings import centre_of
from companion.desk.survey.survey_corridors import survey_corridors
from companion.desk.survey.tiled.tile_labels import CandidateZone, Members
from companion.desk.survey.tiled.tile_store import Store, TileLayout
from companion.desk.survey.tiled.zone_file import DescribedZone, load, save
from companion.flight.outputs.geojson_features import zone_polygon
from params import Parameters
from slz import Box
from slz.grid import common
from slz.kernels.polygons.boundary_tracing import squares
from slz.zones.description import Content, describe
from slz.zones.detection import Candidate, search_components, side_in_cells

MOST_CELLS = 1 << 24
CUT = 2048  # cells between two lines of the lattice: at most 4 M cells a part
NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True, slots=True)
class Work:
    """Zones to be described together, and their output file."""

    zones: tuple[CandidateZone, ...]
    done: Path


def describe_zones(work: Work, layout: TileLayout, parameters: Parameters, corridors: bool = False) -> int:
    """Describe zones, where asked with their ways, write them to their file and return their number."""
    if work.done.exists():
        return len(load(work.done))
    store = Store(layout)
    members = Members(store)
    found = [one for zone in work.zones for one in _found(zone, store, members, parameters)]
    if corridors:
        found = [replace(one, ways=survey_corridors(one.zone.best.enu_m, store, parameters)) for one in found]
    save(work.done, found)
    return len(found)


def batches(zones: Sequence[CandidateZone], folder: Path, most_cells: int = MOST_CELLS // 4) -> list[Work]:
    """Return zones in batches of similar size, those of one tile together, the largest batch first.

    A large batch that started last would keep the other workers waiting.
    """
    found: list[tuple[int, list[CandidateZone]]] = []
    batch: list[CandidateZone] = []
    cells = 0
    for zone in sorted(zones, key=lambda zone: (zone.parts[0][0], zone.first)):
        rows, cols = zone.extent.shape
        if batch and cells + rows * cols > most_cells:
            found.append((cells, batch))
            batch, cells = [], 0
        batch.append(zone)
        cells += rows * cols
    if batch:
        found.append((cells, batch))
    work = [(cells, Work(tuple(batch), folder / f"{n}.zones")) for n, (cells, batch) in enumerate(found)]
    return [one for _, one in sorted(work, key=lambda pair: -pair[0])]


def _found(
    zone: CandidateZone, store: Store, members: Members, parameters: Parameters
) -> Iterator[DescribedZone]:
    """Yield the zone, or those parts of a too large one that hold a safe square."""
    layout = store.layout
    windows = list(_windows(zone.extent))
    least = side_in_cells(parameters.min_square_m, layout.grid)
    for window in windows:
        cells = members.cells(zone, window)
        if not cells.any():
            continue
        for candidate in search_components(
            cells, layout.local(window), least, parameters.min_boundary_points
        ):
            described = describe(Content.of(candidate, store), store, NOWHERE, parameters, 0)
            yield DescribedZone(
                first=_first(candidate, least),
                zone=replace(described, obstacles=()),
                polygon_m=zone_polygon(described, layout.grid),
                square_centre_m=centre_of(described, described.cells, layout.grid),
                n_obstacles=len(described.obstacles),
                cut=len(windows) > 1,
            )


def _windows(extent: Box) -> Iterator[Box]:
    rows, cols = extent.shape
    if rows * cols <= MOST_CELLS:
        yield extent
        return
    for row in range(extent.row0 // CUT, (extent.row1 - 1) // CUT + 1):
        for col in range(extent.col0 // CUT, (extent.col1 - 1) // CUT + 1):
            yield common(Box(row * CUT, (row + 1) * CUT, col * CUT, (col + 1) * CUT), extent)


def _first(candidate: Candidate, least: int) -> int:
    """Return the first cell at which a safe square of a candidate ends, numbered as in `TileLabels.first`."""
    rows, cols = np.nonzero(squares(candidate.component) >= least)
    return ((int(rows[0]) + candidate.box.row0) << 32) + int(cols[0]) + candidate.box.col0
