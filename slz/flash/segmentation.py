"""Optimal Segmentation Algorithm: quadtree split by significant differences (Flash paper, section 6.1).

A square is split when |H - Hm| >= xi (DH + DHm) for one of its quarters: Flash paper, Eq. (5). The text calls
DH the standard deviation, Flash paper, Eq. (3) prints the variance; the algorithm works with neither. If a
quarter of a segment is d away from the other three, then |H - Hm| = 3/4 d while DH >= sqrt(3)/4 d: the ratio
never exceeds sqrt(3), so that with xi = 2 no segment would ever be split. The default is therefore the
standard error of the mean, DH^2 = sum (h - H)^2 / (N (N - 1)); Flash paper, Eq. (3) and Flash paper, Eq. (4)
lack the factor N. Then the criterion is whether two means differ by xi times their errors, and the figures of
the source are reproduced at xi = 2 and xi = 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Spread = Literal["error", "deviation"]
SMALLEST = 2  # cells along the side of a segment
Moments = tuple[F64, F64, F64]
"""Mean, variance and number of the cells of each square of one size."""


@dataclass(frozen=True, slots=True)
class Segments:
    """Segments of a map: mean height (m) and side (cells) of each cell's segment; NaN and 0 where unknown."""

    mean_m: F64
    side: NDArray[np.int32]


def segment(heights_m: F64, xi: float = 2.0, first: int | None = None, spread: Spread = "error") -> Segments:
    """Split a map of elevations into segments of one height each.

    Parameters
    ----------
    heights_m
        (rows, cols), NaN where unknown; such cells are ignored.
    xi
        Tuning parameter of the split criterion; the source uses 2 and 6.
    first
        Side of the initial squares (cells, a power of two); by default the whole map is one segment.
    spread
        "error": standard error of the mean. "deviation": standard deviation of the heights, as in the text,
        which never splits at xi above sqrt(3).

    Raises
    ------
    ValueError
        xi is not positive, or `first` is no power of two.
    """
    if not xi > 0:
        raise ValueError(f"segmentation: xi is {xi}, it must be positive")
    if first is not None and (first < SMALLEST or first & (first - 1)):
        raise ValueError(f"segmentation: first is {first}, it must be a power of two from {SMALLEST} on")
    rows, cols = heights_m.shape
    unit = SMALLEST
    while unit < (max(rows, cols) if first is None else first):
        unit *= 2
    side = unit
    shape = (-(-rows // unit) * unit, -(-cols // unit) * unit)
    padded = np.full(shape, np.nan)
    padded[:rows, :cols] = heights_m
    moments = _pyramid(padded, unit)
    mean = np.repeat(np.repeat(moments[unit][0], unit, 0), unit, 1)
    sides = np.full(shape, unit, np.int32)
    active = np.ones(moments[unit][0].shape, bool)
    while side > SMALLEST:
        divided = _differs(moments[side], moments[side // 2], xi, spread) & active
        side //= 2
        active = np.repeat(np.repeat(divided, 2, 0), 2, 1)
        cells = np.repeat(np.repeat(active, side, 0), side, 1)
        finer = np.repeat(np.repeat(moments[side][0], side, 0), side, 1)
        mean[cells], sides[cells] = finer[cells], side
    unknown = np.isnan(padded)
    mean[unknown], sides[unknown] = np.nan, 0
    return Segments(mean[:rows, :cols], sides[:rows, :cols])


def _pyramid(heights: F64, top: int) -> dict[int, Moments]:
    """Return the moments of all squares, by their side in cells."""
    count = np.isfinite(heights).astype(np.float64)
    centre = float(np.nanmean(heights)) if count.any() else 0.0
    total = np.where(count > 0, heights - centre, 0.0)
    square = total**2
    out: dict[int, Moments] = {}
    side = 1
    while True:
        with np.errstate(invalid="ignore", divide="ignore"):
            # Flash paper, Eq. (3) for a whole square, Flash paper, Eq. (4) for its quarters
            mean = total / np.where(count > 0, count, np.nan)
            variance = np.maximum(square - count * mean**2, 0.0) / np.where(count > 1, count - 1, np.nan)
        out[side] = (mean + centre, variance, count)
        if side == top:
            return out
        side *= 2
        total, square, count = _fours(total), _fours(square), _fours(count)


def _fours(a: F64) -> F64:
    return np.asarray(a[::2, ::2] + a[1::2, ::2] + a[::2, 1::2] + a[1::2, 1::2])


def _differs(whole: Moments, quarters: Moments, xi: float, spread: Spread) -> NDArray[np.bool_]:
    """Return the squares to split: at least one quarter differs significantly."""
    mean, own = (np.repeat(np.repeat(a, 2, 0), 2, 1) for a in (whole[0], _spread(whole, spread)))
    with np.errstate(invalid="ignore"):
        # Flash paper, Eq. (5)
        apart = np.abs(mean - quarters[0]) >= xi * (own + _spread(quarters, spread))
    found: NDArray[np.bool_] = apart[::2, ::2] | apart[1::2, ::2] | apart[::2, 1::2] | apart[1::2, 1::2]
    return found


def _spread(moments: Moments, spread: Spread) -> F64:
    _, variance, count = moments
    if spread == "deviation":
        return np.sqrt(variance)
    return np.sqrt(variance / np.where(count > 0, count, np.nan))
