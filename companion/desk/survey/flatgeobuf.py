"""FlatGeobuf output of the zones, with a spatial index for GIS programs and `slz nearest`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pyogrio.raw import read, write
from shapely.geometry import MultiPolygon

NUMBERS = (
    "area_m2", "certainty", "slope_deg", "roughness", "square_side_m", "lat", "lon", "elevation_m",
    "point_certainty", "point_slope_deg", "clearance_m", "surface_probability", "water", "raised_m",
)  # fmt: skip
COUNTS = ("id", "rank", "boundary_points", "corner_points", "obstacles")
TEXTS = ("surface", "headings", "blocked_by", "areas", "why")
OPTIONAL_TEXTS = ("vertical_datum", "corridors")
Degrees = tuple[float, float, float, float]


def write_flatgeobuf(path: Path, shapes: Sequence[MultiPolygon], described: Sequence[dict[str, Any]]) -> None:
    """Write the zones as multipolygons with holes in WGS-84; `zone_table.rows` has their fields."""
    texts = texts_of(described)
    columns = [
        *(np.array([row[name] for row in described], np.int64) for name in COUNTS),
        *(np.array([_number(row[name]) for row in described], np.float64) for name in NUMBERS),
        *(np.array([row[name] for row in described], object) for name in texts),
    ]
    write(
        str(path),
        geometry=np.array([shapely.to_wkb(shape) for shape in shapes], object),
        field_data=columns,
        fields=list(fields_of(described)),
        geometry_type="MultiPolygon",
        crs="EPSG:4326",
        driver="FlatGeobuf",
        layer="zones",
    )


def fields_of(described: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Return the names of the fields of zones, in their order."""
    return *COUNTS, *NUMBERS, *texts_of(described)


def texts_of(described: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Return the names of the fields that hold text."""
    return *TEXTS, *(name for name in OPTIONAL_TEXTS if any(name in row for row in described))


def zones_within(path: Path, box: Degrees) -> tuple[list[dict[str, Any]], NDArray[np.object_]]:
    """Return rows and outlines (WKB) of the zones whose extents touch west, south, east, north in degrees."""
    meta, _, outlines, columns = read(str(path), bbox=box)
    names = list(meta["fields"])
    rows = [
        dict(zip(names, values, strict=True)) for values in zip(*(c.tolist() for c in columns), strict=True)
    ]
    for row in rows:
        row.update({name: None for name in NUMBERS if math.isnan(row[name])})
    return rows, outlines


def _number(value: float | None) -> float:
    return math.nan if value is None else value
