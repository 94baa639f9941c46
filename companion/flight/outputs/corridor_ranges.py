"""Ways in and out of a point as ranges of bearings, with what blocks the others, for GeoJSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz import SAFE, UNKNOWN, UNSAFE, Corridors
from slz.landing_point.corridors import BEARINGS, STEP_DEG

ONE_OBSTACLE_M = 10.0  # tops of neighbouring bearings that are no farther apart count as one obstacle


@dataclass(frozen=True, slots=True)
class BearingRange:
    """Neighbouring bearings from a point with one state at the least slope.

    first, last: bearings (5 degrees, clockwise from north) from which to which, both included; first is the
    greater where the range passes north. highest: the bearing whose obstacle asks for the steepest slope,
    None where nothing blocks.
    """

    state: int
    first: int
    last: int
    highest: int | None


def bearing_ranges(corridors: Corridors) -> list[BearingRange]:
    """Return the ranges of all bearings at the least slope, clockwise from the first that begins after north.

    A blocked range holds one obstacle: it ends where the next bearing's top is more than `ONE_OBSTACLE_M`
    away.
    """
    states = corridors.states[:, 0]
    joined = states == np.roll(states, 1)
    aside = corridors.obstacles_enu_m - np.roll(corridors.obstacles_enu_m, 1, axis=0)
    joined &= (states != UNSAFE) | (np.hypot(aside[:, 0], aside[:, 1]) <= ONE_OBSTACLE_M)
    firsts = np.flatnonzero(~joined).tolist() or [0]
    return [_range(corridors, first, after) for first, after in _pairs(firsts)]


def _pairs(firsts: Sequence[int]) -> Iterator[tuple[int, int]]:
    yield from zip(firsts, (*firsts[1:], firsts[0] + BEARINGS), strict=True)


def _range(corridors: Corridors, first: int, after: int) -> BearingRange:
    members = np.arange(first, after) % BEARINGS
    state = int(corridors.states[first, 0])
    highest = int(members[corridors.least_deg[members].argmax()]) if state == UNSAFE else None
    return BearingRange(state, first, int(members[-1]), highest)


def corridor_ranges(
    corridors: Corridors,
    place: Callable[[int, NDArray[np.float64]], dict[str, Any]],
    *,
    north_deg: float = 0.0,
    length: float = 1.0,
) -> dict[str, Any]:
    """Return the ways in and out at the least slope as a JSON object.

    Parameters
    ----------
    place
        Returns further properties of an obstacle, such as its latitude and longitude, from the index of its
        bearing and its top (3,) in the map frame.
    north_deg
        Bearing of the map's north axis, clockwise from true north; bearings are turned by whole degrees.
    length
        Metres on the ground per metre of the map.

    Returns
    -------
    slope_deg; clear_deg, unknown_deg: pairs of bearings, first and last; blocked: a list of objects with
    bearings_deg, least_slope_deg (slope at which a way passes over all that is known there, null where none
    does), height_m (the top over the point), distance_m (horizontal, from the point), and what `place`
    returns.
    """
    ranges, turn = bearing_ranges(corridors), round(north_deg)

    def pair(one: BearingRange) -> list[int]:
        return [(k * STEP_DEG + turn) % 360 for k in (one.first, one.last)]

    def blocked(one: BearingRange, highest: int) -> dict[str, Any]:
        top, least_deg = corridors.obstacles_enu_m[highest], float(corridors.least_deg[highest])
        away = top - corridors.enu_m
        return {
            "bearings_deg": pair(one),
            "least_slope_deg": round(least_deg, 1) if least_deg < 90 else None,
            "height_m": round(float(away[2]), 2),
            "distance_m": round(math.hypot(away[0], away[1]) * length, 2),
            **place(highest, top),
        }

    return {
        "slope_deg": round(corridors.slopes_deg[0], 2),
        "clear_deg": [pair(one) for one in ranges if one.state == SAFE],
        "unknown_deg": [pair(one) for one in ranges if one.state == UNKNOWN],
        "blocked": [blocked(one, one.highest) for one in ranges if one.highest is not None],
    }
