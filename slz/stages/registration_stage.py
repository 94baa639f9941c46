"""Stage: removal of navigation errors, of the window as a whole and of its scans."""

from __future__ import annotations

from slz.lanes import MAIN
from slz.map_ground import Ground
from slz.points.registration import Offset, offset
from slz.points.solid_ground import NOTHING, most_spread_m, solid_ground
from slz.points.sway import sway
from slz.window_returns import Flag, Returns


class Registration:
    """Moves all returns to the near map's stored heights; the drift found moves its datum."""

    name, lane = "registration", MAIN
    reads, sets = frozenset({"places", "KEPT", "NEAR", "near"}), frozenset({"places", "datum"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Move the places."""
        p, tiles, window = ground.parameters, ground.tiles, returns.window
        registers = p.register_m > 0 and returns.has_place
        used = returns.rows(Flag.KEPT | Flag.NEAR)
        solid, found = NOTHING, Offset()
        if registers:
            place = returns.places_m, used, returns.sensor_m, tiles, ground.near.terrain.noise
            solid = solid_ground(*place, most_spread_m(p))
            found = offset(solid, returns.sensor_m, p.register_m)
        returns.places_m = found.removed_from(returns.places_m, returns.sensor_m, tiles.datum_m)
        tiles.datum_m += found.up_m
        if registers and window.origin is not None and window.origins_enu_m is not None:
            swayed = sway(returns.places_m, used, window.origin, window.origins_enu_m, tiles, solid)
            returns.places_m = swayed.removed_from(returns.places_m, window.origin)
