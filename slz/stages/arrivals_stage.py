"""Stage: what has come to stand on known ground, which is kept apart from the evidence."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.rows import rows_by_scan
from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.terrain.arrivals import AROUND_M, FEET_M
from slz.window_returns import Flag, Points, Returns

Flags = NDArray[np.bool_]
SIDES = np.array(list(product((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (0.0,))))  # of a return, and its own place


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
