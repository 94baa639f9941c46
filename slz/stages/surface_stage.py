"""Stage: what the ground is made of, and where that refuses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slz.lanes import BESIDE
from slz.map_ground import Ground
from slz.surface.surface_map import NO_SIGNAL, Signal
from slz.window_returns import Flag, Returns, Rows

MOST_INTENSITY = 1000.0  # in parts of a white target; beyond it is no measurement, even of a mirror
FEWEST_INTENSITIES = 20  # of a window, among which one that never changes is none


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
    """Return what some rows tell besides their place."""
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
