"""Stage: zones of both maps, with their numbers, landing points and ranks."""

from __future__ import annotations

from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.window_returns import Returns


class ZoneStage:
    """Tracks, describes and ranks the zones found, see `slz.zones`."""

    name, lane = "zones", MAIN
    reads, sets = frozenset({"near", "far"}), frozenset({"zones"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Number and describe the zones."""
        ground.near.identify(returns.sensor_m)
        ground.far.identify(returns.sensor_m)
