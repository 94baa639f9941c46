"""Stage: what has come to stand on known ground, which is kept apart from the evidence."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from slz.ground import Ground
from slz.lanes import MAIN
from slz.returns import Flag, Points, Returns
from slz.terrain.arrivals import AROUND_M, FEET_M

Flags = NDArray[np.bool_]


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
        rows, alone = returns.rows(Flag.KEPT, Flag.ISOLATED), returns.rows(Flag.ISOLATED)
        raised = (returns.flags[rows] & Flag.RAISED) != 0
        if not (raised.any() or len(arrivals) or len(arrivals.altered_enu_m)):
            return
        n, thin = len(rows), ~np.isnan(origins[:, 0])
        both = np.concatenate([rows, alone])
        together, scan = returns.places_m[both], origin[both]
        free = _stands_free(together[:n], raised, returns.sensor_m, ground)
        above = _are_above(together[n:], returns.sensor_m, ground)
        stands = np.concatenate([free, above]) & thin[scan]
        over = _are_above(together, returns.sensor_m, ground, FEET_M)
        order, apart = np.argsort(scan, kind="stable"), np.empty(len(both), bool)
        apart[order], returns.added_m = arrivals.update(
            together[order],
            stands[order],
            over[order],
            order >= n,
            scan[order],
            ground.stored(origins),
            returns.sensor_m,
            ground.now_s,
        )
        # At their feet, ground that was never seen before stays evidence.
        feet = apart & ~(stands | over)
        seen = np.zeros(len(feet), bool)
        seen[np.flatnonzero(feet)[ground.tiles.differences(together[feet])[:, 3].astype(np.int64)]] = True
        returns.flags[both[apart & (stands | over | seen)]] |= np.uint16(Flag.APART)


def _are_above(points: Points, sensor: Points, ground: Ground, least_m: float | None = None) -> Flags:
    """Return which points are higher over known ground of the near map than noise and a height explain.

    By default that of what stands on ground: `relief_m`.
    """
    terrain, least_m = ground.near.terrain, ground.parameters.relief_m if least_m is None else least_m
    return terrain.tiles.contradicted_by(points, sensor, terrain.noise, least_m)


def _stands_free(points: Points, raised: Flags, sensor: Points, ground: Ground) -> Flags:
    """Return which of the raised points have known and lower ground on all sides: others are of walls."""
    free, side_m = raised.copy(), max(AROUND_M, ground.parameters.cell_m)
    for north, east in product((-side_m, 0.0, side_m), repeat=2):
        some = np.flatnonzero(free)
        free[some] = _are_above(points[some] + (east, north, 0.0), sensor, ground)
    return free
