"""Shapes of zones, landing point and obstacles for the page."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Any, Literal

import numpy as np

from companion.flight.outputs.geojson_features import zone_polygon
from companion.flight.outputs.report_summary import corridor_summary, footing_summary, surface_summary
from params import Parameters
from slz import SAFE, UNKNOWN, Corridors, Grid, Obstacle, Report, SelectedPoint, Zone

MOST_OBSTACLES = 40
MOST_PRIOR = 100  # best zones of the survey prior that are drawn
MOST_HELD = 512  # cached outlines
CENTIMETRES = 100

CertaintyClass = Literal["certain", "less", "uncertain"]
Rings = list[list[int]]


def certainty_class(certainty: float, parameters: Parameters) -> CertaintyClass:
    """Return the drawing class of a zone (SLZ paper, section 3.4.1: dark green, light green, red)."""
    if certainty >= parameters.confidence_factor:
        return "certain"
    return "less" if certainty >= parameters.uncertain_below else "uncertain"


class ZoneShapes:
    """Builds the document of a report; outlines of unchanged zones are cached."""

    def __init__(self) -> None:
        self._held: OrderedDict[tuple[Any, ...], list[Rings]] = OrderedDict()

    def document(self, report: Report, parameters: Parameters) -> dict[str, Any]:
        """Return zones, selected point and properties of the window, in metres of the map frame."""
        frame, choice = report.frame, report.choice
        return {
            "frame": [frame.lat_deg, frame.lon_deg, frame.alt_m],
            "stamp_ns": report.stamp_ns,
            "near": self._zones(report.near.zones, report.near.grid, parameters),
            "far": self._zones(report.far.zones, report.far.grid, parameters),
            "prior": self._zones(report.prior.zones[:MOST_PRIOR], report.prior.grid, parameters)
            if report.prior
            else [],
            "selected": None if report.selected is None else point(report.selected, parameters),
            "footprint_m": parameters.footprint_m,
            "choice": {
                "far": choice.far,
                "density_per_m2": _number(choice.density_per_m2, 1),
                "height_m": _number(choice.height_m, 1),
                "speed_ms": _number(choice.speed_ms, 1),
                "window_s": choice.window_s,
                "near_cell_m": report.near.grid.cell_m,
                "far_cell_m": report.far.grid.cell_m,
            },
            "points": report.n_points,
            "stage_ms": {name: round(ms, 2) for name, ms in report.stage_ms.items()},
        }

    def _zones(self, zones: tuple[Zone, ...], grid: Grid, parameters: Parameters) -> list[dict[str, Any]]:
        largest = max(zones, key=lambda zone: zone.area_m2, default=None)
        return [
            self._zone(zone, rank, grid, parameters) | {"largest": zone is largest}
            for rank, zone in enumerate(zones, 1)
        ]

    def _zone(self, zone: Zone, rank: int, grid: Grid, parameters: Parameters) -> dict[str, Any]:
        best = zone.best
        return {
            "id": zone.id,
            "rank": rank,
            "area_m2": round(zone.area_m2, 1),
            "certainty": round(zone.certainty, 3),
            "sure": certainty_class(zone.certainty, parameters),
            "slope_deg": _number(zone.slope_deg, 1),
            "roughness": _number(zone.roughness, 3),
            "why": zone.why,
            "best": [_number(v, 3) for v in best.enu_m],
            "square_m": round(best.square_side_m, 2),
            "clearance_m": round(best.clearance_m, 2),
            "point_certainty": round(best.certainty, 4),
            "distance_m": _number(best.distance_m, 1),
            "obstacles": len(zone.obstacles),
            **surface_summary(best.surface),
            **footing_summary(best),
            **corridor_summary(best.corridors),
            "rings": self._rings(zone, grid),
        }

    def _rings(self, zone: Zone, grid: Grid) -> list[Rings]:
        """Return polygons, each as outer ring and holes: east, north, east, north ... in centimetres."""
        key = (zone.id, grid.west_m, grid.south_m, grid.cell_m, zone.box, hash(zone.cells.tobytes()))
        if key not in self._held:
            self._held[key] = [
                [_ring(ring.coords) for ring in (part.exterior, *part.interiors)]
                for part in zone_polygon(zone, grid).geoms
            ]
            if len(self._held) > MOST_HELD:
                self._held.popitem(last=False)
        self._held.move_to_end(key)
        return self._held[key]


def point(selected: SelectedPoint, parameters: Parameters) -> dict[str, Any]:
    """Return the selected landing point with the obstacles around it, nearest first."""
    around = selected.surroundings
    way_in = None if around is None else around.way_in()
    nearest = () if around is None else around.obstacles[:MOST_OBSTACLES]
    return {
        "enu_m": [float(v) if math.isfinite(v) else None for v in selected.enu_m],
        "state": selected.state.value,
        "judged_by": selected.judged_by,
        "height_m": _number(selected.height_m, 2),
        "slope_deg": _number(selected.slope_deg, 1),
        "relief_m": _number(selected.relief_m, 2),
        "certainty": _number(selected.certainty, 4),
        "headings_deg": list(selected.footing.headings_deg),
        "blocked_by": selected.footing.blocked_by or None,
        **corridor_summary(selected.corridors),
        "rose": _rose(selected.corridors),
        "unseen": _number(selected.footing.unseen, 4),
        **surface_summary(selected.surface),
        "may_be_water": selected.surface.water > parameters.water_suspicion,
        "zone": selected.zone_id,
        "way_in_deg": None if way_in is None else round(math.degrees(way_in[0])),
        "horizon_deg": [] if around is None else [_number(v, 0) for v in around.horizon_deg],
        "obstacles": [_obstacle(obstacle, selected) for obstacle in nearest],
    }


def _obstacle(obstacle: Obstacle, selected: SelectedPoint) -> dict[str, Any]:
    return {
        "east_m": round(obstacle.east_m, 2),
        "north_m": round(obstacle.north_m, 2),
        "top_m": round(obstacle.top_m, 2),
        "height_m": round(obstacle.height_m, 2),
        "extent_m": [round(v, 2) for v in obstacle.extent_m],
        "distance_m": round(obstacle.distance_m(selected.enu_m), 1),
    }


def _rose(corridors: Corridors | None) -> dict[str, Any] | None:
    """Return the best way at each bearing: c clear, b blocked, u unknown, and the least clear slope (deg)."""
    if corridors is None:
        return None
    sloped = corridors.states[:, :-1]  # all but straight up
    clear, unknown = (sloped == SAFE).any(axis=1), (sloped == UNKNOWN).any(axis=1)
    return {
        "states": "".join(np.where(clear, "c", np.where(unknown, "u", "b")).tolist()),
        "slopes_deg": [
            float(slope) if ok else None
            for ok, slope in zip(clear.tolist(), corridors.clear_slope_deg.tolist(), strict=True)
        ],
    }


def _ring(coords: Any) -> list[int]:
    points = np.asarray(coords)[:-1] * CENTIMETRES
    return [int(v) for v in np.rint(points).ravel()]


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None
