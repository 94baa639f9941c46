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
from slz.kernels.argument_types import Array1D, ReadOnly2D
from slz.kernels.jit import kernel, kernel_part

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
    around = np.ascontiguousarray(around_frd_m, np.float64)
    horizontal = _limit_horizontal(velocity_frd_ms[:2], around, least_m, aside_m)
    wanted_sink = sink = float(velocity_frd_ms[2])
    if sink < 0:
        sink = max(sink, -stopping_speed_ms(nearest_above_m(around, least_m, aside_m)))
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


def _limit_horizontal(velocity_ms: Vector, around_m: Vector, least_m: float, aside_m: float) -> Vector:
    """Return the horizontal velocity (2,), limited by the obstacles in its corridor."""
    speed = float(np.hypot(*velocity_ms))
    if speed < 1e-6:
        return np.zeros(2)
    way = velocity_ms / speed
    ahead_m = nearest_ahead_m(around_m, float(way[0]), float(way[1]), least_m, aside_m, LEVEL_M)
    return np.asarray(way * min(speed, stopping_speed_ms(ahead_m)))


def stopping_speed_ms(ahead_m: float) -> float:
    """Return the greatest speed that can be braked before something at a distance ahead."""
    return math.sqrt(2 * BRAKING_MS2 * max(0.0, ahead_m - MARGIN_M))


@kernel_part
def _sift(distance: float, least: Array1D[np.float64]) -> None:
    """Insert a distance into the least ones, ascending."""
    for k in range(len(least)):
        if distance < least[k]:
            distance, least[k] = least[k], distance


@kernel
def nearest_ahead_m(
    around: ReadOnly2D[np.float64],
    forward: float,
    right: float,
    least_m: float,
    aside_m: float,
    level_m: float,
) -> float:
    """Return the distance of the nearest point beyond `least_m` in a corridor but `STRAYS`, inf without one.

    forward, right: unit vector of the corridor; aside_m, level_m: half its width and height.
    """
    nearest = np.full(STRAYS + 1, np.inf)
    for i in range(len(around)):
        x, y = around[i, 0], around[i, 1]
        along = x * forward + y * right
        if abs(around[i, 2]) < level_m and along > least_m and abs(y * forward - x * right) < aside_m:
            _sift(along, nearest)
    return float(nearest[STRAYS])


@kernel
def nearest_above_m(around: ReadOnly2D[np.float64], least_m: float, aside_m: float) -> float:
    """Return the height of the lowest point beyond `least_m` above but `STRAYS`, infinite without one."""
    nearest = np.full(STRAYS + 1, np.inf)
    for i in range(len(around)):
        if -around[i, 2] > least_m and math.hypot(around[i, 0], around[i, 1]) < aside_m:
            _sift(-around[i, 2], nearest)
    return float(nearest[STRAYS])
