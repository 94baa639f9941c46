"""Wind in the autopilot's messages."""

from __future__ import annotations

import math
from typing import Any

from companion.flight.link.autopilots.autopilot_interface import Autopilot

MESSAGES = ("WIND", "WIND_COV", "HIGH_LATENCY2")
MOST_MS = (
    75.0  # no aircraft of these flies in more; the strongest hurricanes reach it (WMO, category 5: 70 m/s)
)
Velocity = tuple[float, float]


class ImplausibleWindError(ValueError):
    """A message with numbers that no wind has."""


def wind_velocity_ms(message: Any, autopilot: Autopilot) -> Velocity | None:
    """Return the velocity of the air towards east and north in one of `MESSAGES`; None if that is unknown.

    WIND holds the direction from which the wind blows, WIND_COV the velocity of the air. HIGH_LATENCY2 has
    units of 2 degrees and 0.2 m/s, and a direction as its autopilot means it; a speed of zero is no estimate.

    Raises
    ------
    ImplausibleWindError
        Not finite, negative, or faster than `MOST_MS`.
    """
    match message.get_type():
        case "WIND":
            return _from(message.direction, message.speed)
        case "WIND_COV":
            if math.isnan(message.wind_x) or math.isnan(message.wind_y):
                return None
            return _plausible(message.wind_y, message.wind_x)
        case "HIGH_LATENCY2" if message.windspeed:
            turn_deg = 180 if autopilot.wind_heading_is_towards else 0
            return _from(2 * message.wind_heading + turn_deg, message.windspeed / 5)
    return None


def _from(from_deg: float, speed_ms: float) -> Velocity | None:
    if not (abs(from_deg) <= 540 and speed_ms >= 0):  # also for NaN
        raise ImplausibleWindError(f"{speed_ms} m/s from {from_deg} degrees")
    bearing = math.radians(from_deg)
    return _plausible(-speed_ms * math.sin(bearing), -speed_ms * math.cos(bearing))


def _plausible(east_ms: float, north_ms: float) -> Velocity | None:
    """Return a velocity; None for exactly zero, which autopilots send before they have an estimate."""
    if not math.hypot(east_ms, north_ms) <= MOST_MS:
        raise ImplausibleWindError(f"{east_ms}, {north_ms} m/s")
    return (east_ms, north_ms) if east_ms or north_ms else None
