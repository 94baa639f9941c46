"""Stages of the maps: kinds of surface, evidence, zones, and the ways in and out of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slz.lanes import BESIDE, MAIN
from slz.map_ground import Ground
from slz.points.outliers import reach_m
from slz.surface.surface_map import NO_SIGNAL, Signal
from slz.window_returns import Flag, Points, Returns, Rows, is_for_near_map
from slz.zones.zone_map import ZoneMap

MOST_INTENSITY = 1000.0  # in parts of a white target; beyond it is no measurement, even of a mirror
FEWEST_INTENSITIES = 20  # of a window, among which one that never changes is none
SHARED = frozenset({"places", "KEPT", "APART", "added", "datum", "surface", "arrivals", "wires"})


class Resolution:
    """Chooses from density, height and speed, see `slz.adaptive`."""

    name, lane = "resolution", MAIN
    reads, sets = frozenset({"places", "KEPT", "NEAR", "far"}), frozenset({"choice", "far"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Choose, and derive the far map at the level chosen."""
        mapped = returns.places(Flag.KEPT | Flag.NEAR)
        ground.choice = ground.adapter.choose(returns.window, mapped)
        ground.far.at_level(ground.choice.level)


class SurfaceStage:
    """Adds the returns to the surface map, see `slz.surface.surface_map`."""

    name, lane = "surface", BESIDE
    reads, sets = frozenset({"places", "KEPT", "SPARSE", "NEAR", "datum"}), frozenset({"surface"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Add the returns and classify the ground that they hit."""
        rows, grid = returns.rows(Flag.KEPT), ground.near.terrain.grid
        certain = (returns.flags[rows] & (Flag.NEAR | Flag.SPARSE)) == Flag.NEAR
        ground.altered_by_surface_m = ground.surface.update(
            returns.places_m.take(rows, axis=0),
            certain,
            ground.stored(returns.sensor_m),
            ground.now_s,
            _signal(returns, rows, ground),
            (grid.west_m, grid.south_m, grid.east_m, grid.north_m),
        )


def _signal(returns: Returns, rows: Rows, ground: Ground) -> Signal:
    """Return intensity, return numbers and incidence of some rows."""
    origin, origins = returns.window.origin, returns.window.origins_enu_m
    if origin is None or origins is None:
        return NO_SIGNAL
    origin, origins, attributes = origin[rows], ground.stored(origins), returns.window.attributes
    if attributes is None:
        return replace(NO_SIGNAL, origin=origin, origins_enu_m=origins)
    return Signal(
        origin,
        origins,
        _believable(attributes.intensity[rows]),
        attributes.echoes[rows],
        ground.stored(attributes.lost_enu_m),
        ground.stored(attributes.lost_origin_enu_m),
        attributes.lost_weight,
    )


def _believable(intensity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return intensities (n,), NaN where out of range; and all NaN where they are one constant."""
    with np.errstate(invalid="ignore"):
        good = (intensity >= 0) & (intensity <= MOST_INTENSITY)
    some = intensity[good]
    if len(some) < FEWEST_INTENSITIES or some.min() == some.max():
        return np.full(len(intensity), np.nan, np.float32)
    return intensity if good.all() else np.where(good, intensity, np.float32(np.nan))


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


class ZoneStage:
    """Tracks, describes and ranks the zones found, see `slz.zones`."""

    name, lane = "zones", MAIN
    reads, sets = frozenset({"near", "far"}), frozenset({"zones"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Number and describe the zones."""
        ground.near.identify(returns.sensor_m)
        ground.far.identify(returns.sensor_m)


class CorridorStage:
    """Judges the ways of the best zones and ranks them anew, see `slz.landing_point.corridors`."""

    name, lane = "corridors", MAIN
    reads, sets = frozenset({"near", "far", "air", "wires", "datum", "zones"}), frozenset({"zones"})

    def run(self, returns: Returns, ground: Ground, /) -> None:
        """Judge the ways."""
        ground.near.judge_ways(ground.corridors())


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
