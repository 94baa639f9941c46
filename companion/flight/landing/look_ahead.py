"""Collision prevention: limits velocity before obstacles, whether or not the autopilot does.

ArduPilot's avoidance acts on velocity setpoints in its guided mode; PX4's acts on no setpoint of a companion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.flight.landing.guidance import BRAKING_MS2
from companion.flight.landing.situation import Vector
from params import Parameters

ASIDE_M = 1.5  # half the width of the corridor, for a vehicle that is not wider
LEVEL_M = 2.0  # half its height
MARGIN_M = 3.0
STRAYS = 2  # nearest returns ignored as possible dust
SLOW_MS = 0.3


@dataclass(frozen=True, slots=True)
class Limited:
    """Velocity (3,) that obstacles allow, and whether something ahead or above leaves next to none."""

    velocity_frd_ms: Vector
    blocked: bool
    blocked_above: bool


def limit_velocity(
    velocity_frd_ms: Vector, around_frd_m: Vector, least_m: float, aside_m: float = ASIDE_M
) -> Limited:
    """Return the velocity that lets the vehicle stop `MARGIN_M` before obstacles.

    Parameters
    ----------
    velocity_frd_ms
        Wanted velocity (3,), forward, right, down in level axes, m/s.
    around_frd_m
        Points (n, 3) relative to the vehicle in the same axes, m; points within `least_m` are the vehicle.
    aside_m
        Half the width of the way that must be free.
    """
    horizontal = limit_horizontal(velocity_frd_ms[:2], around_frd_m, least_m, aside_m)
    wanted_sink = sink = float(velocity_frd_ms[2])
    if sink < 0:
        above = np.hypot(around_frd_m[:, 0], around_frd_m[:, 1]) < aside_m
        sink = max(sink, -stopping_speed_ms(-around_frd_m[above, 2], least_m))
    wanted, left = float(np.hypot(*velocity_frd_ms[:2])), float(np.hypot(*horizontal))
    return Limited(
        np.array([*horizontal, sink]),
        blocked=wanted > SLOW_MS and left < SLOW_MS,
        blocked_above=wanted_sink < -SLOW_MS and sink > -SLOW_MS,
    )


def half_width_m(parameters: Parameters) -> float:
    """Return half the width of the way that a vehicle needs: of its footprint, discs and tail."""
    p = parameters
    return max(ASIDE_M, p.footprint_m / 2, p.greatest_dimension_m / 2)


def limit_horizontal(
    velocity_ms: Vector, around_m: Vector, least_m: float, aside_m: float = ASIDE_M
) -> Vector:
    """Return the horizontal velocity (2,), limited by the obstacles in its corridor."""
    speed = float(np.hypot(*velocity_ms))
    if speed < 1e-6:
        return np.zeros(2)
    way = velocity_ms / speed
    along = around_m[:, :2] @ way
    aside = np.abs(around_m[:, :2] @ np.array([-way[1], way[0]]))
    ahead = along[(aside < aside_m) & (np.abs(around_m[:, 2]) < LEVEL_M)]
    return np.asarray(way * min(speed, stopping_speed_ms(ahead, least_m)))


def stopping_speed_ms(ahead_m: Vector, least_m: float) -> float:
    """Return the greatest speed that can be braked before the nearest of the distances ahead."""
    ahead_m = ahead_m[ahead_m > least_m]
    if len(ahead_m) <= STRAYS:
        return math.inf
    nearest = float(np.partition(ahead_m, STRAYS)[STRAYS])
    return math.sqrt(2 * BRAKING_MS2 * max(0.0, nearest - MARGIN_M))
