"""Flight summary: the document that `--json` prints."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.flight_view import FlightView
from companion.flight.landing.situation import Phase
from companion.flight.link.vehicle_class import type_name
from companion.flight.outputs.geojson_features import wire_summary
from companion.flight.outputs.report_summary import choice_summary, point_summary, zone_summary
from companion.flight.sensing import Sensing
from slz import LocalFrame, Report


def flight_summary(flight: FlightView) -> dict[str, Any]:
    """Return the summary of a flight that `--json` prints."""
    executive, worker = flight.deciding.executive, flight.mapping.worker
    sensing = flight.sensing
    vehicle = flight.link.vehicle
    diagnosis = sensing.lidar.diagnosis
    tally, frame = executive.tally, sensing.history.frame
    chosen = None
    if tally.chosen_enu_m is not None and frame is not None:
        chosen = {**_place(frame, tally.chosen_enu_m), "zone": tally.zone_id}
    landed = executive.phase is Phase.LANDED
    touchdown = None
    if landed and tally.landed_enu_m is not None and frame is not None:
        touchdown = _place(frame, tally.landed_enu_m)
    return {
        "vehicle": type_name(vehicle.vehicle_type) if vehicle.sysid is not None else None,
        "no_commands": flight.link.no_command_reason,
        "phase": executive.phase.value,
        "landed": landed,
        "chosen": chosen,
        "touchdown": touchdown,
        "aborts": tally.aborts,
        "abort_reasons": tally.abort_reasons,
        "pilot_took_over": tally.hands_off,
        "failsafes": tally.failsafes,
        "off_point_m": None if tally.off_point_m is None else round(tally.off_point_m, 2),
        "landing_here": None if executive.assist.now is None else executive.assist.now.text,
        "assist": {"mode": flight.parameters.assist, **asdict(executive.assist.tally)},
        **_found(flight.mapping.latest.newest),
        "zones_seen": len(flight.mapping.latest.zones_seen),
        "reports": worker.reports,
        "dropped_windows": worker.dropped_windows,
        "failed_windows": worker.failed,
        "late_windows": worker.late,
        "latency_ms": _quantiles(worker.ages_ms.array().ravel()),
        "wind": sensing.wind.summary(),
        "autopilot_parameters": flight.deciding.fitness.summary(),
        "streams": flight.streams.statistics(),
        "link": asdict(flight.link.statistics()),
        "lidar": sensing.lidar.statistics(),
        "lidar_faults": [] if diagnosis is None else [episode.document() for episode in diagnosis.episodes],
        "radar": None if sensing.radar is None else sensing.radar.statistics(),
        "fusion": sensing.assembler.statistics(),
        "odometry": _odometry(sensing),
        "recording": flight.recordings.statistics(),
        "ros2": None if sensing.ros is None else sensing.ros.statistics(),
    }


def _odometry(sensing: Sensing) -> dict[str, Any] | None:
    if sensing.odometry is None:
        return None
    messages = {} if sensing.ros_odometry is None else sensing.ros_odometry.statistics()
    return {"by": sensing.odometry.name, **sensing.odometry.statistics(), **messages}


def _found(report: Report | None) -> dict[str, Any]:
    if report is None:
        return {"zones": [], "choice": None, "point": None, "wires": []}
    selected = report.selected
    return {
        "zones": [zone_summary(zone, report.frame) for zone in report.zones],
        "choice": choice_summary(report),
        "point": None if selected is None else point_summary(selected, report.frame),
        "wires": [wire_summary(wire, report.frame) for wire in report.wires],
    }


def _place(frame: LocalFrame, enu_m: NDArray[np.float64]) -> dict[str, float]:
    lat, lon, alt = (float(v) for v in frame.lla(enu_m))
    return {"lat": lat, "lon": lon, "alt_m": alt}


def _quantiles(values: NDArray[np.float64]) -> dict[str, float | None]:
    if not len(values):
        return {"p50": None, "p99": None, "max": None}
    p50, p99 = np.percentile(values, [50, 99])
    return {"p50": round(float(p50), 2), "p99": round(float(p99), 2), "max": round(float(values.max()), 2)}
