"""Self-contained HTML page of the zones: a map with pan and zoom, and a table; needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import MultiPolygon

from companion.desk.figures.layer_figures import CERTAIN, LESS_CERTAIN, UNCERTAIN
from companion.desk.survey.findings import Findings, Maps
from companion.desk.survey.local_metres import Metric
from companion.desk.survey.overview import ground_png, legend, step_of, water_mask
from companion.desk.survey.survey_summary import reason

TEMPLATE = Path(__file__).with_name("survey_page.html")
MOST_ZONES = 3000  # only the best are drawn; the files hold all
MOST_CORNERS = 400_000  # of all outlines together
TOLERANCE_M = 0.5
DIGITS = 2
WAYS = ', ["ways in and out", z.corridors]'  # a further fact of a zone, in the page's script


def write_page(path: Path, found: Findings, described: Sequence[dict[str, Any]]) -> None:
    """Write the page; beyond `MOST_ZONES` zones it shows the best and says so."""
    maps, p = found.maps, found.parameters
    png = (
        ground_png(maps, water_mask(maps, p))
        if found.drawings is None
        else found.drawings.ground.read_bytes()
    )
    points_m = [zone.best.enu_m[:2] - (maps.grid.west_m, maps.grid.south_m) for zone in found.zones]
    rows = [row | {"at": _point(at)} for row, at in zip(described, points_m, strict=True)]
    shown = list(zip(found.outlines_m, rows, strict=True))[:MOST_ZONES]
    document = {
        "west": maps.grid.west_m,
        "north": maps.grid.north_m,
        "width": maps.grid.east_m - maps.grid.west_m,
        "height": maps.grid.north_m - maps.grid.south_m,
        "pixel": step_of(maps.grid) * maps.grid.cell_m,
        "corners": _corners(maps, found.metric),
        "colours": [CERTAIN, LESS_CERTAIN, UNCERTAIN],
        "limits": [p.confidence_factor, p.uncertain_below],
        "crs": found.metric.reference.name,
        "heights": found.metric.reference.heights,
        "cells": {"cell_m": p.cell_m, **found.cells},
        "ground": legend(),
        "no_zone": reason(found),
        "points": found.n_used,
        "all": len(described),
        "skipped": [one["file"] for one in found.skipped],
        "zones": _zones(shown),
    }
    page = TEMPLATE.read_text("utf-8")
    page = page.replace("__FACTS__", WAYS if any("corridors" in row for row in described) else "")
    page = page.replace("__PICTURE__", base64.b64encode(png).decode())
    page = page.replace("__SURVEY__", json.dumps(document, allow_nan=False).replace("</", "<\\/"))
    path.write_text(page, "utf-8")


def _zones(shown: Sequence[tuple[MultiPolygon, dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return rows with their rings in metres, simplified so that a browser can draw all corners."""
    corners = sum(shapely.get_num_coordinates(outline) for outline, _ in shown)
    scale = max(1.0, corners / MOST_CORNERS)
    return [
        {**row, "rings": [ring for part in outline.geoms for ring in _rings(part, scale)]}
        for outline, row in shown
    ]


def _rings(part: shapely.Polygon, scale: float) -> list[list[float]]:
    if scale > 1:
        thin = part.simplify(TOLERANCE_M * scale, preserve_topology=False)
        part = thin if isinstance(thin, shapely.Polygon) and not thin.is_empty else part
    return [
        np.asarray(ring.coords)[:-1].round(DIGITS).ravel().tolist()
        for ring in (part.exterior, *part.interiors)
    ]


def _point(local_m: np.ndarray) -> list[float]:
    """Return metres east and north of the picture's south-west corner."""
    return [round(float(value), DIGITS) for value in local_m]


def _corners(maps: Maps, metric: Metric) -> list[list[float]]:
    """Return longitude and latitude of the north-west, north-east, south-west and south-east corner.

    Across the date line longitudes continue beyond 180 degrees.
    """
    grid = maps.grid
    places = [[x, y] for y in (grid.north_m, grid.south_m) for x in (grid.west_m, grid.east_m)]
    found = metric.lonlat(np.array(places))
    if np.ptp(found[:, 0]) > 180:
        found[:, 0] %= 360
    corners: list[list[float]] = found.tolist()
    return corners
