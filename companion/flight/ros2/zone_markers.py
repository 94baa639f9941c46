"""Zones, landing point and wires as visualization_msgs/MarkerArray."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.rmw.message_types import message_types
from companion.flight.ros2.frame_messages import header, place, pose_at, vector
from slz import PointState, Report, Wire, Zone

ADD, DELETE_ALL = 0, 3
SPHERE, LINE_STRIP, TEXT = 2, 4, 9
LIFT_M = 0.3  # height of lines above the ground
LIFETIME_S = 5
Colour = tuple[float, float, float, float]
BEST, OTHER, WIRE = (0.0, 0.4, 0.1, 1.0), (0.45, 0.85, 0.45, 1.0), (1.0, 0.69, 0.0, 1.0)
POINT_COLOURS: dict[PointState, Colour] = {
    PointState.SAFE: (0.1, 0.5, 1.0, 0.9),
    PointState.UNSAFE: (0.9, 0.1, 0.1, 0.9),
    PointState.UNKNOWN: (0.6, 0.6, 0.6, 0.9),
}
NOWHERE, UP = np.zeros(3), np.array([0.0, 0.0, 1.0])

_make = message_types().make


def markers(report: Report, at_ns: int) -> Any:
    """Return the outlines of the zones with labels, the best darkest, the landing point and the wires."""
    found = [_marker("", 0, 0, at_ns, action=DELETE_ALL)]
    for rank, zone in enumerate(report.zones):
        found += _zone(zone, OTHER if rank else BEST, at_ns)
    found += [_wire(wire, at_ns) for wire in report.wires]
    selected = report.selected
    if selected is not None:
        where = np.array([*selected.enu_m[:2], np.nan_to_num(selected.height_m)])
        colour = POINT_COLOURS[selected.state]
        found.append(_marker("landing_point", 0, SPHERE, at_ns, where, (1.0, 1.0, 1.0), colour))
    return _make("visualization_msgs/msg/MarkerArray", found)


def no_markers(at_ns: int) -> Any:
    """Return the message that removes all markers."""
    return _make("visualization_msgs/msg/MarkerArray", [_marker("", 0, 0, at_ns, action=DELETE_ALL)])


def _zone(zone: Zone, colour: Colour, at_ns: int) -> list[Any]:
    corners = np.asarray(zone.corners_enu_m, np.float64).reshape(-1, 3)
    closed = np.concatenate([corners, corners[:1]]) + LIFT_M * UP
    above = zone.best.enu_m + (1.0 + LIFT_M) * UP
    text = f"{zone.id}: {zone.area_m2:.0f} m2, {zone.best.certainty:.3f}"
    return [
        _marker("zones", zone.id, LINE_STRIP, at_ns, NOWHERE, (0.2, 0.0, 0.0), colour, points=closed),
        _marker("labels", zone.id, TEXT, at_ns, above, (0.0, 0.0, 1.0), colour, text=text),
    ]


def _wire(wire: Wire, at_ns: int) -> Any:
    places, _, _ = wire.sampled(2.0)
    return _marker("wires", wire.number, LINE_STRIP, at_ns, NOWHERE, (0.2, 0.0, 0.0), WIRE, points=places)


def _marker(
    namespace: str,
    number: int,
    kind: int,
    at_ns: int,
    where: NDArray[np.float64] = NOWHERE,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
    colour: Colour = (0.0, 0.0, 0.0, 0.0),
    *,
    points: NDArray[np.float64] | None = None,
    text: str = "",
    action: int = ADD,
) -> Any:
    stamp = header(at_ns)
    nothing = np.zeros(0, np.uint8)
    return _make(
        "visualization_msgs/msg/Marker",
        *(stamp, namespace, number, kind, action),
        *(pose_at(where), vector(np.array(scale)), _make("std_msgs/msg/ColorRGBA", *colour)),
        *(_make("builtin_interfaces/msg/Duration", LIFETIME_S, 0), False),
        [] if points is None else [place(point) for point in points],
        [],
        *("", _make("sensor_msgs/msg/CompressedImage", stamp, "", nothing), [], text, ""),
        *(_make("visualization_msgs/msg/MeshFile", "", nothing), False),
    )
