"""Stage: the length of the next window, the far map's resolution, and the mode."""

from __future__ import annotations

from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.window_returns import Flag, Returns


class Resolution:
    """Chooses from density, height and speed, see `slz.adaptive`."""

    name, lane = "resolution", MAIN
    reads, sets = frozenset({"places", "KEPT", "NEAR", "far"}), frozenset({"choice", "far"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Choose, and derive the far map at the level chosen."""
        mapped = returns.places(Flag.KEPT | Flag.NEAR)
        ground.choice = ground.adapter.choose(returns.window, mapped)
        ground.far.at_level(ground.choice.level)
