"""Endurance of the battery, and the time that a landing takes from a position to the touchdown."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from companion.flight.geometry.wind import Wind
from companion.flight.landing.situation import Situation, Vector
from params import Parameters

SECOND = 1_000_000_000
SPAN_NS = 300 * SECOND  # over which the charge's fall counts
LEAST_FALL_PCT = 2.0  # charges come in whole percents: after less than two the rate is a guess
RESERVE_PCT = 5.0  # left at the end: voltage breaks down below
LANDING_MS = 0.5  # sink rate of autopilots at the end of a landing
OVER_POINT_S = 4.0  # over the point, before the descent


class Endurance:
    """Time until the charge has fallen to 5 %, by its rate in the last five minutes.

    A rising charge means another battery or a corrected estimate: earlier charges no longer count.
    """

    def __init__(self) -> None:
        self._charges: deque[tuple[int, float]] = deque()  # stamps and charges, at each change

    def follow(self, s: Situation) -> None:
        """Use the charge that the autopilot reports, None while it reports none."""
        now_ns, charge_pct = s.now_ns, s.battery_pct
        if charge_pct is None:
            self._charges.clear()
            return
        if self._charges and charge_pct > self._charges[-1][1]:
            self._charges.clear()
        if not self._charges or charge_pct < self._charges[-1][1]:
            self._charges.append((now_ns, charge_pct))
        while len(self._charges) > 2 and now_ns - self._charges[1][0] >= SPAN_NS:
            self._charges.popleft()

    def left_s(self, now_ns: int) -> float | None:
        """Return the seconds left (0 at 5 % and below), None while the fall is unknown."""
        if not self._charges:
            return None
        (since_ns, first_pct), (at_ns, last_pct) = self._charges[0], self._charges[-1]
        if last_pct <= RESERVE_PCT:
            return 0.0
        if first_pct - last_pct < LEAST_FALL_PCT or at_ns == since_ns:
            return None
        rate_pct_s = (first_pct - last_pct) / ((at_ns - since_ns) / SECOND)
        return max(0.0, (last_pct - RESERVE_PCT) / rate_pct_s - (now_ns - at_ns) / SECOND)


def is_battery_low(s: Situation, parameters: Parameters) -> bool:
    """Return whether the charge is at or below the one at which to land."""
    return s.battery_pct is not None and 0 < parameters.battery_land_pct >= s.battery_pct


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
