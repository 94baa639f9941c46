"""Zone file: described zones as arrays and JSON, from which no code can run (unlike pickle)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon

from companion.desk.survey.survey_corridors import SurveyCorridors
from companion.desk.survey.tiled import array_file
from slz import Box, Corridors, SurfaceHere, SurfaceKind, Zone
from slz.landing_point.helicopter_areas import HelicopterAreas
from slz.zone import LandingPoint

NUMBERS = (
    "id",
    "area_m2",
    "certainty",
    "n_safe",
    "n_unsafe",
    "n_uncertain",
    "slope_deg",
    "roughness",
    "why",
)
ARRAYS = ("cells", "boundary_cells", "corners_enu_m")
WAYS = ("states", "least_deg", "obstacles_enu_m")  # arrays of `Corridors`


@dataclass(frozen=True, slots=True)
class DescribedZone:
    """A described zone.

    first: its sort key in the order of IDs. cut: whether it is part of a larger zone. ways: in to and out of
    its landing point, None where they were not asked for.
    """

    first: int
    zone: Zone
    polygon_m: MultiPolygon
    square_centre_m: tuple[float, float]
    n_obstacles: int
    cut: bool
    ways: SurveyCorridors | None = None


def save(path: Path, zones: Sequence[DescribedZone]) -> None:
    """Write zones; obstacles are stored only as a count."""
    arrays: dict[str, NDArray[Any]] = {}
    notes = []
    for number, found in enumerate(zones):
        zone = found.zone
        arrays |= {f"{number} {name}": getattr(zone, name) for name in ARRAYS}
        arrays[f"{number} best"] = zone.best.enu_m
        arrays[f"{number} polygon"] = np.frombuffer(shapely.to_wkb(found.polygon_m), np.uint8)
        best = asdict(zone.best)
        del best["enu_m"]
        if found.ways is not None:
            arrays |= {f"{number} {name}": getattr(found.ways.corridors, name) for name in WAYS}
            arrays[f"{number} surfaces"] = found.ways.surfaces
        notes.append(
            {name: getattr(zone, name) for name in NUMBERS}
            | {
                "box": asdict(zone.box),
                "best": best,
                "first": found.first,
                "square_centre_m": found.square_centre_m,
                "n_obstacles": found.n_obstacles,
                "cut": found.cut,
                "slopes_deg": None if found.ways is None else found.ways.corridors.slopes_deg,
            }
        )
    array_file.write(path, arrays, {"zones": notes})


def load(path: Path) -> list[DescribedZone]:
    """Read a zone file."""
    arrays, notes = array_file.read(path)
    return [_found(number, arrays, entry) for number, entry in enumerate(notes["zones"])]


def _surface(document: dict[str, Any]) -> SurfaceHere:
    return SurfaceHere(**document | {"kind": SurfaceKind(document["kind"])})


def _headings(document: list[int] | None) -> tuple[int, ...] | None:
    return None if document is None else tuple(document)


def _areas(document: dict[str, Any] | None) -> HelicopterAreas | None:
    return None if document is None else HelicopterAreas(**document)


def _ways(number: int, arrays: dict[str, NDArray[Any]], document: dict[str, Any]) -> SurveyCorridors | None:
    if document["slopes_deg"] is None:
        return None
    found = {name: arrays[f"{number} {name}"] for name in WAYS}
    corridors = Corridors(arrays[f"{number} best"], tuple(document["slopes_deg"]), **found)
    return SurveyCorridors(corridors, arrays[f"{number} surfaces"])


def _found(number: int, arrays: dict[str, NDArray[Any]], document: dict[str, Any]) -> DescribedZone:
    fields: dict[str, Any] = {name: document[name] for name in NUMBERS}
    fields |= {name: arrays[f"{number} {name}"] for name in ARRAYS}
    zone = Zone(
        **fields,
        box=Box(**document["box"]),
        obstacles=(),
        best=LandingPoint(
            enu_m=arrays[f"{number} best"],
            **document["best"]
            | {
                "surface": _surface(document["best"]["surface"]),
                "headings_deg": _headings(document["best"]["headings_deg"]),
                "areas": _areas(document["best"]["areas"]),
            },
        ),
    )
    east, north = document["square_centre_m"]
    polygon = shapely.from_wkb(arrays[f"{number} polygon"].tobytes())
    assert isinstance(polygon, MultiPolygon)  # noqa: S101 - `save` writes no other type
    ways = _ways(number, arrays, document)
    return DescribedZone(
        document["first"], zone, polygon, (east, north), document["n_obstacles"], document["cut"], ways
    )
