"""Echoes of a beam from water, wet surfaces, plants and snow, and what a receiver reports of them.

The beam is `PARTS` equal parts; each meets a leaf of its own or passes. So one pulse has up to
`PARTS` + 2 echoes: leaves, water, and the ground or the bottom below. Those closer than the length of the
pulse add up and have one range, weighted by their power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array2D
from sitl.compilation import kernel
from sitl.sensors import water_optics
from sitl.world.hits import PLANTS, WATER
from sitl.world.primitives import REFLECTANCE, Kind
from sitl.world.water_waves import WaterState
from sitl.world.wires import WireEchoes
from sitl.world.world import Crossings

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Flags = NDArray[np.bool_]

PARTS = 3
PULSE_M = 0.3
"""Half the length of a pulse of 4 ns, there and back: nearer echoes overlap by more than half."""


@dataclass(frozen=True, slots=True)
class BeamEchoes:
    """Possible echoes of pulses, (n, k): range, NaN for none, and brightness."""

    range_m: F64
    bright: F64


def touched(crossings: Crossings) -> Flags:
    """Return the mask of pulses that meet water, a wet surface, plants or snow."""
    met: Flags = np.isfinite(crossings.water_m) | (crossings.kind == np.uint8(Kind.WET_ASPHALT))
    for leaf_m in crossings.leaf_m.T:
        met |= np.isfinite(leaf_m)
    return met


def beam_echoes(
    crossings: Crossings,
    origins: F64,
    directions: F64,
    time_s: F64,
    water: WaterState,
    wavelength_nm: int,
    glint: F64,
) -> BeamEchoes:
    """Return the possible echoes of pulses.

    Parameters
    ----------
    crossings
        What the pulses meet, with `PARTS` leaves.
    origins, directions, time_s
        (n, 3) ENU and (n,): places, unit directions and times of the pulses.
    water
        Wind and waves.
    wavelength_nm
        See ``water_optics.ABSORPTION_PER_M``.
    glint
        (n,) random factor of mean one of the mirror-like part.
    """
    c = crossings
    if not touched(c).any():  # only wires make these pulses several echoes
        bright = np.zeros((len(c.kind), c.leaf_m.shape[1] + 2))
        bright[:, -1] = REFLECTANCE[c.kind] * c.cosine
        return BeamEchoes(np.column_stack([c.leaf_m, c.water_m, c.range_m]), bright)
    slant = np.clip(-directions[:, 2], 1e-3, 1.0)
    leaf = np.isfinite(c.leaf_m)
    leaf_bright = np.where(leaf, REFLECTANCE[c.plant][:, np.newaxis] / PARTS, 0.0)
    through = 1.0 - leaf.sum(axis=1) / PARTS
    wet = np.isfinite(c.water_m)
    surface_m, surface_bright = _water(c, origins, directions, time_s, water, slant, glint)
    film = c.kind == Kind.WET_ASPHALT
    gloss = glint * water_optics.surface_brightness(c.cosine, water_optics.FILM_SQUARE_SLOPE)
    ground = REFLECTANCE[c.kind] * c.cosine + np.where(film, gloss, 0.0)
    absorption = water_optics.ABSORPTION_PER_M[wavelength_nm]
    bottom = water_optics.bottom_brightness(slant, c.depth_m, REFLECTANCE[c.bottom], absorption)
    last_m = np.where(wet, water_optics.bottom_range(c.water_m, slant, np.minimum(c.depth_m, 1e3)), c.range_m)
    last_bright = np.where(wet, bottom, ground)
    rest = through[:, np.newaxis] * np.column_stack([surface_bright, last_bright])
    return BeamEchoes(
        np.column_stack([c.leaf_m, surface_m, last_m]), np.nan_to_num(np.column_stack([leaf_bright, rest]))
    )


def echo_hits(crossings: Crossings) -> I64:
    """Return what the echoes of `beam_echoes` come from, (n, k) codes of ``hits``."""
    c = crossings
    leaves = np.full(c.leaf_m.shape, PLANTS)
    last = np.where(np.isfinite(c.water_m), WATER, c.hit)
    return np.column_stack([leaves, np.full(len(last), WATER), last])


def with_wires(echoes: BeamEchoes, wires: WireEchoes) -> BeamEchoes:
    """Return the echoes of beams with those of wires after them, which take their share of the others."""
    left = echoes.bright * wires.through[:, np.newaxis]
    return BeamEchoes(np.hstack([echoes.range_m, wires.range_m]), np.hstack([left, wires.bright]))


def _water(
    c: Crossings, origins: F64, directions: F64, time_s: F64, water: WaterState, slant: F64, glint: F64
) -> tuple[F64, F64]:
    """Return range and brightness of the water surface; puddles have no waves."""
    wet = np.isfinite(c.water_m)
    at = origins[wet] + c.water_m[wet, np.newaxis] * directions[wet]
    high = water.height_m(at[:, 0], at[:, 1], time_s[wet])
    # Waves are no higher than the water is deep.
    high = np.clip(high, -0.4 * c.depth_m[wet], 0.4 * c.depth_m[wet])
    surface_m = c.water_m.copy()
    surface_m[wet] -= high / slant[wet]
    bright = glint * water_optics.surface_brightness(slant, water.square_slope)
    murky = water.turbid * slant * (1.0 - np.exp(-np.minimum(c.depth_m, 1e3) / 0.1))
    return surface_m, np.where(wet, bright + murky, 0.0)


def merge(echoes: BeamEchoes) -> BeamEchoes:
    """Add up echoes that overlap; each has the range and brightness of all within `PULSE_M` of it."""
    merged = BeamEchoes(np.empty(echoes.range_m.shape), np.empty(echoes.range_m.shape))
    add_overlapping(echoes.range_m, echoes.bright, merged.range_m, merged.bright)
    return merged


@kernel
def add_overlapping(
    range_m: Array2D[np.float64],
    bright: Array2D[np.float64],
    out_range: Array2D[np.float64],
    out_bright: Array2D[np.float64],
) -> None:
    """Write ranges, NaN for none, and brightnesses of echoes with all those that overlap them."""
    columns = range_m.shape[1]
    for n in range(range_m.shape[0]):
        for i in range(columns):
            out_range[n, i], out_bright[n, i] = math.nan, 0.0
            if not (math.isfinite(range_m[n, i]) and bright[n, i] > 0.0):
                continue
            total = moment = four = four_moment = pair = pair_moment = 0.0
            for j in range(columns):
                if bright[n, j] > 0.0 and abs(range_m[n, j] - range_m[n, i]) <= PULSE_M:
                    pair, pair_moment = pair + bright[n, j], pair_moment + bright[n, j] * range_m[n, j]
                if columns < 8 or j % 2 == 1:  # eight are summed by pairs of pairs
                    four, four_moment, pair, pair_moment = four + pair, four_moment + pair_moment, 0.0, 0.0
                if columns < 8 or j % 4 == 3:
                    total, moment, four, four_moment = total + four, moment + four_moment, 0.0, 0.0
            out_range[n, i], out_bright[n, i] = moment / total, total
