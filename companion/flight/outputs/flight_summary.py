"""What `--json` tells of a flight, of its zones and of the landing point."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.landing.situation import Phase
from slz import LocalFrame, Obstacle, Report, SelectedPoint, Zone

if TYPE_CHECKING:
    from companion.flight.app import Companion

MOST_OBSTACLES = 20


def zone_summary(zone: Zone, frame: LocalFrame) -> dict[str, Any]:
    """Return a zone with its landing point; why: what places it behind the zone before it."""
    lat, lon, alt = (float(v) for v in frame.lla(zone.best.enu_m))
    return {
        "id": zone.id,
        "area_m2": round(zone.area_m2, 2),
        "certainty": round(zone.certainty, 4),
        "slope_deg": round(zone.slope_deg, 2),
        "roughness": round(zone.roughness, 4),
        "square_side_m": round(zone.best.square_side_m, 2),
        "clearance_m": round(zone.best.clearance_m, 2),
        "point_certainty": round(zone.best.certainty, 4),
        "why": zone.why,
        "lat": lat,
        "lon": lon,
        "alt_m": alt,
        "obstacles": len(zone.obstacles),
    }


def choice_summary(report: Report) -> dict[str, Any]:
    """Return mode, cells and window of the last report, and what they were chosen from."""
    choice = report.choice
    return {
        "mode": "far" if choice.far else "near",
        "near_cell_m": report.near.grid.cell_m,
        "far_cell_m": report.far.grid.cell_m,
        "window_s": choice.window_s,
        "density_per_m2": round(choice.density_per_m2, 1),
        "height_m": round(choice.height_m, 1) if math.isfinite(choice.height_m) else None,
        "speed_ms": round(choice.speed_ms, 1),
        "far_zones": len(report.far.zones),
    }


def point_summary(point: SelectedPoint, frame: LocalFrame) -> dict[str, Any]:
    """Return the state of the selected point and the obstacles around it, the nearest first."""
    lat, lon, alt = (float(v) for v in frame.lla(np.nan_to_num(point.enu_m)))
    found: dict[str, Any] = {
        "state": point.state.value,
        "judged_by": point.judged_by,
        "lat": lat,
        "lon": lon,
        "alt_m": alt,
        "certainty": round(point.certainty, 4) if math.isfinite(point.certainty) else None,
        "way_in_deg": None,
        "obstacles": [],
    }
    if point.surroundings is not None:
        way_in = point.surroundings.way_in()
        found["way_in_deg"] = None if way_in is None else round(math.degrees(way_in[0]))
        nearest = point.surroundings.obstacles[:MOST_OBSTACLES]
        found["obstacles"] = [_obstacle(obstacle, point, frame) for obstacle in nearest]
    return found


def _obstacle(obstacle: Obstacle, point: SelectedPoint, frame: LocalFrame) -> dict[str, Any]:
    lat, lon, alt = (float(v) for v in obstacle.lla(frame))
    return {
        "lat": lat,
        "lon": lon,
        "alt_m": round(alt, 2),
        "height_m": round(obstacle.height_m, 2),
        "width_m": round(obstacle.width_m, 2),
        "distance_m": round(obstacle.distance_m(point.enu_m), 2),
    }


def flight_summary(companion: Companion) -> dict[str, Any]:
    """Return what the flight came to, as `--json` prints it."""
    executive, worker, radar = companion.executive, companion.worker, companion.radar
    tally, frame = executive.tally, companion.history.frame
    chosen = None
    if tally.chosen_enu_m is not None and frame is not None:
        chosen = {**_place(frame, tally.chosen_enu_m), "zone": tally.zone_id}
    landed = executive.phase is Phase.LANDED
    touchdown = None
    if landed and companion.path_enu_m and frame is not None:
        touchdown = _place(frame, companion.path_enu_m.last)
    return {
        "phase": executive.phase.value,
        "landed": landed,
        "chosen": chosen,
        "touchdown": touchdown,
        "aborts": tally.aborts,
        "abort_reasons": tally.abort_reasons,
        "pilot_took_over": tally.hands_off,
        "failsafes": tally.failsafes,
        "off_point_m": None if tally.off_point_m is None else round(tally.off_point_m, 2),
        **_found(companion.report),
        "zones_seen": len(companion.zones_seen),
        "reports": worker.reports,
        "dropped_windows": worker.dropped_windows,
        "failed_windows": worker.failed,
        "late_windows": worker.late,
        "latency_ms": _quantiles(worker.latencies_ms.array()),
        "autopilot_parameters": companion.fitness.summary(),
        "streams": companion.streams.statistics(),
        "link": asdict(companion.link.statistics()),
        "lidar": companion.lidar.statistics(),
        "radar": None if radar is None else radar.statistics(),
        "fusion": companion.assembler.statistics(),
        "recording": companion.recordings.statistics(),
    }


def _found(report: Report | None) -> dict[str, Any]:
    if report is None:
        return {"zones": [], "choice": None, "point": None}
    selected = report.selected
    return {
        "zones": [zone_summary(zone, report.frame) for zone in report.zones],
        "choice": choice_summary(report),
        "point": None if selected is None else point_summary(selected, report.frame),
    }


def _place(frame: LocalFrame, enu_m: NDArray[np.float64]) -> dict[str, float]:
    lat, lon, alt = (float(v) for v in frame.lla(enu_m))
    return {"lat": lat, "lon": lon, "alt_m": alt}


def _quantiles(values: NDArray[np.float64]) -> dict[str, float | None]:
    if not len(values):
        return {"p50": None, "p99": None, "max": None}
    p50, p99 = np.percentile(values, [50, 99])
    return {"p50": round(float(p50), 2), "p99": round(float(p99), 2), "max": round(float(values.max()), 2)}
