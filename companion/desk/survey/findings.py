"""Survey result, common to all methods: zones, maps that can be read in parts, and counts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon

from companion.desk.survey.cloud_survey import CloudSurvey
from companion.desk.survey.local_metres import Metric, wgs84
from companion.desk.survey.survey_corridors import SurveyCorridors
from companion.flight.outputs.geojson_features import zone_polygon
from params import Parameters
from slz import SAFE, UNKNOWN, UNSAFE, Box, Grid, TerrainMaps, Zone
from slz.kernels.polygons.boundary_tracing import squares
from slz.zones.ranking import rank


class Maps(Protocol):
    """Layers of a survey readable by box, see `slz.terrain.layers`, and `state`."""

    @property
    def grid(self) -> Grid: ...

    def read(self, name: str, box: Box) -> NDArray[Any]: ...


@dataclass(frozen=True, slots=True)
class MapsInMemory:
    """Maps in memory; row and column 0 are the first of their box."""

    maps: TerrainMaps

    @property
    def grid(self) -> Grid:
        maps = self.maps
        return Grid(maps.west_m, maps.south_m, maps.grid.cell_m, *maps.box.shape)

    def read(self, name: str, box: Box) -> NDArray[Any]:
        values = self.maps.state if name == "state" else self.maps.layers[name]
        return np.array(values[box.slices])


@dataclass(frozen=True, slots=True)
class MapFiles:
    """Files written from the maps: GeoTIFFs, and the picture of the ground (PNG)."""

    rasters: Sequence[Path]
    ground: Path


@dataclass(frozen=True, slots=True)
class Findings:
    """Zones of a survey, the best first and numbered by rank, with its maps, parameters and counts.

    shapes, outlines_m: in longitude and latitude, and in metres of the map. square_centres_m: of the
    largest safe squares, metres of the map. ways: in to and out of the landing points, None where they were
    not asked for. n_obstacles: inside the contours. cells: rows, cols, safe,
    unsafe, unknown. coordinate_spacing: as in `GeoreferencedCloud`. drawings: files of the maps, if they are
    written already. skipped: files left out, and the reasons.
    """

    metric: Metric
    parameters: Parameters
    maps: Maps
    drawings: MapFiles | None
    zones: Sequence[Zone]
    shapes: Sequence[MultiPolygon]
    outlines_m: Sequence[MultiPolygon]
    square_centres_m: Sequence[tuple[float, float]]
    ways: Sequence[SurveyCorridors | None]
    n_obstacles: Sequence[int]
    cells: dict[str, int]
    n_read: int
    n_used: int
    dropped: dict[str, int]
    density_per_m2: float
    coordinate_spacing: float
    skipped: Sequence[dict[str, str]]
    n_cut: int
    stage_ms: dict[str, float]


def numbered_by_rank(ranked: Iterable[Zone], parameters: Parameters) -> tuple[Zone, ...]:
    """Return ranked zones numbered from 1 on; the reasons for their ranks name these numbers."""
    return rank((replace(zone, id=k) for k, zone in enumerate(ranked, start=1)), parameters)


def of_window(found: CloudSurvey, n_read: int, coordinate_spacing: float) -> Findings:
    """Return the findings of a cloud that was processed in one window."""
    zones, maps = numbered_by_rank(found.report.zones, found.parameters), found.maps
    outlines_m = [zone_polygon(zone, maps.grid) for zone in zones]
    rows, cols = maps.state.shape
    return Findings(
        metric=found.metric,
        parameters=found.parameters,
        maps=MapsInMemory(maps),
        drawings=None,
        zones=zones,
        shapes=[wgs84(outline, found.metric) for outline in outlines_m],
        outlines_m=outlines_m,
        square_centres_m=[square_centre(zone, maps) for zone in zones],
        ways=[None] * len(zones),
        n_obstacles=[len(zone.obstacles) for zone in zones],
        cells={
            "rows": rows,
            "cols": cols,
            "safe": int((maps.state == SAFE).sum()),
            "unsafe": int((maps.state == UNSAFE).sum()),
            "unknown": int((maps.state == UNKNOWN).sum()),
        },
        n_read=n_read,
        n_used=found.report.n_used,
        dropped=found.dropped,
        density_per_m2=found.density_per_m2,
        coordinate_spacing=coordinate_spacing,
        skipped=(),
        n_cut=0,
        stage_ms=dict(found.report.stage_ms),
    )


def square_centre(zone: Zone, maps: TerrainMaps) -> tuple[float, float]:
    """Return east and north of the centre of the largest square of the zone's safe cells.

    Of equal squares the one nearest to the zone's landing point is used. The maps' box must hold the zone.
    """
    down, right = zone.box.row0 - maps.box.row0, zone.box.col0 - maps.box.col0
    rows, cols = zone.cells.shape
    safe = (maps.state[down : down + rows, right : right + cols] == SAFE) & (zone.cells == 1)
    return centre_of(zone, safe.astype(np.uint8), maps.grid)


def centre_of(zone: Zone, safe: NDArray[np.uint8], grid: Grid) -> tuple[float, float]:
    """Return the centre of the largest square, given the zone's safe cells within its box."""
    side = squares(np.ascontiguousarray(safe))
    largest = int(side.max())
    last_row, last_col = np.nonzero(side == largest)
    # A square ends with its last row and column, so its centre is half a side before their far edge.
    north = grid.south_m + (last_row + 1 - largest / 2 + zone.box.row0) * grid.cell_m
    east = grid.west_m + (last_col + 1 - largest / 2 + zone.box.col0) * grid.cell_m
    nearest = int(np.argmin((east - zone.best.enu_m[0]) ** 2 + (north - zone.best.enu_m[1]) ** 2))
    return float(east[nearest]), float(north[nearest])
