"""Ways in and out of a surveyed landing point. Files hold no rays, so that air is never known to be clear."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from companion.flight.outputs.corridor_ranges import corridor_ranges
from companion.flight.outputs.geojson_features import DEGREE_DECIMALS
from companion.runtime.errors import UsageError
from params import Parameters
from slz import Box, Corridors, SurfaceKind
from slz.landing_point.corridors import STEP_DEG, corridor_reach_m, corridors
from slz.terrain.terrain_view import TerrainView

MOST_CELLS = 1 << 24  # cells around a point, read at once by a worker: 200 MB
AIR = "nothing of the survey is in the way, the air was not seen"
STANDING = {kind.word for kind in (SurfaceKind.ROOF, SurfaceKind.LOW_VEGETATION, SurfaceKind.CANOPY)}
Floats = NDArray[np.float64]


class SurveyedTerrain(TerrainView, Protocol):
    """Maps of a survey that hold the surface of a cell."""

    def read(self, name: str, box: Box) -> NDArray[Any]: ...


@dataclass(frozen=True, slots=True, eq=False)
class SurveyCorridors:
    """Corridors of a zone's landing point, blocked or unknown.

    surfaces: (72,) `SurfaceKind` of the obstacle of each bearing.
    """

    corridors: Corridors
    surfaces: NDArray[np.uint8]


def check_reach(parameters: Parameters) -> None:
    """Refuse corridors that reach over more cells than fit into memory (UsageError)."""
    p, reach_m = parameters, corridor_reach_m(parameters)
    if (2 * reach_m / p.cell_m) ** 2 > MOST_CELLS:
        raise UsageError(
            f"--corridors: {reach_m:.0f} m around a point are too many cells of {p.cell_m:g} m:"
            f" set corridor_m to {math.floor(MOST_CELLS**0.5 / 2 * p.cell_m)} or less, or a larger --cell-m"
        )


def survey_corridors(enu_m: Floats, terrain: SurveyedTerrain, parameters: Parameters) -> SurveyCorridors:
    """Return the corridors of a point (3,) over the tops of a survey's map."""
    found = corridors(enu_m, terrain, terrain, None, parameters)
    surfaces = np.full(len(found.obstacles_enu_m), SurfaceKind.UNKNOWN, np.uint8)
    for k in np.flatnonzero(np.isfinite(found.obstacles_enu_m[:, 2])).tolist():
        east, north, _ = found.obstacles_enu_m[k].tolist()
        row, col = terrain.grid.index(east, north)
        surfaces[k] = terrain.read("surface", Box(row, row + 1, col, col + 1))[0, 0]
    return SurveyCorridors(found, surfaces)


def document(found: SurveyCorridors, lonlat: Any, north_deg: float, length: float) -> dict[str, Any]:
    """Return the corridors as a JSON object; bearings are true, lengths those on the ground.

    It is that of `corridor_ranges` with the `surface` of each obstacle; unblocked_deg, the sum of all
    bearings at which nothing of the survey is in the way, takes the place of clear_deg.

    Parameters
    ----------
    lonlat
        Returns (n, 2) longitude and latitude of (n, 3) metres of the map.
    north_deg, length
        As in `companion.flight.outputs.corridor_ranges`.
    """

    def place(bearing: int, top_enu_m: Floats) -> dict[str, Any]:
        lon, lat = lonlat(top_enu_m[np.newaxis])[0].round(DEGREE_DECIMALS).tolist()
        kind = SurfaceKind(int(found.surfaces[bearing]))
        return {"surface": kind.word, "lat": lat, "lon": lon}

    ranges = corridor_ranges(found.corridors, place, north_deg=north_deg, length=length)
    del ranges["clear_deg"]  # without rays no air is known to be clear
    free = sum((last - first) % 360 + STEP_DEG for first, last in ranges["unknown_deg"])
    return {"slope_deg": ranges["slope_deg"], "unblocked_deg": free, **ranges}


def words(ranges: dict[str, Any]) -> str:
    """Return a document of `document` as a sentence for tables."""
    blocked = ", ".join(f"{_range(one['bearings_deg'])} by {_obstacle(one)}" for one in ranges["blocked"])
    rest = ("elsewhere " if blocked else "") + AIR if ranges["unknown_deg"] else ""
    return f"at {ranges['slope_deg']:g}°: " + "; ".join(
        filter(None, (blocked and f"blocked {blocked}", rest))
    )


def _range(bearings_deg: Sequence[int]) -> str:
    first, last = bearings_deg
    return f"{first:03d}°" if first == last else f"{first:03d}°-{last:03d}°"


def _obstacle(one: dict[str, Any]) -> str:
    kind = f"{one['surface']} " if one["surface"] in STANDING else ""
    return f"{kind}{one['height_m']:.1f} m high at {one['distance_m']:.0f} m"
