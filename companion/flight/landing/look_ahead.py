"""Collision prevention: limits velocity before obstacles, whether or not the autopilot does.

ArduPilot's avoidance acts on velocity setpoints in its guided mode; PX4's acts on no setpoint of a companion.
"""

from __future__ import annotations

import math

import numpy as np

from companion.flight.landing.guidance import BRAKING_MS2
from companion.flight.landing.situation import Vector

ASIDE_M = 1.5  # half the width of the corridor
LEVEL_M = 2.0  # half its height
MARGIN_M = 3.0
STRAYS = 2  # nearest returns ignored as possible dust
SLOW_MS = 0.3


def limit_velocity(velocity_frd_ms: Vector, around_frd_m: Vector, least_m: float) -> tuple[Vector, bool]:
    """Return the velocity that lets the vehicle stop `MARGIN_M` before obstacles, and whether it is blocked.

    Parameters
    ----------
    velocity_frd_ms
        Wanted velocity (3,), forward, right, down in level axes, m/s.
    around_frd_m
        Points (n, 3) relative to the vehicle in the same axes, m; points within `least_m` are the vehicle.
    """
    horizontal = limit_horizontal(velocity_frd_ms[:2], around_frd_m, least_m)
    sink = float(velocity_frd_ms[2])
    if sink < 0:
        above = np.hypot(around_frd_m[:, 0], around_frd_m[:, 1]) < ASIDE_M
        sink = max(sink, -stopping_speed_ms(-around_frd_m[above, 2], least_m))
    wanted, left = float(np.hypot(*velocity_frd_ms[:2])), float(np.hypot(*horizontal))
    return np.array([*horizontal, sink]), wanted > SLOW_MS and left < SLOW_MS


def limit_horizontal(velocity_ms: Vector, around_m: Vector, least_m: float) -> Vector:
    """Return the horizontal velocity (2,), limited by the obstacles in its corridor."""
    speed = float(np.hypot(*velocity_ms))
    if speed < 1e-6:
        return np.zeros(2)
    way = velocity_ms / speed
    along = around_m[:, :2] @ way
    aside = np.abs(around_m[:, :2] @ np.array([-way[1], way[0]]))
    ahead = along[(aside < ASIDE_M) & (np.abs(around_m[:, 2]) < LEVEL_M)]
    return np.asarray(way * min(speed, stopping_speed_ms(ahead, least_m)))


def stopping_speed_ms(ahead_m: Vector, least_m: float) -> float:
    """Return the greatest speed that can be braked before the nearest of the distances ahead."""
    ahead_m = ahead_m[ahead_m > least_m]
    if len(ahead_m) <= STRAYS:
        return math.inf
    nearest = float(np.partition(ahead_m, STRAYS)[STRAYS])
    return math.sqrt(2 * BRAKING_MS2 * max(0.0, nearest - MARGIN_M))
