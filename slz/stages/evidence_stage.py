"""Stages: returns into the evidence of the two maps, and the maps from it."""

from __future__ import annotations

import math

import numpy as np

from slz.lanes import BESIDE, MAIN
from slz.map_ground import Ground
from slz.points.mapping_reach import reach_m
from slz.window_returns import Flag, Points, Returns, Rows, is_for_near_map
from slz.zones.zone_map import ZoneMap

SHARED = frozenset({"places", "KEPT", "APART", "added", "datum", "surface", "arrivals", "wires"})


class FarEvidence:
    """All returns that are kept, at any range, into the map of coarse cells."""

    name, lane = "far_terrain", BESIDE
    reads, sets = SHARED | {"choice", "far"}, frozenset({"far"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Add the returns to the far map."""
        _add(returns.rows(Flag.KEPT, Flag.APART), None, math.inf, ground.far, returns, ground)


class NearEvidence:
    """Returns near enough, or raised, into the map of fine cells, which also judges the isolated ones."""

    name, lane = "near_terrain", MAIN
    reads, sets = SHARED | {"NEAR", "SPARSE", "ISOLATED", "RAISED", "near"}, frozenset({"near"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Add the returns to the near map."""
        alone = returns.places(Flag.ISOLATED, Flag.APART)
        rows = returns.rows(Flag.KEPT, Flag.APART)
        rows = rows[is_for_near_map(returns.flags[rows])]
        _add(rows, alone, reach_m(ground.parameters), ground.near, returns, ground)


def _add(
    rows: Rows, isolated: Points | None, to_m: float, zone_map: ZoneMap, returns: Returns, ground: Ground
) -> None:
    zone_map.terrain.pin(ground.pinned_enu_m, ground.parameters.touchdown_error_m)
    places = returns.places_m.take(rows, axis=0)
    if len(returns.added_m):
        places = np.concatenate([places, returns.added_m])
    altered = [*ground.altered_by_wires_m, *ground.altered_by_surface_m]
    window = returns.sensor_m, returns.stamp_s, isolated
    zone_map.add_points(places, *window, ground.near.tiles, to_m, altered)
