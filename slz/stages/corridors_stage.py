"""Stage: the ways in and out of the best zones."""

from __future__ import annotations

from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.window_returns import Returns


class CorridorStage:
    """Judges the ways of the best zones and ranks them anew, see `slz.landing_point.corridors`."""

    name, lane = "corridors", MAIN
    reads, sets = frozenset({"near", "far", "air", "wires", "datum", "zones"}), frozenset({"zones"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Judge the ways."""
        ground.near.judge_ways(ground.corridors())
