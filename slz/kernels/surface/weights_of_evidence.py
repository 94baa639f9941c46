"""Weights of evidence: the log odds of all rules together, and the probability of each kind of surface."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.elementary_functions import F0, F1, interpolate
from slz.kernels.jit import kernel, kernel_for_any_types, kernel_part
from slz.kernels.surface.flooded_ground import SEED, flood_ground
from slz.kernels.surface.masks import box_sums
from slz.kernels.surface.surface_record import (
    CANOPY,
    COUNT,
    DARK,
    GRADIENT,
    HIGH,
    KIND,
    LOST_NEAR,
    LOW,
    LOW_VEGETATION,
    N_LAYERS,
    RESIDUAL,
    ROOF,
    SHAPE,
    WATER,
    N,
)
from slz.kernels.surface.water_returns import FEWEST_RAYS

BESIDE, SHORE = 3, 0.1  # cells around; probability that a footprint in a cell beside water reaches it
SCORE_WATER = np.float32(-4.7)  # log odds of water before any evidence
MOST_ACQUITTAL = np.float32(-0.5)  # log odds, of an extent over which returns vanish
# Bright oblique returns more than dark ones, and what lost rays say then.
FEWEST_BRIGHT, SCORE_BRIGHT = np.float32(6.0), np.float32(1.5)
SCORE_BOTH = np.float32(2.0)  # log odds more, where returns vanish and those left are darker than dry ground
# Water has no gradient; ground whose plane is clean has the gradient of that plane. An error of attitude
# tilts water by 1.3 degrees (PX4), so where near rays surely vanish the ground must slope by more.
GRADIENTS, SCORES_SLOPING = (0.004, 0.01, 0.02), (0.0, -3.5, -5.0)
TILTED, SCORES_TILTED = (0.025, 0.045, 0.07), (0.0, -3.4, -5.0)
WINDOW, SIGMAS = 1.4, np.float32(2.5)  # deviation of places in a plane's window, in cells; standard errors
CLEAN_M = np.float32(0.05)  # residual of the plane of such ground, without a bank in it
FEWEST_RETURNS = np.float32(8.0)  # in the window of a plane, that suffice for a kind
DEPTH_M, DEPTH_RANGE_M = np.float32(2.5), np.float32(0.5)  # of crops and reeds; what is taller is canopy
MOST = np.float32(30)  # log odds
HALF, NEVER = np.float32(0.5), np.float32(np.inf)


@kernel_part
def _vanishing(lost: np.float32, dark: np.float32, mirror: np.float32, darkness: np.float32) -> np.float32:
    """Return what lost, dark and specular returns together say for water.

    The three have one cause, so the strongest counts; darkness beside lost rays counts a little more.
    """
    score = min(lost, SCORE_BRIGHT) if darkness <= -FEWEST_BRIGHT else lost
    if dark > F0:
        score = max(score, dark) + (SCORE_BOTH if score > F0 else F0)
    return max(score, mirror) if mirror > F0 else score


@kernel_part
def _sloping(
    gradient: np.float32, residual: np.float32, n: np.float32, watery: bool, cell: float
) -> np.float32:
    """Return the log odds for water from the gradient of the ground, as far as noise does not explain it."""
    if not residual < CLEAN_M:
        return F0
    sure = gradient - SIGMAS * (residual / np.sqrt(n) / np.float32(WINDOW * cell))
    if watery:
        return np.float32(interpolate(sure, TILTED, SCORES_TILTED))
    return np.float32(interpolate(sure, GRADIENTS, SCORES_SLOPING))


@kernel
def weigh(
    fields: Array3D[np.float32],
    cell: float,
    planes: Array3D[np.float32],
    on_level: Array2D[np.bool_],
    levels: Array2D[np.float32],
    roofs: Array2D[np.float32],
    plants: Array2D[np.float32],
    mirrors: Array2D[np.float32],
    lost: Array2D[np.float32],
    dark: Array2D[np.float32],
    shape: Array2D[np.float32],
    said: Array3D[np.float32],
    layers: Array3D[np.float32],
) -> Array3D[np.float32]:
    """Return the log odds against water, plants and roofs, (3, rows, cols), infinite where none can be.

    Parameters
    ----------
    fields
        (SURFACE_FIELDS, rows, cols) of `slz.kernels.surface.surface_record`.
    planes
        (4, rows, cols) of `smooth_planes`.
    on_level, levels, roofs, plants, mirrors, lost, dark
        (rows, cols) cells of level extents, and log odds of each rule.
    shape
        (rows, cols) SHAPE from an earlier look with more of the surroundings, 0 for none; or empty.
    said
        Log odds for roofs and for plants, and share of tall plants or NaN, as the maker of a survey said,
        (3, rows, cols); or empty.
    layers
        (N_LAYERS, rows, cols), of which SHAPE is written, CANOPY as the share of tall ones among
        plants, and KIND as whether enough was seen to classify.
    """
    f, any_shape, any_said = fields.reshape(len(fields), -1), shape.size > 0, said.size > 0
    odds, out, of_planes = (
        np.full_like(fields[:3], NEVER),
        layers.reshape(N_LAYERS, -1),
        planes.reshape(4, -1),
    )
    against, of_maker = odds.reshape(3, -1), said.reshape(3, -1)
    for k in range(f.shape[1]):
        out[CANOPY, k] = F0
        seen, roof, mirror = f[COUNT, k] > F0, roofs.flat[k], mirrors.flat[k]
        # Around water that answered lies more of it, as even as ground: shape acquits it of little.
        level = levels.flat[k]
        out[SHAPE, k] = shape.flat[k] if any_shape else min(level, F0) if roof > F0 else level
        if any_shape and shape.flat[k] != F0:
            level = max(level, shape.flat[k])
        if roof > F0:
            level = min(level, F0)  # its banks are parapets
        out[KIND, k] = seen and of_planes[N, k] >= FEWEST_RETURNS
        if seen or on_level.flat[k]:
            vanishing = _vanishing(lost.flat[k], dark.flat[k], mirror, f[DARK, k])
            score = SCORE_WATER + (max(level, MOST_ACQUITTAL) if vanishing > F0 else level) + vanishing
            # At its shore a plane holds the bank, and below a mirror it may show the bottom.
            if not (level > F0 or mirror > F0):
                near = f[LOST_NEAR, k] >= FEWEST_RAYS or dark.flat[k] > F0
                gradient, residual, n = of_planes[GRADIENT, k], of_planes[RESIDUAL, k], of_planes[N, k]
                score += _sloping(gradient, residual, n, bool(near and vanishing > F0), cell)
            against[0, k] = -min(max(score, -MOST), MOST)
        if seen:
            plant, tall = plants.flat[k], (f[HIGH, k] - f[LOW, k] - DEPTH_M) / DEPTH_RANGE_M + HALF
            tall = min(max(tall, F0), F1)
            if any_said:
                roof, plant = roof + of_maker[0, k], plant + of_maker[1, k]
                tall = tall if math.isnan(of_maker[2, k]) else of_maker[2, k]
            against[1, k], against[2, k] = -min(max(plant, -MOST), MOST), -min(max(roof, -MOST), MOST)
            out[CANOPY, k] = tall
    return odds


@kernel_for_any_types
def _decide(
    water: Any, against: Array2D[np.float32], kinds: Array1D[np.float32], out: Array2D[np.float32], k: int
) -> None:
    """Write the probabilities of a cell, in the precision of that of water."""
    tall, is_known = out[CANOPY, k], out[KIND, k] > F0
    plant = F1 / (F1 + against[1, k]) * (F1 - water)
    roof = F1 / (F1 + against[2, k]) * (F1 - water - plant)
    low, canopy = plant * (F1 - tall), plant * tall
    bare = F1 - (water + roof + low + canopy) if is_known else F0
    out[WATER, k], out[ROOF, k], out[LOW_VEGETATION, k], out[CANOPY, k] = water, roof, low, canopy
    out[KIND, k] = F0
    for i, share in enumerate((water, roof, low, canopy, bare)):
        if share > HALF:
            out[KIND, k] = kinds[i]


@kernel
def decide(
    odds: Array3D[np.float32],
    fields: Array3D[np.float32],
    cell: float,
    labels: Array2D[np.int32],
    level_m: Array2D[np.float32],
    surface_m: Array2D[np.float32],
    kinds: Array1D[np.float32],
    layers: Array3D[np.float32],
) -> None:
    """Write the probabilities of the kinds of surface, and the likeliest.

    Parameters
    ----------
    odds
        Against water, plants and roofs, (3, rows, cols).
    kinds
        Numbers of water, roof, low vegetation, canopy and bare ground.
    layers
        (N_LAYERS, rows, cols), as `weigh` left them.
    """
    _, rows, cols = odds.shape
    water, probable = np.empty((rows, cols)), np.empty((1, rows, cols), np.float32)
    for k in range(water.size):
        water.flat[k] = F1 / (F1 + odds.flat[k])
    floods = flood_ground(water, fields, labels, level_m, surface_m, cell)
    # A shore passes through cells of which at least three others are water.
    for k in range(water.size):
        probable.flat[k] = water.flat[k] >= SEED
    beside = box_sums(probable, 1)
    out, against = layers.reshape(N_LAYERS, -1), odds.reshape(3, -1)
    for k in range(water.size):
        own, is_shore = float(water.flat[k]), fields[COUNT].flat[k] > F0 and beside.flat[k] >= BESIDE
        own = max(own, SHORE) if is_shore else own
        if floods:
            _decide(own, against, kinds, out, k)
        else:
            _decide(np.float32(own), against, kinds, out, k)
