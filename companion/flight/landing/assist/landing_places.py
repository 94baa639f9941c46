"""Nearest place to land on that a vehicle reaches straight on, at its present height.

An autopilot that lands at a target flies to it level and straight, 8 m/s fast to one that is 30 m away, and
sinks over it (ArduCopter with PLND_XY_DIST_MAX above 0, PX4). So the way is level, from where the vehicle can
stop, and everything that rises to its height beside the way, or was never seen, blocks it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.flight.landing.interruptions.crossing import is_clear_of
from companion.flight.landing.situation import Situation, Vector
from companion.flight.landing.ways.approach_path import hover_height_m
from companion.flight.mapping.vehicle_surroundings import wire_points_enu_m
from params import Parameters
from slz import Nearby, Report
from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel
from slz.landing_point.corridors import corridor_radius_m

BRAKING_MS2 = 2.5  # ArduCopter's WPNAV_ACCEL; it flies on that far before it turns to a target
BELOW_M = 2.0  # what rises to this far below the vehicle is in its way, or to half of its height over ground
ABOVE_M = 3.0  # a wire higher than this over the vehicle is not
ROOM_WITHIN_M = 2.0  # farther than the nearest place, one with more room around it is better
MOST_ROOM = 4  # blocks of landing places to every side, beyond which more room is no better
LOW_M, STEP_SHARE = 5.0, 0.5  # below this height a target begins, or is moved, by this share of it at most
SEEN_SHARE = 3.0  # of the height; a target farther aside is above the leaning vehicle's plane, and dropped
BEARINGS = 360
MOST_TRIED = 10  # of places about as far


@dataclass(frozen=True, slots=True, eq=False)
class LandingPlace:
    """Place to land on. enu_m: (3,) on the ground. away_m, bearing_deg: from the vehicle."""

    enu_m: Vector
    away_m: float
    bearing_deg: float


def is_landable(report: Report | None, enu_m: Vector) -> bool:
    """Return whether the vehicle can land straight below a place."""
    around = None if report is None else report.nearby
    if around is None:
        return False
    row = math.floor((float(enu_m[1]) - around.south_m) / around.cell_m)
    col = math.floor((float(enu_m[0]) - around.west_m) / around.cell_m)
    inside = 0 <= row < around.landable.shape[0] and 0 <= col < around.landable.shape[1]
    return inside and bool(around.landable[row, col])


def nearest_place(
    s: Situation,
    parameters: Parameters,
    before_enu_m: Vector | None = None,
    refused_enu_m: Sequence[Vector] = (),
) -> LandingPlace | None:
    """Return the nearest place within the map around the vehicle whose straight way there is free.

    Of places not more than 2 m farther than the nearest, the one with the most room around it is taken.

    Parameters
    ----------
    before_enu_m
        The place before (3,): it is kept while it is as good, so that noise does not move it.
    refused_enu_m
        Places (3,) that turned out unsafe: others must be beside them.
    """
    around = None if s.report is None else s.report.nearby
    if around is None or s.position_enu_m is None or s.velocity_enu_ms is None or not around.landable.any():
        return None
    here, start = s.position_enu_m, stopping_place(s.position_enu_m, s.velocity_enu_ms)
    rows, cols = np.nonzero(around.landable)
    east_m, north_m = (
        around.west_m + (cols + 0.5) * around.cell_m,
        around.south_m + (rows + 0.5) * around.cell_m,
    )
    places = np.stack([east_m, north_m, around.ground_m[rows, cols]], axis=1)
    way_m, aside_m = np.hypot(*(places[:, :2] - start).T), np.hypot(*(places[:, :2] - here[:2]).T)
    height_m = np.minimum(here[2] - places[:, 2], here[2] - around.ground_below_m(here))
    step_m = height_m * np.where(height_m >= LOW_M, SEEN_SHARE, STEP_SHARE)
    usable = aside_m <= step_m  # false where the ground is unknown
    for begin in (here[:2], start) if math.dist(here[:2], start) > around.cell_m else (here[:2],):
        usable &= _is_free(s, around, begin, places, parameters)
    for refused in refused_enu_m:
        usable &= np.hypot(*(places[:, :2] - refused[:2]).T) > corridor_radius_m(parameters)
    if not s.fence.is_open:
        usable &= s.fence.holds_landings(places, hover_height_m(parameters))
    room, left = _room(around)[rows, cols], np.flatnonzero(usable)
    if before_enu_m is not None and len(left):
        off_m = np.hypot(*(places[left, :2] - before_enu_m[:2]).T)
        same = left[off_m.argmin()]
        if off_m.min() <= around.cell_m:
            room[same], way_m[same] = MOST_ROOM + 1, way_m[same] - ROOM_WITHIN_M
    while len(left):
        is_near = way_m[left] <= way_m[left].min() + ROOM_WITHIN_M
        near, left = left[is_near], left[~is_near]
        for k in near[np.lexsort((way_m[near], -room[near]))][:MOST_TRIED]:
            if _is_reached(s, places[k], parameters):
                east, north = (places[k] - here)[:2].tolist()
                return LandingPlace(places[k], float(aside_m[k]), math.degrees(math.atan2(east, north)) % 360)
    return None


def is_way_free(s: Situation, parameters: Parameters, place_enu_m: Vector) -> bool:
    """Return whether the level way to one place is free of what the newest report shows."""
    around = None if s.report is None else s.report.nearby
    if around is None or s.position_enu_m is None:
        return True
    return bool(_is_free(s, around, s.position_enu_m[:2], place_enu_m[None], parameters)[0])


def _is_free(
    s: Situation, around: Nearby, begin_m: Vector, places: Vector, parameters: Parameters
) -> NDArray[np.bool_]:
    """Return whether the level way from a place (2,) to each of places (n, 3) is free, or they are below."""
    offset = places[:, :2] - begin_m
    way_m = np.hypot(*offset.T)
    bearing = np.round(np.arctan2(offset[:, 0], offset[:, 1]) * (BEARINGS / (2 * np.pi))).astype(np.intp)
    free_m = free_way_m(s, around, begin_m, parameters)[bearing % BEARINGS]
    return np.asarray((way_m <= around.cell_m) | (way_m <= free_m))


def stopping_place(position_enu_m: Vector, velocity_enu_ms: Vector) -> Vector:
    """Return where (2,) a vehicle can stop that brakes now."""
    speed_ms = float(np.hypot(*velocity_enu_ms[:2]))
    return np.asarray(position_enu_m[:2] + velocity_enu_ms[:2] * (speed_ms / (2 * BRAKING_MS2)))


def free_way_m(s: Situation, around: Nearby, start_m: Vector, parameters: Parameters) -> Array1D[np.float64]:
    """Return (360,) how far the level way from a place (2,) is free, by bearing in degrees."""
    here = s.position_enu_m
    if here is None:
        return np.zeros(BEARINGS)
    up_m = float(here[2])
    height_m = up_m - around.ground_below_m(here)
    low_m = up_m - min(BELOW_M, height_m / 2)  # NaN: nothing is free
    in_way = np.pad(~(around.top_m < low_m), 1)
    inner = in_way[:-2, 1:-1] & in_way[2:, 1:-1] & in_way[1:-1, :-2] & in_way[1:-1, 2:]
    rows, cols = np.nonzero(in_way[1:-1, 1:-1] & ~inner)  # what is amid others is behind them
    blocks = np.stack([cols, rows], axis=1) + 0.5
    edges_m = blocks * around.cell_m + (around.west_m, around.south_m)
    wires = wire_points_enu_m(s.report, here, around.cell_m * max(around.top_m.shape))
    wires = wires[(wires[:, 2] > low_m) & (wires[:, 2] < up_m + ABOVE_M)]
    free_m = np.full(BEARINGS, np.inf)
    shorten(np.concatenate([edges_m, wires[:, :2]]) - start_m, corridor_radius_m(parameters), free_m)
    return free_m


@kernel
def shorten(blocks_m: Array2D[np.float64], radius_m: float, free_m: Array1D[np.float64]) -> None:
    """Shorten ways from the origin, by bearing, to where a disc on them touches a block (n, 2)."""
    n, width = len(free_m), 2 * math.pi / len(free_m)
    sines, cosines = np.sin(np.arange(n) * width), np.cos(np.arange(n) * width)
    for i in range(len(blocks_m)):
        east, north = blocks_m[i, 0], blocks_m[i, 1]
        away = math.hypot(east, north)
        half = n // 4 if away <= radius_m else int(math.asin(radius_m / away) / width) + 1
        middle = round(math.atan2(east, north) / width)
        for step in range(-half, half + 1):
            k = (middle + step) % n
            along, aside = east * sines[k] + north * cosines[k], north * sines[k] - east * cosines[k]
            if abs(aside) < radius_m and along > 0:
                free_m[k] = min(free_m[k], max(0.0, along - math.sqrt(radius_m**2 - aside**2)))


def _room(around: Nearby) -> Array2D[np.int64]:
    """Return by block how many blocks of landing places are around it to every side, up to `MOST_ROOM`."""
    left = np.pad(around.landable, MOST_ROOM)
    room = np.zeros(around.landable.shape, np.int64)
    inner = slice(MOST_ROOM, -MOST_ROOM)
    for _ in range(MOST_ROOM):
        across = left & np.roll(left, 1, 0) & np.roll(left, -1, 0)
        left = across & np.roll(across, 1, 1) & np.roll(across, -1, 1)
        room += left[inner, inner]
    return room


def _is_reached(s: Situation, place_enu_m: Vector, parameters: Parameters) -> bool:
    """Return whether the way to a place is inside the fence, and nobody moves onto it."""
    here = s.position_enu_m
    inside = here is not None and s.fence.holds_way(here, place_enu_m)
    return inside and is_clear_of(s.moving, s.now_ns, place_enu_m, parameters)
