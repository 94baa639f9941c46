"""Stage: zones on ground surveyed before the flight."""

from __future__ import annotations

from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.window_returns import Flag, Returns


class PriorStage:
    """Compares the returns with the survey, if there is one; see `slz.prior`."""

    name, lane = "prior", MAIN
    reads, sets = frozenset({"places", "KEPT", "datum", "near", "far"}), frozenset({"prior"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Remove what the returns contradict, and find the zones left."""
        if ground.prior is None:
            return
        live, tiles = (ground.near.terrain, ground.far.terrain), ground.tiles
        points, frame = returns.places(Flag.KEPT), ground.frame
        ground.prior.update(points, returns.sensor_m, frame, ground.now_s, live, tiles.datum_m)
