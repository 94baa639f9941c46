"""Stage: wires, sought in all returns and marked on both maps."""

from __future__ import annotations

import numpy as np

from slz.kernels.points.rows import rows_in_turn
from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.window_returns import Flag, Returns

ALONE = np.array([Flag.ISOLATED, Flag.DISTANT], np.uint16)


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
