"""Circle around the landing point on a ground station's map: ORBIT_EXECUTION_STATUS, once a second.

QGroundControl draws it for any component of the vehicle and removes it 3 s after the last message. It is a
report, which PX4 sends and does not receive. ADSB_VEHICLE, which more stations draw, would reach the
autopilot, too, and be traffic to avoid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.situation import Situation
from params import Parameters
from slz import LandingPoint, PointState, Report

# The vehicle flies an orbit of its own, whose circle the station must keep.
ORBIT_NS = 5_000_000_000


@dataclass(frozen=True, slots=True)
class MapCircle:
    """Circle on the map: degrees, altitude of its centre above mean sea level in m, radius in m."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    radius_m: float


def landing_circle(situation: Situation, parameters: Parameters) -> MapCircle | None:
    """Return the circle to draw, None for none.

    Around the selected point while it is safe: the ground that was judged for it. Without one, around the
    best point that needs no confirmation: the largest circle in its zone. Nothing else is drawn.
    """
    report = situation.report
    if report is None or not situation.lidar_ok:
        return None
    if report.selected is not None or situation.selected is not None:
        selected = situation.selected
        if selected is None or selected.state is not PointState.SAFE:
            return None
        centre = (*selected.enu_m[:2], selected.height_m)
        radius_m = parameters.touchdown_error_m + parameters.footprint_m / 2
    else:
        points = (zone.best for zone in report.zones)
        best = next((point for point in points if _is_certain(point, parameters)), None)
        if best is None:
            return None
        centre, radius_m = tuple(best.enu_m), best.clearance_m
    return _circle(report, centre, radius_m)


def _is_certain(point: LandingPoint, parameters: Parameters) -> bool:
    confirmed = not point.surface.must_be_confirmed(parameters.roof, parameters.vegetation)
    return confirmed and not point.has_no_heading and point.certainty >= parameters.min_certainty


def _circle(report: Report, centre_enu_m: tuple[float, ...], radius_m: float) -> MapCircle | None:
    if not all(map(math.isfinite, (*centre_enu_m, radius_m))) or radius_m <= 0:
        return None
    lat, lon, alt = (float(v) for v in report.frame.lla(centre_enu_m))
    return MapCircle(lat, lon, alt, radius_m)


class MapCircleStream:
    """Messages of the circle, except while the vehicle reports an orbit of its own."""

    def __init__(self) -> None:
        self._orbit_ns: int | None = None

    def on_orbit(self, _message: Any, at_ns: int) -> None:
        """Note that the vehicle reports an orbit."""
        self._orbit_ns = at_ns

    def message(self, circle: MapCircle | None, at_ns: int) -> Any | None:
        """Return the message to send now, None for none."""
        if circle is None or (self._orbit_ns is not None and at_ns - self._orbit_ns < ORBIT_NS):
            return None
        return mavlink.MAVLink_orbit_execution_status_message(
            at_ns // 1000,
            circle.radius_m,
            mavlink.MAV_FRAME_GLOBAL,
            round(circle.lat_deg * 1e7),
            round(circle.lon_deg * 1e7),
            circle.alt_m,
        )
