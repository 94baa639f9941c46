"""Stage: the air that the rays of the returns passed."""

from __future__ import annotations

from slz.lanes import BESIDE
from slz.map_ground import Ground
from slz.window_returns import Flag, Returns


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
