"""Wires in summaries, state documents and GeoJSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from companion.flight.outputs.zone_outline import DEGREE_DECIMALS
from slz import LocalFrame, Wire

STEP_M = 5.0


def wire_summary(wire: Wire, frame: LocalFrame) -> dict[str, Any]:
    """Return a wire as JSON: where it was seen from and to, and what is known of it."""
    return {
        "number": wire.number,
        "ends": [_place(end, frame) for end in wire.ends_enu_m],
        "length_m": round(wire.stop_m - wire.start_m, 1),
        "extrapolated_m": [round(wire.start_m - wire.from_m, 1), round(wire.to_m - wire.stop_m, 1)],
        "at_support": list(wire.at_support),
        "height_sd_m": round(float(wire.curve.height_sd_m(np.array([wire.start_m, wire.stop_m])).max()), 2),
        "returns": wire.n_returns,
    }


def wire_feature(wire: Wire, frame: LocalFrame) -> dict[str, Any]:
    """Return a wire as a GeoJSON feature (RFC 7946): a line with altitudes, extrapolated parts included."""
    points, _, _ = wire.sampled(STEP_M)
    lat, lon, alt = np.asarray(frame.lla(points)).T
    places = np.column_stack([lon.round(DEGREE_DECIMALS), lat.round(DEGREE_DECIMALS), alt.round(2)])
    return {
        "type": "Feature",
        "id": f"wire {wire.number}",
        "geometry": {"type": "LineString", "coordinates": places.tolist()},
        "properties": wire_summary(wire, frame),
    }


def _place(enu_m: np.ndarray[Any, Any], frame: LocalFrame) -> dict[str, float]:
    lat, lon, alt = (float(v) for v in frame.lla(enu_m))
    return {"lat": round(lat, DEGREE_DECIMALS), "lon": round(lon, DEGREE_DECIMALS), "alt_m": round(alt, 2)}
