"""Kinds of hazard: what stands highest in each unsafe footprint of the exact world, for evaluation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from sitl.truth.truth import MAX_SAMPLE_M, NO_STAND, Extent, TruthMap
from sitl.truth.truth_surface import sample_top
from sitl.world.hits import MOVERS
from sitl.world.primitives import Box, Cylinder, Kind, Solid, Wire
from sitl.world.world import World

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

WATER, UNEVEN, SLOPE = "water", "uneven ground", "slope"
KINDS = ("car", "rock", "wire", "vegetation", "pole", "wall", "building", "block", WATER, UNEVEN, SLOPE)
"""Kinds of hazard; the last three are of the ground itself."""
NO_KIND = 255
LEAST_RISE_M = 0.1
"""What rises less above the bare ground does not count as the reason."""
ABOVE_M = 1.0
POLE_RADIUS_M, WALL_WIDTH_M, BUILDING_HEIGHT_M = 0.5, 0.5, 2.5


def kind_of(solid: Solid) -> str:
    """Return the kind of a solid, by its material, shape and size."""
    if isinstance(solid, Wire):
        return "wire"
    if solid.kind == Kind.CAR:
        return "car"
    if solid.kind == Kind.ROCK:
        return "rock"
    if solid.kind == Kind.FOLIAGE or "trunk" in solid.name:
        return "vegetation"
    if isinstance(solid, Cylinder) and solid.radius_m < POLE_RADIUS_M:
        return "pole"
    if isinstance(solid, Box) and min(solid.length_m, solid.width_m) < WALL_WIDTH_M < solid.height_m:
        return "wall"
    x0, y0, foot, x1, y1, top = solid.bounds()
    high = top - foot >= BUILDING_HEIGHT_M and min(x1 - x0, y1 - y0) >= BUILDING_HEIGHT_M
    return "building" if high else "block"


def hazard_kinds(
    world: World,
    extent: Extent,
    truth: TruthMap,
    cell_m: float = 0.2,
    footprint_m: float = 2.0,
    slope_limit_deg: float = 10.0,
) -> U8:
    """Return the kind of every unsafe cell: an index into `KINDS`, `NO_KIND` where the cell is safe.

    It is water where water is in the footprint, else the kind of what rises most above the bare ground of the
    footprint, be it a solid or a crop; where nothing rises, slope beyond the limit or uneven ground.

    Parameters
    ----------
    world, extent, cell_m, footprint_m, slope_limit_deg
        As in `sitl.truth.truth.safe_map`.
    truth
        What that returned for them.
    """
    rows, cols = truth.safe.shape
    per_cell = math.ceil(cell_m / MAX_SAMPLE_M - 1e-9)
    pitch = cell_m / per_cell
    reach = math.ceil(footprint_m / 2 / pitch)
    xs, ys = (
        start + (np.arange(n * per_cell + 2 * reach) - reach + 0.5) * pitch
        for start, n in ((extent[0], cols), (extent[1], rows))
    )
    top, material = sample_top(world, xs, ys, pitch)
    bare, _ = World(world.ground).surface(*np.meshgrid(xs, ys))
    rise = np.nan_to_num(top - bare)
    standing = _standing(world, xs, ys, top, pitch)
    size = 2 * reach + 1
    middle = np.s_[
        reach + per_cell // 2 : reach + per_cell // 2 + rows * per_cell : per_cell,
        reach + per_cell // 2 : reach + per_cell // 2 + cols * per_cell : per_cell,
    ]
    crop = np.isin(material, [kind for kind in NO_STAND if kind != Kind.WATER])
    standing[crop & (standing == NO_KIND)] = KINDS.index("vegetation")
    kind = np.where(truth.slope_deg > slope_limit_deg, KINDS.index(SLOPE), KINDS.index(UNEVEN))
    most = np.full((rows, cols), LEAST_RISE_M)
    for index in np.unique(standing[standing != NO_KIND]):
        highest = maximum_filter(np.where(standing == index, rise, -np.inf), size, mode="nearest")[middle]
        kind = np.where(highest > most, index, kind)
        most = np.maximum(most, highest)
    wet = maximum_filter(material == Kind.WATER, size, mode="nearest")[middle]
    kind[wet] = KINDS.index(WATER)
    kind[truth.safe == 1] = NO_KIND
    return kind.astype(np.uint8)


def _standing(world: World, xs: F64, ys: F64, top: F64, pitch_m: float) -> U8:
    """Return the kind of the solid that is the top of each sample, `NO_KIND` where the ground is."""
    x, y = np.meshgrid(xs, ys)
    inside = np.isfinite(top)
    parts = [part for mover in world.movers.values() for part in mover.placed()]
    kinds = np.array([KINDS.index(kind_of(solid)) for solid in (*world.solids, *parts)], np.uint8)
    out = np.full(top.shape, NO_KIND, np.uint8)
    origins = np.column_stack([x[inside], y[inside], top[inside] + ABOVE_M])
    down = np.tile([0.0, 0.0, -1.0], (len(origins), 1))
    met = world.cross(origins, down, math.inf, np.zeros((len(origins), 1)))
    number = np.where(met.hit >= MOVERS, met.hit - MOVERS + len(world.solids), met.hit)
    here = (number >= 0) & (met.range_m <= ABOVE_M + 1e-6)
    found = np.full(len(origins), NO_KIND, np.uint8)
    found[here] = kinds[number[here]]
    out[inside] = found
    # What is thinner than the samples is in the top, but between the rays.
    between = np.zeros(top.shape, bool)
    between[inside] = met.range_m > ABOVE_M + 1e-6
    for solid, kind in zip((*world.solids, *parts), kinds, strict=True):
        x0, y0, _, x1, y1, highest = solid.bounds()
        columns = slice(*np.searchsorted(xs, [x0 - pitch_m, x1 + pitch_m]))
        rows = slice(*np.searchsorted(ys, [y0 - pitch_m, y1 + pitch_m]))
        window = (rows, columns)
        if between[window].any():
            out[window][between[window] & (top[window] <= highest + 1e-6)] = kind
    return out
