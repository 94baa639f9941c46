"""Stages of the points: which returns of a window to believe, where they are, and what they belong to."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.points.histogram import beyond, heights_within
from slz.kernels.points.range_gate import mark_usable
from slz.kernels.points.rows import mark, rows_by_scan, rows_in_turn
from slz.lanes import BESIDE, MAIN
from slz.map_ground import Ground
from slz.points.outliers import (
    CLOUD_GROUP,
    FLIGHT_GROUP,
    gap_interval,
    in_cluster,
    is_dense_at,
    not_isolated,
    reach_m,
    within,
)
from slz.points.registration import Offset, offset
from slz.points.solid_ground import NOTHING, most_spread_m, solid_ground
from slz.points.sway import sway
from slz.terrain.arrivals import AROUND_M, FEET_M
from slz.window_returns import Flag, Points, Returns

MOST_HEIGHT_M = 100_000.0  # nothing on the ground is higher or deeper
THIN_REACH = 1.2  # of the mapping reach, up to which isolated returns are judged
MOST_LOOKS = 10  # windows in `window_s` at most, as in flight
SPARSE_LOOKS = 2  # windows in `window_s`, from which the sensor and not the window is sparse
Flags = NDArray[np.bool_]
SIDES = np.array(list(product((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (0.0,))))  # of a return, and its own place
ALONE = np.array([Flag.ISOLATED, Flag.DISTANT], np.uint16)


class RangeGate:
    """Marks the returns within `max_range_m`; all finite ones where the sensor's place is unknown."""

    name, lane = "range_gate", MAIN
    reads, sets = frozenset({"places"}), frozenset({"USABLE"})

    def run(self, returns: Returns, p: Parameters, /) -> None:
        """Set USABLE."""
        place = returns.places_m, returns.sensor_m
        mark_usable(*place, p.max_range_m**2, MOST_HEIGHT_M, returns.flags, Flag.USABLE)


class Isolation:
    """Finds the returns that no outlier rule drops, and the isolated ones.

    The near map judges the isolated ones together with those of other windows. Where most returns of a
    whole window are isolated, the far map takes them all.
    """

    name, lane = "isolation", MAIN
    reads = frozenset({"places", "USABLE"})
    sets = frozenset({"KEPT", "SPARSE", "NEAR", "ISOLATED", "DISTANT"})

    def run(self, returns: Returns, p: Parameters, /) -> None:
        """Set KEPT, SPARSE, NEAR, ISOLATED, DISTANT."""
        flags, sensor, in_flight = returns.flags, returns.sensor_m, returns.has_place
        rows = returns.rows(Flag.USABLE)
        points = returns.places_m if len(rows) == len(returns) else returns.places(Flag.USABLE)
        span_s = (returns.window.end_ns - returns.window.start_ns) * 1e-9
        looks = min(max(1, round(p.window_s / span_s)), MOST_LOOKS) if span_s > 0 else 1
        # A stored cloud was cleaned by who made it.
        keep = not_isolated(points, sensor, p.cell_m, looks) if in_flight else np.ones(len(points), bool)
        low_m, high_m = gap_interval(heights_within(points, keep), p.outlier_gap_m)
        strays = beyond(points, keep, low_m, high_m)
        keep[strays] = in_cluster(points[strays], *(FLIGHT_GROUP if in_flight else CLOUD_GROUP))
        mark(flags, rows, keep, Flag.KEPT.value)
        if in_flight:
            alone = rows[~keep]
            isolated = returns.places_m[alone]
            dense = is_dense_at(isolated, sensor, looks * len(points))
            judged = within(isolated, sensor, THIN_REACH * reach_m(p)) & ~dense
            flags[alone[judged]] |= np.uint16(Flag.ISOLATED)
            flags[alone[~(judged | dense)]] |= np.uint16(Flag.DISTANT)
            if 2 * len(alone) > len(points) and looks <= SPARSE_LOOKS:
                flags[alone] |= np.uint16(Flag.KEPT | Flag.SPARSE)
        flags |= within(returns.places_m, sensor, reach_m(p)) * np.uint16(Flag.NEAR)


