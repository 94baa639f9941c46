"""Replay format of a recording: topics and message encoding.

Messages are in the order in which the program processed them. Their log time is the time of day: the
companion's clock plus `clock_offset_ns` of the file's metadata `slz`.

| topic | message |
|---|---|
| /raw/mavlink/in | one accepted MAVLink frame |
| /raw/mavlink/out | one sent MAVLink frame |
| /raw/lidar | a batch of the sensor's packets with their arrival times |
| /raw/odometry | messages of an external odometry with their arrival times |
| /raw/event | JSON: a request for the autopilot's time; a map frame that began; a window that was processed |
| /raw/report | JSON: zones, landing point and wires of a window's report |
| /raw/gap | JSON: number of the above messages that were lost here |
"""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import asdict
from typing import Any

import numpy as np

from companion.flight.mapping.window_event import WindowEvent
from slz import LocalFrame, Report, SelectedPoint, Wire, Zone

VERSION = 1
METADATA = "slz"
MAVLINK_IN, MAVLINK_OUT = "/raw/mavlink/in", "/raw/mavlink/out"
LIDAR, ODOMETRY, EVENT = "/raw/lidar", "/raw/odometry", "/raw/event"
REPORT, GAP = "/raw/report", "/raw/gap"
TOPICS = frozenset({MAVLINK_IN, MAVLINK_OUT, LIDAR, ODOMETRY, EVENT, REPORT, GAP})

_PACKET = struct.Struct("<QI")  # arrival on the companion's clock (ns), bytes of the packet

Batch = list[tuple[int, bytes]]


class BadRecordError(ValueError):
    """Unreadable message of a recording; the message says why."""


def pack_batch(batch: Batch) -> bytes:
    """Encode packets with their arrival times as one message."""
    return b"".join(part for at_ns, packet in batch for part in (_PACKET.pack(at_ns, len(packet)), packet))


def packed_bytes(batch: Batch) -> int:
    """Return the length of that message."""
    return sum(_PACKET.size + len(packet) for _, packet in batch)


def unpack_batch(data: bytes) -> Batch:
    """Decode the packets of a message with their arrival times.

    Raises
    ------
    BadRecordError
        The message ends within a packet.
    """
    batch: Batch = []
    at = 0
    while at < len(data):
        if at + _PACKET.size > len(data):
            raise BadRecordError(f"a batch of packets ends after {len(data)} bytes, within a packet's head")
        at_ns, size = _PACKET.unpack_from(data, at)
        at += _PACKET.size
        if at + size > len(data):
            raise BadRecordError(f"a batch of packets ends after {len(data)} bytes, within a packet")
        batch.append((at_ns, data[at : at + size]))
        at += size
    return batch


def pack_window(event: WindowEvent) -> bytes:
    """Encode the event of a window as one message."""
    return json.dumps({"window": asdict(event)}).encode()


def pack_frame(frame: LocalFrame) -> bytes:
    """Encode the beginning of a map frame as one message."""
    return json.dumps({"frame": [frame.lat_deg, frame.lon_deg, frame.alt_m]}).encode()


def unpack_event(data: bytes) -> WindowEvent | LocalFrame | int:
    """Decode an event: a window, a map frame that began, or the time of a request for the clock (ns).

    Raises
    ------
    BadRecordError
        The event is none of these, or a field is missing or of another type.
    """
    try:
        value = json.loads(data)
        if "time_asked_ns" in value:
            return int(value["time_asked_ns"])
        if "frame" in value:
            lat_deg, lon_deg, alt_m = map(float, value["frame"])
            return LocalFrame(lat_deg, lon_deg, alt_m)
        window = value["window"]
        return WindowEvent(
            int(window["number"]),
            tuple((int(first), int(last)) for first, last in window["scans"]),
            tuple(None if p is None else (float(p[0]), float(p[1]), float(p[2])) for p in window["selects"]),
            bool(window["anew"]),
            tuple((str(name), value) for name, value in window.get("changed", ())),
        )
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, RecursionError) as error:
        raise BadRecordError(f"an event cannot be read: {error!r}") from None


def report_document(report: Report) -> bytes:
    """Return all zones and the landing point of a report, without rounding, as JSON."""
    return json.dumps(
        {
            "stamp_ns": report.stamp_ns,
            "points": report.n_points,
            "used": report.n_used,
            "near": [_zone(zone) for zone in report.near.zones],
            "far": [_zone(zone) for zone in report.far.zones],
            "selected": None if report.selected is None else _selected(report.selected),
            "wires": [_wire(wire) for wire in report.wires],
        }
    ).encode()


def _zone(zone: Zone) -> dict[str, Any]:
    return {
        "id": zone.id,
        "area_m2": zone.area_m2,
        "certainty": zone.certainty,
        "counts": [zone.n_safe, zone.n_unsafe, zone.n_uncertain],
        "slope_deg": zone.slope_deg,
        "roughness": zone.roughness,
        "best": [float(v) for v in zone.best.enu_m],
        "square_side_m": zone.best.square_side_m,
        "clearance_m": zone.best.clearance_m,
        "obstacles": len(zone.obstacles),
        "sha256": hashlib.sha256(
            zone.cells.tobytes()
            + np.ascontiguousarray(zone.boundary_cells).tobytes()
            + np.ascontiguousarray(zone.corners_enu_m).tobytes()
        ).hexdigest(),
    }


def _wire(wire: Wire) -> dict[str, Any]:
    return {
        "number": wire.number,
        "ends": [[float(v) for v in end] for end in wire.ends_enu_m],
        "place_m": wire.curve.place_m.tolist(),
        "along": wire.curve.along.tolist(),
        "heights": wire.curve.heights.tolist(),
        "from_to_m": [wire.from_m, wire.to_m],
        "returns": wire.n_returns,
        "seen_ns": [wire.first_seen_ns, wire.last_seen_ns],
    }


def _selected(point: SelectedPoint) -> dict[str, Any]:
    return {
        "enu_m": [float(v) for v in point.enu_m],
        "state": point.state.value,
        "judged_by": point.judged_by,
        "height_m": point.height_m,
        "certainty": point.certainty,
        "zone": point.zone_id,
    }
