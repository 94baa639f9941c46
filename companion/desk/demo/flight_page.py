"""Self-contained HTML page of a flight: map, flown path, zones, touchdown, and what happened when."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import Polygon

from companion.desk.demo.flight_files import FlownMap, Place, facts, verdict
from companion.desk.figures.layer_figures import certainty_colour
from companion.desk.survey.findings import MapsInMemory
from companion.desk.survey.overview import ground_png, step_of
from companion.flight.outputs.geojson_features import zone_polygon
from slz import LocalFrame, Zone

TEMPLATE = Path(__file__).with_name("flight_page.html")
DIGITS = 2


def write_page(path: Path, flown: FlownMap, summary: dict[str, Any]) -> None:
    """Write the page; it loads nothing."""
    maps, frame = MapsInMemory(flown.maps), flown.maps.frame
    grid, chosen = maps.grid, summary["chosen"]
    document = {
        "title": f"{summary['scene']}, seed {summary['seed']}",
        "verdict": verdict(summary),
        "good": summary["landed"] and summary["touchdown_safe"],
        "facts": facts(summary),
        "map": [grid.west_m, -grid.north_m, grid.east_m - grid.west_m, grid.north_m - grid.south_m],
        "pixel_m": step_of(grid) * grid.cell_m,
        "landed_in": None if chosen is None else chosen["zone"],
        "zones": [_zone(zone, flown) for zone in flown.report.zones],
        "points": {name: _local(frame, place) for name, place in flown.points.items()},
        "moments": [
            [round(m.at_s, 1), m.phase, m.height_m, None if m.lla is None else _local(frame, m.lla)]
            for m in flown.log.moments
        ],
        "texts": [[round(said.at_s, 1), said.severity, said.text] for said in flown.log.texts],
    }
    page = TEMPLATE.read_text("utf-8")
    page = page.replace("__PICTURE__", base64.b64encode(ground_png(maps)).decode())
    page = page.replace("__FLIGHT__", json.dumps(document, allow_nan=False).replace("</", "<\\/"))
    path.write_text(page, "utf-8")


def _zone(zone: Zone, flown: FlownMap) -> dict[str, Any]:
    return {
        "id": zone.id,
        "colour": certainty_colour(zone, flown.parameters),
        "at": zone.best.enu_m[:2].round(DIGITS).tolist(),
        "rings": [ring for part in zone_polygon(zone, flown.maps.grid).geoms for ring in _rings(part)],
        "area_m2": round(zone.area_m2),
        "certainty": round(zone.certainty, 2),
    }


def _rings(part: Polygon) -> list[list[list[float]]]:
    return [np.asarray(ring.coords)[:-1].round(DIGITS).tolist() for ring in (part.exterior, *part.interiors)]


def _local(frame: LocalFrame, place: Place) -> list[float]:
    """Return metres east and north in the map's frame."""
    east, north = frame.enu_m(*place)[:2].round(DIGITS).tolist()
    return [east, north]