class Registration:
    """Moves all returns to the near map's stored heights; the drift found moves its datum."""

    name, lane = "registration", MAIN
    reads, sets = frozenset({"places", "KEPT", "NEAR", "near"}), frozenset({"places", "datum"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Move the places."""
        p, tiles, window = ground.parameters, ground.tiles, returns.window
        registers = p.register_m > 0 and returns.has_place
        used = returns.rows(Flag.KEPT | Flag.NEAR)
        solid, found = NOTHING, Offset()
        if registers:
            place = returns.places_m, used, returns.sensor_m, tiles, ground.near.terrain.noise
            solid = solid_ground(*place, most_spread_m(p))
            found = offset(solid, returns.sensor_m, p.register_m)
        returns.places_m = found.removed_from(returns.places_m, returns.sensor_m, tiles.datum_m)
        tiles.datum_m += found.up_m
        if registers and window.origin is not None and window.origins_enu_m is not None:
            swayed = sway(returns.places_m, used, window.origin, window.origins_enu_m, tiles, solid)
            returns.places_m = swayed.removed_from(returns.places_m, window.origin)


class Raised:
    """Marks what is higher over known ground of the near map than noise and the relief limit explain."""

    name, lane = "raised", MAIN
    reads, sets = frozenset({"places", "KEPT", "SPARSE", "near"}), frozenset({"RAISED"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Set RAISED."""
        if not returns.has_place:
            return
        terrain, asked = ground.near.terrain, (Flag.KEPT.value, Flag.SPARSE.value, Flag.RAISED.value)
        limits = returns.sensor_m, terrain.noise, ground.parameters.relief_m
        terrain.tiles.mark_above(returns.places_m, returns.flags, asked, *limits)


class SeenAirStage:
    """Follows rays, where the sensor's places are known; see `slz.air.seen_air`."""

    name, lane = "seen_air", BESIDE
    reads, sets = frozenset({"places", "KEPT", "datum"}), frozenset({"air"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Count the rays in the seen air."""
        origin, origins = returns.window.origin, returns.window.origins_enu_m
        if origin is None or origins is None:
            return
        ground.air.add(returns.places_m, origin, origins, ground.datum_m, returns.rows(Flag.KEPT))


class ArrivalStage:
    """Gives the returns of arrivals to `slz.terrain.arrivals`.

    Nothing is an arrival where the sensor's places, and so the rays, are unknown. Returns of a sensor without
    thin rays are none either: these could not prove that it has gone.
    """

    name, lane = "arrivals", MAIN
    reads = frozenset({"places", "KEPT", "ISOLATED", "RAISED", "datum", "near"})
    sets = frozenset({"APART", "arrivals", "added"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Set APART, and add what stood for so long that it is evidence."""
        origin, origins, arrivals = returns.window.origin, returns.window.thin_origins_enu_m, ground.arrivals
        if origin is None or origins is None or not returns.has_place:
            return
        stand, alone = returns.rows(Flag.RAISED), returns.rows(Flag.ISOLATED)
        if not (len(stand) or len(arrivals) or len(arrivals.altered_enu_m)):
            return
        places, sensor, flags = returns.places_m, returns.sensor_m, returns.flags
        stand = np.concatenate(
            [
                stand[_stand_free(places[stand], sensor, ground)],
                alone[_are_above(places[alone], sensor, ground)],
            ]
        )
        raised, isolated = np.zeros((2, len(returns)), bool)
        raised[stand], isolated[alone] = ~np.isnan(origins[origin[stand], 0]), True
        rows = rows_by_scan(flags, int(Flag.KEPT), int(Flag.ISOLATED), origin, len(origins))
        apart, returns.added_m = arrivals.update(
            places,
            rows,
            raised,
            isolated,
            lambda some: _are_above(places[some], sensor, ground, FEET_M),
            origin,
            ground.stored(origins),
            sensor,
            ground.now_s,
        )
        # At their feet, ground that was never seen before stays evidence.
        known = apart[ground.tiles.differences(places[apart])[:, 3].astype(np.int64)]
        flags[known] |= np.uint16(Flag.APART)


def _are_above(points: Points, sensor: Points, ground: Ground, least_m: float | None = None) -> Flags:
    """Return which points are higher over known ground of the near map than noise and a height explain.

    By default that of what stands on ground: `relief_m`.
    """
    terrain, least_m = ground.near.terrain, ground.parameters.relief_m if least_m is None else least_m
    return terrain.tiles.contradicted_by(points, sensor, terrain.noise, least_m)


def _stand_free(points: Points, sensor: Points, ground: Ground) -> Flags:
    """Return which raised points have known and lower ground on all sides: others are of walls."""
    around = points[:, np.newaxis] + max(AROUND_M, ground.parameters.cell_m) * SIDES
    return np.asarray(_are_above(around.reshape(-1, 3), sensor, ground).reshape(-1, len(SIDES)).all(axis=1))


class WireStage:
    """Gives all returns to `slz.wires.wire_detector`, those without others near them too."""

    name, lane = "wires", MAIN
    reads, sets = frozenset({"places", "KEPT", "ISOLATED", "DISTANT", "datum", "air"}), frozenset({"wires"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Seek wires, and mark those known."""
        origin, origins = returns.window.origin, returns.window.thin_origins_enu_m
        rows = rows_in_turn(returns.flags, Flag.KEPT, ALONE)
        rays = None if origin is None or origins is None else (origin, ground.stored(origins))
        sensor, now_s = ground.stored(returns.sensor_m), ground.now_s
        ground.wires.update(returns.places_m, sensor, now_s, returns.window.end_ns, rays, rows)
        ground.altered_by_wires_m = ground.marks.update(ground.wires.wires(0.0))
        ground.near.terrain.wires_m = ground.far.terrain.wires_m = ground.marks.points_m
