"""Stage: wires, sought in all returns and marked on both maps."""

from __future__ import annotations

import numpy as np

from slz.ground import Ground
from slz.lanes import MAIN
from slz.returns import Flag, Returns


class WireStage:
    """Gives all returns to `slz.wires.wire_detector`, those without others near them too."""

    name, lane = "wires", MAIN
    reads, sets = frozenset({"places", "KEPT", "ISOLATED", "DISTANT", "datum", "air"}), frozenset({"wires"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Seek wires, and mark those known."""
        origin, origins = returns.window.origin, returns.window.thin_origins_enu_m
        alone = (returns.rows(flag, Flag.KEPT) for flag in (Flag.ISOLATED, Flag.DISTANT))
        rows = np.concatenate([returns.rows(Flag.KEPT), *alone])
        rays = None
        if origin is not None and origins is not None:
            rays = origin[rows], ground.stored(origins)
        sensor, now_s = ground.stored(returns.sensor_m), ground.now_s
        ground.wires.update(returns.places_m[rows], sensor, now_s, returns.window.end_ns, rays)
        ground.altered_by_wires_m = ground.marks.update(ground.wires.wires(0.0))
        ground.near.terrain.wires_m = ground.far.terrain.wires_m = ground.marks.points_m
