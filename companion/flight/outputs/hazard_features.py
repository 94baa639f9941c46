"""GeoJSON features (RFC 7946) of what is not ground: wires, and what moves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from companion.flight.outputs.wire_summary import wire_feature
from companion.flight.outputs.zone_outline import DEGREE_DECIMALS
from slz import LocalFrame, Wire


def hazard_features(
    wires: Iterable[Wire], moving: Iterable[Mapping[str, Any]], frame: LocalFrame
) -> list[dict[str, Any]]:
    """Return the wires as lines with altitudes, and what moves as points.

    Parameters
    ----------
    moving
        Objects of the state document: `number`, `enu_m` and `velocity_ms` (2,), `radius_m` and `height_m`.
    """
    features = [wire_feature(wire, frame) for wire in wires]
    for feature in features:
        feature["properties"]["kind"] = "wire"
    return features + [_moving_feature(one, frame) for one in moving]


def _moving_feature(one: Mapping[str, Any], frame: LocalFrame) -> dict[str, Any]:
    lat, lon, _ = (float(v) for v in frame.lla([*one["enu_m"], 0.0]))
    east_ms, north_ms = one["velocity_ms"]
    return {
        "type": "Feature",
        "id": f"moving {one['number']}",
        "geometry": {
            "type": "Point",
            "coordinates": [round(lon, DEGREE_DECIMALS), round(lat, DEGREE_DECIMALS)],
        },
        "properties": {
            "kind": "moving",
            "number": one["number"],
            "speed_ms": round(math.hypot(east_ms, north_ms), 1),
            "course_deg": round(math.degrees(math.atan2(east_ms, north_ms))) % 360,
            "radius_m": one["radius_m"],
            "height_m": one["height_m"],
        },
    }
