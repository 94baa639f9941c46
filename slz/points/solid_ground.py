"""Solid ground: where the returns of a window repeat the heights of the map, whichever way they came.

Leaves let part of the light pass, and a steep ray goes deeper than a flat one (Beer and Lambert), so the mean
height of a crop depends on where it is seen from. A window that was registered to it would take this for an
error of navigation, and write the next ground so much too low. Solid ground answers from one height, except
for the noise of the sensor. Blocks of ground differ in how much the differences to the map vary from one
return to the next: 0.02 to 0.05 m over ground, 0.2 m over wheat, 0.7 m over maize.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.points.repeatability import bounds, over_blocks, spread_of_blocks
from slz.terrain.tiles import Noise, Tiles

MOST_RETURNS, PART = 20_000, 4  # returns compared with the map, and the part of them that mostly suffices
ENOUGH_RETURNS = 4_000  # over solid ground: their mean is better than a millimetre
LEAST_SIDE_M, PER_BLOCK = 1.0, 12  # side of a block, which is widened until it has this many returns
FEWEST_PAIRS = 4  # a block of wheat passes by chance with 0.5 %, one of maize never
MOST_BLOCKS = 65_536
LEAST_SPREAD_M, NOISES = 0.06, 1.5  # spread of solid ground: the least limit, and in `height_noise_m`
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SolidGround:
    """Solid ground below a window.

    differences: (m, 4) of the returns compared there, see `Tiles.differences`. n_known: returns compared over
    known ground, solid or not. depth_m: standard deviation of their heights that noise does not explain, as
    of grass. west_m, south_m, side_m: of the blocks. blocks: (rows, cols), which are solid.
    """

    differences: Floats
    n_known: int
    depth_m: float
    west_m: float
    south_m: float
    side_m: float
    blocks: NDArray[np.bool_]

    @property
    def share(self) -> float:
        """Share of the returns over known ground that are over solid ground, 0 for none."""
        return len(self.differences) / max(1, self.n_known)


NOTHING = SolidGround(np.empty((0, 4)), 0, 0.0, 0.0, 0.0, 1.0, np.zeros((0, 0), bool))


def most_spread_m(parameters: Parameters) -> float:
    """Return the standard deviation (m) up to which heights repeat those of the map.

    It contains the noise of the farthest return that is mapped, and the fall within a cell of the steepest
    ground that is safe.
    """
    p = parameters
    fall = p.cell_m * math.tan(math.radians(p.safe_slope_deg)) / math.sqrt(12)
    return math.hypot(max(LEAST_SPREAD_M, NOISES * p.height_noise_m), fall)


def solid_ground(
    points_enu_m: Floats,
    used: NDArray[np.intp],
    sensor_enu_m: Floats,
    tiles: Tiles,
    noise: Noise,
    most_spread_m: float,
) -> SolidGround:
    """Compare returns spread over a window with the map, a part of them if enough are over solid ground.

    Parameters
    ----------
    points_enu_m, used
        (n, 3) in heights that include the map's datum, and (m,) indices of the returns to use.
    """
    every, ground = max(1, len(used) // MOST_RETURNS), NOTHING
    part = PART * every
    for step in (part, every) if len(used) >= part * ENOUGH_RETURNS else (every,):
        found = tiles.differences(points_enu_m, used[::step].copy(), tiles.datum_m)
        ground = _of(found, sensor_enu_m, noise, most_spread_m)
        if len(ground.differences) >= ENOUGH_RETURNS:
            break
    return ground


def _of(found: Floats, sensor_enu_m: Floats, noise: Noise, most_spread_m: float) -> SolidGround:
    """Return the solid ground of differences (m, 4)."""
    if not len(found):
        return NOTHING
    west, south, *size = bounds(found)
    area = size[0] * size[1]
    side = max(LEAST_SIDE_M, math.sqrt(PER_BLOCK * area / len(found)), math.sqrt(area / MOST_BLOCKS))
    cols, rows = (1 + int(m / side) for m in size)
    spread = spread_of_blocks(found, west, south, side, rows, cols, FEWEST_PAIRS)
    blocks = spread <= most_spread_m
    if not blocks.any():
        return replace(NOTHING, n_known=len(found))
    north, east = np.nonzero(blocks)
    way = (west + (east + 0.5) * side - sensor_enu_m[0], south + (north + 0.5) * side - sensor_enu_m[1])
    noise_m2 = noise.range_m**2 + noise.angle_rad**2 * (way[0] ** 2 + way[1] ** 2)
    depth_m2 = float(np.mean(spread[blocks] ** 2 - noise_m2))
    on = over_blocks(found, np.arange(len(found)), west, south, side, blocks)
    solid = found if on.all() else found[on]
    return SolidGround(solid, len(found), math.sqrt(max(0.0, depth_m2)), west, south, side, blocks)
