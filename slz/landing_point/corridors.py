"""Corridors: the ways in and out of a landing point, by bearing and slope.

An approach or departure surface rises from the edge of the landing area and is free of obstacles, by 8:1 for
helicopters: ICAO Annex 14, Volume II, chapter 4; FAA AC 150/5390-2D, chapter 2. Air that no ray passed is not
clear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.air.seen_air import SeenAir
from slz.frame import is_known
from slz.kernels.air.corridor_obstacles import clear_over, forget_known
from slz.landing_point.surroundings import cell_of
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.terrain.terrain_view import TerrainView

BEARINGS = 72
STEP_DEG = 360 // BEARINGS
SLOPES_DEG = 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0  # judged beside the least that the vehicle flies
SPREAD = 0.1  # a corridor widens to each side by 10 % of the distance (ICAO Annex 14 II, table 4-1, by day)
NEAR_M = 30.0  # tops up to here are those of the near map
CEILING = 0.6  # of the survey height: the air below a vehicle is seen up to here; above, it looks ahead


@dataclass(frozen=True, slots=True, eq=False)
class Corridors:
    """Corridors between a point and the height at which the vehicle flies to it.

    enu_m: (3,) the point. slopes_deg: from the least that the vehicle flies to straight up. states:
    (72, slopes) uint8, by bearing from the point (5 degrees, clockwise from north) and slope: 0 blocked, 1
    clear, 255 unknown. least_deg: (72,) slope at which the corridor
    passes over all that is known, 90 where nothing does. obstacles_enu_m: (72, 3) the top that asks for that
    slope, NaN where nothing is higher than the point.
    """

    enu_m: NDArray[np.float64]
    slopes_deg: tuple[float, ...]
    states: NDArray[np.uint8]
    least_deg: NDArray[np.float64]
    obstacles_enu_m: NDArray[np.float64]

    @property
    def overhead(self) -> int:
        """State of the air straight above the point."""
        return int(self.states[:, -1].min())

    @property
    def state(self) -> int:
        """State of the best way: clear where any is, blocked where all are."""
        if (self.states == SAFE).any():
            return int(SAFE)
        return int(UNKNOWN) if (self.states == UNKNOWN).any() else int(UNSAFE)

    @property
    def bearings_deg(self) -> tuple[int, ...]:
        """Bearings from the point at which a corridor less steep than straight up is clear."""
        return tuple((np.flatnonzero((self.states[:, :-1] == SAFE).any(axis=1)) * STEP_DEG).tolist())

    @property
    def clear_slope_deg(self) -> NDArray[np.float64]:
        """Return (72,) the least slope at which each bearing is clear, NaN where none is."""
        clear = self.states == SAFE
        return np.where(clear.any(axis=1), np.array(self.slopes_deg)[clear.argmax(axis=1)], np.nan)

    @property
    def blocking_enu_m(self) -> NDArray[np.float64]:
        """Return (n, 3) the tops that block the least slope, each once."""
        return np.unique(self.obstacles_enu_m[self.states[:, 0] == UNSAFE], axis=0)


def corridors(
    enu_m: NDArray[np.float64],
    near: TerrainView,
    far: TerrainView,
    air: SeenAir | None,
    parameters: Parameters,
    wires_enu_m: NDArray[np.float64] | None = None,
) -> Corridors:
    """Return the corridors of a point (3,); all unknown where its height is.

    Parameters
    ----------
    near, far
        Maps of the ground and what stands on it, or the same twice. Up to `NEAR_M` from the point a top of
        the far map counts only where the near map does not know all the ground below it; where all that it
        misses is a gap in safe ground, only a top that errors of far returns do not explain.
    air
        Air that rays passed; None where no ray is known, as in a survey of files: then nothing is clear.
    wires_enu_m
        Points (n, 3) along wires, which block what is below them, over unknown ground too.
    """
    p = parameters
    slopes_deg = (p.approach_slope_deg, *(slope for slope in SLOPES_DEG if slope > p.approach_slope_deg))
    slopes = np.array([*np.tan(np.radians(slopes_deg[:-1])), np.inf])
    states = np.full((BEARINGS, len(slopes)), UNKNOWN, np.uint8)
    tangents, obstacles = np.zeros(BEARINGS), np.full((BEARINGS, 3), np.nan)
    if not is_known(enu_m):
        return Corridors(enu_m, slopes_deg, states, np.full(BEARINGS, np.nan), obstacles)
    radius_m, reach_m = corridor_radius_m(p), corridor_reach_m(p)
    floor_m, high_m = float(enu_m[2]) + p.relief_m, p.survey_height_m * CEILING
    parts = ((near, min(NEAR_M, reach_m)),) if near is not far else ()
    known: tuple[NDArray[np.float32], tuple[float, float, float]] | None = None
    for terrain, to_m in (*parts, (far, reach_m)):
        grid = terrain.grid
        box = terrain.around(cell_of(enu_m, terrain), math.ceil(to_m / grid.cell_m))
        ground, top = terrain.ground_and_top(box)
        lattice = grid.south_m + box.row0 * grid.cell_m, grid.west_m + box.col0 * grid.cell_m, grid.cell_m
        safe, place = terrain.state(box) == SAFE, (float(enu_m[0]), float(enu_m[1]), floor_m)
        if known is not None:
            forget_known(top, *lattice, known[0], *known[1], floor_m)
        known = np.where(safe & np.isnan(ground), np.float32(np.inf), ground), lattice
        if wires_enu_m is not None:
            _raise_to(wires_enu_m, top, *lattice)
        shape = radius_m, SPREAD, to_m, float(slopes[0])
        clear_over(top, safe, *lattice, *place, *shape, tangents, obstacles)
    blocked = (tangents[:, np.newaxis] > slopes) | np.isinf(tangents)[:, np.newaxis]
    if air is not None:
        floor = np.array([enu_m[0], enu_m[1], floor_m])
        shape = radius_m, SPREAD, p.vehicle_height_m, reach_m
        states[~air.unseen(floor, float(enu_m[2]) + high_m, slopes, shape, blocked)] = SAFE
    states[blocked] = UNSAFE
    return Corridors(enu_m, slopes_deg, states, np.degrees(np.arctan(tangents)), obstacles)


def _raise_to(
    points_enu_m: NDArray[np.float64], top: NDArray[np.float32], south_m: float, west_m: float, cell_m: float
) -> None:
    """Raise the tops of cells to the points (n, 3) over them."""
    row = np.floor((points_enu_m[:, 1] - south_m) / cell_m).astype(np.int64)
    col = np.floor((points_enu_m[:, 0] - west_m) / cell_m).astype(np.int64)
    inside = (row >= 0) & (col >= 0) & (row < top.shape[0]) & (col < top.shape[1])
    row, col = row[inside], col[inside]
    before = top[row, col]
    top[row, col] = np.where(np.isnan(before), -np.inf, before)
    np.maximum.at(top, (row, col), points_enu_m[inside, 2].astype(np.float32))


def corridor_radius_m(parameters: Parameters) -> float:
    """Return half the width (m) of a corridor at its point."""
    p = parameters
    return max(p.footprint_m, p.greatest_dimension_m) / 2 + p.touchdown_error_m + p.corridor_margin_m


def corridor_reach_m(parameters: Parameters) -> float:
    """Return how far (m) from a point corridors are judged: where the least slope ends, or `corridor_m`."""
    p = parameters
    least = math.tan(math.radians(p.approach_slope_deg))
    return min(p.corridor_m, (p.survey_height_m * CEILING / least + corridor_radius_m(p)) * (1 + SPREAD))
