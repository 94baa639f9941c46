"""Stage: returns above known ground, at any range: they count at once."""

from __future__ import annotations

from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.window_returns import Flag, Returns


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
