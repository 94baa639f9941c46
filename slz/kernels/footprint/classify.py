"""Classification of footprints: safe, unsafe or unknown to land on."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Float32
from slz.kernels.cells.cell_record import IS_UNKNOWN
from slz.kernels.footprint.certainty import certainty, undoubted
from slz.kernels.footprint.plane_fit import INNER, NOISE2, RELIEF, RMS, SHARE, SIGMA, SIGMAS, SLOPE
from slz.kernels.jit import kernel_part
from slz.kernels.raster.bitmap import NONE, ONE, lowest, signed
from slz.kernels.simd import LANES, broadcast, flags, flags_of, load, logical_and, store, store_bytes, where

LOW16 = np.uint64(0xFFFF)

# Layers of the derived maps, described in `slz.terrain.layers`.
A_HEIGHT, A_TOP, A_SLOPE, A_SIGMA, A_RELIEF, A_ROUGHNESS, A_CERTAINTY = range(7)

F0, NAN = np.float32(0), np.float32(np.nan)
Row = Array1D[np.float32]


@kernel_part
def classify(
    statistics: Row,
    at: int,
    hidden: np.uint64,
    slope_limit: Float32,
    relief_limit: Float32,
    quarters: int,
    maps: Row,
    to: int,
    layer: int,
    states: Array1D[np.uint8],
    place: int,
) -> np.uint64:
    """Write 16 cells of the maps from the slope on, and their states: safe, unsafe or unknown.

    Return a bit mask of the cells whose certainty is left to `certainty_of_doubtful`.

    Parameters
    ----------
    statistics, at
        Plane statistics and the index of the first, see `slz.kernels.footprint.plane_fit.fit_planes`.
    hidden
        Bit mask of the footprints that hold unseen ground: never safe, and unknown unless otherwise unsafe.
    quarters
        Area of the smallest hazard, see `slz.kernels.footprint.certainty.hazard_quarters`.
    maps, to, layer
        Maps, index of the first cell in the first map, and distance from one map to the next.
    states, place
        States, and index of the first cell's state.
    """
    slope, sigma = load(statistics, at + SLOPE * LANES), load(statistics, at + SIGMA * LANES)
    relief, unknown, open_ = load(statistics, at + RELIEF * LANES), broadcast(NAN), hidden ^ LOW16
    gentle = slope + broadcast(SIGMAS) * sigma < broadcast(slope_limit)  # False for NaN
    even = flags_of(logical_and(gentle, relief < broadcast(relief_limit)))
    safe, known = even & open_, flags_of(slope == slope) & (open_ | (even ^ LOW16))
    store_bytes(states, place, flags(safe), flags(known ^ LOW16))
    held = flags(known)
    store(maps, A_SLOPE * layer + to, where(held, slope, unknown))
    store(maps, A_SIGMA * layer + to, where(held, sigma, unknown))
    store(maps, A_RELIEF * layer + to, where(held, relief, unknown))
    store(maps, A_ROUGHNESS * layer + to, where(held, load(statistics, at + RMS * LANES), unknown))
    noise2, share = load(statistics, at + NOISE2 * LANES), load(statistics, at + SHARE * LANES)
    sure, clear = undoubted(slope, sigma, relief, noise2, share, slope_limit, relief_limit, quarters)
    seen, clear_ones = known & open_, flags_of(clear)
    store(maps, A_CERTAINTY * layer + to, where(flags(seen & clear_ones), sure, broadcast(F0)))
    return known & (clear_ones ^ LOW16) & flags_of(relief == relief)


@kernel_part
def certainty_of_doubtful(
    statistics: Row,
    at: int,
    doubtful: np.uint64,
    slope_limit: Float32,
    relief_limit: Float32,
    quarters: int,
    certainties: Row,
    to: int,
) -> None:
    """Write the certainty of the doubtful ones of 16 cells."""
    while doubtful != NONE:
        i = signed(lowest(doubtful))
        doubtful &= doubtful - ONE
        certainties[to + i] = certainty(
            statistics[at + SLOPE * LANES + i], statistics[at + SIGMA * LANES + i],
            statistics[at + RELIEF * LANES + i], statistics[at + INNER * LANES + i],
            np.sqrt(statistics[at + NOISE2 * LANES + i]), statistics[at + SHARE * LANES + i],
            slope_limit, relief_limit, quarters,
        )  # fmt: skip


@kernel_part
def leave_unknown(maps: Row, to: int, layer: int, states: Array1D[np.uint8], place: int) -> None:
    """Write 16 cells of the maps, from the slope on, as unknown, see `classify`."""
    for q in range(A_SLOPE, A_CERTAINTY + 1):
        first, value = np.uint64(q * layer + to), NAN if q < A_CERTAINTY else F0
        for i in range(np.uint64(LANES)):
            maps[first + i] = value
    for i in range(np.uint64(LANES)):
        states[np.uint64(place) + i] = IS_UNKNOWN
