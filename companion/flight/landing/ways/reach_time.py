"""Time to reach a landing point, with the wind."""

from __future__ import annotations

import math

import numpy as np

from companion.flight.geometry.wind import Wind
from companion.flight.landing.situation import Vector
from params import Parameters

LANDING_MS = 0.5  # sink rate of autopilots at the end of a landing
OVER_POINT_S = 4.0  # over the point, before the descent


def reach_time_s(
    position_enu_m: Vector, point_enu_m: Vector, parameters: Parameters, wind: Wind | None
) -> float:
    """Return the time from a position to the touchdown at a point: level flight, descent and landing.

    The ground speed is `approach_speed_ms`, or less where the wind leaves less of `max_airspeed_ms`; infinite
    where it leaves nothing. An unknown wind slows nothing.
    """
    p, offset = parameters, point_enu_m - position_enu_m
    away_m, height_m = float(np.hypot(*offset[:2])), -float(offset[2])
    level_s = 0.0
    if away_m > 0:
        speed_ms = min(p.approach_speed_ms, _ground_speed_ms(offset[:2] / away_m, p.max_airspeed_ms, wind))
        level_s = away_m / speed_ms if speed_ms > 0 else math.inf
    rise_s = max(0.0, -height_m) / p.climb_speed_ms
    final_m = min(max(0.0, height_m), p.commit_height_m)
    sink_s = (max(0.0, height_m) - final_m) / p.descent_speed_ms + final_m / LANDING_MS
    return level_s + rise_s + OVER_POINT_S + sink_s


def _ground_speed_ms(way: Vector, airspeed_ms: float, wind: Wind | None) -> float:
    """Return the greatest ground speed along a unit vector (2,) east, north; 0 where the wind is stronger."""
    if wind is None:
        return airspeed_ms
    air_ms = -wind.speed_ms * np.array([math.sin(wind.from_rad), math.cos(wind.from_rad)])
    along_ms, across_ms = float(air_ms @ way), float(air_ms @ np.array([way[1], -way[0]]))
    left = airspeed_ms**2 - across_ms**2
    return max(0.0, along_ms + math.sqrt(left)) if left > 0 else 0.0
