"""Certainty: the probability that the whole footprint at a cell is safe.

The constants are fitted to closed-form worlds and judged on others (docs/benchmark/accuracy.md); `slz
reproduce` draws the reliability diagram of simulated surveys.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slz.kernels.jit import kernel, kernel_for_any_types, kernel_part
from slz.kernels.simd import Floats, broadcast, logical_and, sqrt, where

SLOPE_MARGIN_DEG = 0.07  # standard deviation of a fitted plane's slope about the ground's, beside its error
RELIEF_NOISE = 1.05  # bias of a relief beyond its excess where every cell was struck, deviations of a return
RELIEF_SPREAD = 1.0  # standard deviation of `RELIEF_NOISE`, deviations of a return
STRUCK = 0.9985  # share of footprints without a hazard that returns struck and the map lost
HIDDEN = 0.05  # share of footprints with a smallest hazard, where nothing was struck, on even ground
UNEVEN = 18.0  # and times one more than this, where what was struck reaches the limit of the relief
ALONE, ALONE_SEEN, ALONE_MOST = 0.29, 0.82, 0.77  # share of clutter in what stands out in one cell alone
FEW = 0.21  # share of clutter in what stands out in a few cells, where every cell was struck
LEAST_NOISE_M = 1e-3
CERTAIN_SIGMAS = 4.0  # standard deviations, beyond which a probability counts as 1: it is within 3e-5
F0, F1, F_LEAST_NOISE = np.float32(0), np.float32(1), np.float32(LEAST_NOISE_M)
F_NOISE, F_MOST = np.float32(RELIEF_NOISE), np.float32(CERTAIN_SIGMAS * RELIEF_SPREAD)


@kernel_part
def normal_cdf(deviations: float) -> float:
    """Return the standard normal distribution function; NaN of NaN."""
    if deviations > CERTAIN_SIGMAS:
        return 1.0
    return 0.5 * math.erfc(-deviations / math.sqrt(2.0))


@kernel_part
def _relief_probability(relief_m: float, bias: float, noise_m: float, limit_m: float) -> float:
    return normal_cdf(((limit_m - relief_m) / max(noise_m, LEAST_NOISE_M) + bias) / RELIEF_SPREAD)


@kernel
def hazard_quarters(cell_m: float, hazard_m: float) -> int:
    """Return how many quarters of a cell's area the smallest hazard covers: the power of the share of gaps.

    Where returns fall at random, the share of empty cells is exp(-returns per cell). So the probability that
    none struck a hazard is that share to the power of the hazard's area in cells.
    """
    return int(min(64.0, max(1.0, np.rint(4 * (hazard_m / cell_m) ** 2))))


@kernel_part
def certainty(
    slope_deg: float,
    slope_sigma_deg: float,
    relief_m: float,
    inner_relief_m: float,
    noise_m: float,
    share_seen: float,
    slope_limit_deg: float,
    relief_limit_m: float,
    quarters: int,
) -> float:
    """Return the probability that slope and relief of a footprint are within their limits; 0 where unknown.

    A relief beyond its limit is clutter in a share of the footprints: in many where a single cell stands out,
    in few where several do, and in none where most of the footprint's unevenness is due to many cells.

    Parameters
    ----------
    slope_deg, slope_sigma_deg
        Slope of the footprint's plane and its standard error.
    relief_m, inner_relief_m
        Relief of the whole footprint, and without the cell that stands out most, or the same where many cells
        stand out (`slz.kernels.footprint.plane_fit.add_inner_relief`); NaN where the slope is too steep.
    noise_m
        Standard deviation of the height of one return.
    share_seen
        Share of the footprint's cells that hold a return; gaps may hide a hazard.
    quarters
        Area of the smallest hazard, see `hazard_quarters`.
    """
    if math.isnan(slope_deg + slope_sigma_deg + relief_m + inner_relief_m + noise_m + share_seen):
        return 0.0
    part = min(1.0, relief_m / relief_limit_m)
    hidden = HIDDEN * max(0.0, 1 - share_seen) ** (0.25 * quarters) * (1 + UNEVEN * part**6)
    left_deg = slope_limit_deg - slope_deg
    spread2 = slope_sigma_deg * slope_sigma_deg + SLOPE_MARGIN_DEG * SLOPE_MARGIN_DEG
    gentle = normal_cdf(left_deg / math.sqrt(spread2))
    bias = RELIEF_NOISE * share_seen  # where few cells were struck, what was not makes up for it
    even = _relief_probability(relief_m, bias, noise_m, relief_limit_m)
    clutter = 0.0
    if inner_relief_m < relief_m:
        alone = _relief_probability(inner_relief_m, bias, noise_m, relief_limit_m)
        one = min(ALONE_MOST, ALONE + ALONE_SEEN * share_seen)
        clutter = alone * one + (1 - alone) * FEW * share_seen
    return float(gentle * (even * max(0.0, STRUCK - hidden) + (1 - even) * clutter))


@kernel_for_any_types
def undoubted(
    slope_deg: Floats,
    slope_sigma_deg: Floats,
    relief_m: Floats,
    noise2_m2: Floats,
    share_seen: Floats,
    slope_limit_deg: float,
    relief_limit_m: float,
    quarters: int,
) -> Any:
    """Return the `certainty` of 16 footprints as if hidden hazards were the only doubt, and flags where so.

    It holds on most ground, and takes no division or error function.
    """
    gap = where(share_seen < broadcast(F1), broadcast(F1) - share_seen, broadcast(F0))
    half, hidden = sqrt(gap), broadcast(F1)
    for _ in range(quarters // 4):
        hidden = hidden * gap
    if quarters & 2:
        hidden = hidden * half
    if quarters & 1:
        hidden = hidden * sqrt(half)
    part = relief_m * broadcast(F1 / np.float32(relief_limit_m))
    part = where(part < broadcast(F1), part, broadcast(F1))
    cube = part * part * part
    hidden = hidden + hidden * broadcast(np.float32(UNEVEN)) * (cube * cube)
    margin = broadcast(np.float32(SLOPE_MARGIN_DEG))
    left = broadcast(slope_limit_deg) - slope_deg
    spread2 = slope_sigma_deg * slope_sigma_deg + margin * margin
    most, left_m = broadcast(F_MOST) - broadcast(F_NOISE) * share_seen, broadcast(relief_limit_m) - relief_m
    least2 = broadcast(F_LEAST_NOISE * F_LEAST_NOISE)
    noise2 = where(noise2_m2 < least2, least2, noise2_m2)
    level = logical_and(broadcast(F0) < left_m, most * most * noise2 < left_m * left_m)
    gentle = logical_and(
        broadcast(F0) < left, broadcast(np.float32(CERTAIN_SIGMAS * CERTAIN_SIGMAS)) * spread2 < left * left
    )
    return broadcast(np.float32(STRUCK)) - broadcast(np.float32(HIDDEN)) * hidden, logical_and(gentle, level)
