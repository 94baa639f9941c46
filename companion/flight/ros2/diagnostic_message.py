"""State of the program as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from companion.flight.flight_view import FlightView
from companion.flight.fusion.external_odometry.external_odometry import ExternalOdometry
from companion.flight.rmw.message_types import message_types
from companion.flight.ros2.frame_messages import header

OK, WARN, ERROR = 0, 1, 2
HARDWARE = "slz"

_make = message_types().make
Status = tuple[str, int, str, Mapping[str, Any]]


def statuses(flight: FlightView, ros: Mapping[str, Any]) -> list[Status]:
    """Return name, level, text and values of each part; call it in the companion's loop.

    ros: counters of the ROS node.
    """
    s, worker = flight.deciding.situations.situation(), flight.mapping.worker
    report = flight.mapping.latest.newest
    selected = None if report is None else report.selected
    frame = flight.sensing.history.frame
    phase = flight.deciding.executive.phase.value
    landing = {
        "phase": phase,
        "mode": s.mode,
        "zones": 0 if report is None else len(report.zones),
        "point": "none" if selected is None else selected.state.value,
        "aborts": flight.deciding.executive.tally.aborts,
    }
    origin = {} if frame is None else {"lat": frame.lat_deg, "lon": frame.lon_deg, "alt_m": frame.alt_m}
    mapping = {
        "reports": worker.reports,
        "dropped_windows": worker.dropped_windows,
        "failed_windows": worker.failed,
        "late_windows": worker.late,
        **{f"origin_{name}": value for name, value in origin.items()},
    }
    link = flight.link.statistics()
    counters = {"lost": link.lost, "bad": link.bad, "dropped": link.dropped}
    blind = s.no_map_reason.text if not s.lidar_ok else ""
    return [
        ("landing", ERROR if s.failsafe else OK, "failsafe" if s.failsafe else phase, landing),
        ("map", ERROR if worker.invalid else OK, "withdrawn" if worker.invalid else "", mapping),
        ("LiDAR", WARN if blind else OK, blind, flight.sensing.lidar.statistics()),
        ("MAVLink", OK if s.connected else ERROR, "" if s.connected else "no autopilot", counters),
        *_odometry(flight, s.now_ns),
        ("ROS 2", OK, "", ros),
    ]


def _odometry(flight: FlightView, at_ns: int) -> list[Status]:
    """Return the state of the odometry that is subscribed, none without one."""
    odometry, messages = flight.sensing.odometry, flight.sensing.ros_odometry
    if messages is None or not isinstance(odometry, ExternalOdometry):
        return []
    why = odometry.why_not(at_ns)
    counters = {**messages.statistics(), **odometry.statistics()}
    return [("odometry", WARN if why else OK, why, {"topic": str(messages.topic), **counters})]


def diagnostics(parts: list[Status], at_ns: int) -> Any:
    """Return the message of the parts."""
    return _make("diagnostic_msgs/msg/DiagnosticArray", header(at_ns, ""), [_status(*one) for one in parts])


def _status(name: str, level: int, text: str, values: Mapping[str, Any]) -> Any:
    pairs = [_make("diagnostic_msgs/msg/KeyValue", key, str(value)) for key, value in values.items()]
    return _make("diagnostic_msgs/msg/DiagnosticStatus", level, f"slz: {name}", text, HARDWARE, pairs)
