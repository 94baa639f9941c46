"""Statistics of the pulses of a range image that need no knowledge of the scene.

A pulse is judged by the `REACH` pulses before and after it in the same row: where these follow a parabola
within `SMOOTH_M`, the surface is smooth, and the pulse between them should be on the parabola too, whatever
it is itself. So outliers and lost pulses are counted without choosing surfaces by their own residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tests.opinion.range_image import RangeImage

F64 = NDArray[np.float64]
Flags = NDArray[np.bool_]
REACH = 5
SMOOTH_M = 0.03
STEEPEST_M = 0.05
"""Greatest slope of the range, per pulse, of a smooth surface: beyond it, edges of the beam matter."""
OUTLIER_M = 0.15
FLAT_M = 0.05
STEPS_M = (0.1, 0.2, 0.4, 0.8, 5.0)
ALONE_M = 0.5
BIASED_COLUMNS = 8


def _offsets() -> F64:
    return np.array([k for k in range(-REACH, REACH + 1) if k], np.float64)


_A = np.column_stack([np.ones(2 * REACH), _offsets(), _offsets() ** 2])
_FIT: F64 = np.linalg.pinv(_A)
INFLATION = float(np.sqrt(1.0 + np.sum(_FIT[0] ** 2)))
"""Standard deviation of a residual to the parabola of the neighbours, in that of one pulse."""


@dataclass(frozen=True, slots=True)
class Smooth:
    """Pulses between smooth neighbours, (n,).

    residual_m: NaN for a lost one. local_m: standard deviation of its neighbours about their parabola.
    intensity: of the neighbours, median; relative: the pulse's intensity over it, NaN for a lost one.
    """

    range_m: F64
    residual_m: F64
    local_m: F64
    slope_m: F64
    intensity: F64
    relative: F64
    row: NDArray[np.int64]
    column: NDArray[np.int64]


def smooth_pulses(image: RangeImage) -> Smooth:
    """Return the pulses of an image between smooth neighbours."""
    width = 2 * REACH + 1
    windows = np.lib.stride_tricks.sliding_window_view(image.range_m, width, axis=1)
    bright = np.lib.stride_tricks.sliding_window_view(image.intensity, width, axis=1)
    beside = np.delete(np.arange(width), REACH)
    near = windows[:, :, beside]
    whole = np.isfinite(near).all(axis=2)
    row, column = np.nonzero(whole)
    r = near[row, column]
    parabola = r @ _FIT.T
    local = np.sqrt(((r - parabola @ _A.T) ** 2).sum(axis=1) / (2 * REACH - 3))
    own = (local < SMOOTH_M) & (np.abs(parabola[:, 1]) < STEEPEST_M)
    row, column, parabola, local = row[own], column[own], parabola[own], local[own]
    middle = windows[row, column, REACH]
    around = np.median(bright[row, column][:, beside], axis=1)
    return Smooth(
        parabola[:, 0],
        (middle - parabola[:, 0]) / INFLATION,
        local,
        parabola[:, 1],
        around,
        bright[row, column, REACH] / np.maximum(around, 1.0),
        row,
        column + REACH,
    )


def neighbour_correlation(image: RangeImage, smooth: Smooth) -> float:
    """Return the correlation of the noise of neighbouring pulses, 0 for white noise.

    From third differences along a row, whose lag products a white noise has in known proportion.
    """
    last = image.range_m.shape[1] - 4
    own = smooth.column < last
    k = np.arange(-1, 4)
    r = image.range_m[smooth.row[own, np.newaxis], smooth.column[own, np.newaxis] + k]
    third = np.diff(r, n=3, axis=1)
    third = third[np.isfinite(third).all(axis=1) & (np.abs(third).max(axis=1) < 8 * SMOOTH_M)]
    white = -15.0 / 20.0  # of third differences, lag one over lag zero
    lag = float((third[:, 0] * third[:, 1]).mean() / (third**2).mean())
    # With a correlation rho of lag one only: lag0 = 20 - 30 rho, lag1 = -15 + 26 rho.
    return (lag * 20.0 + 15.0) / (26.0 + 30.0 * lag) if lag != white else 0.0


@dataclass(frozen=True, slots=True)
class Steps:
    """Steps of the range along rows, of a height between `low_m` and `high_m`.

    count: of steps within one or two pulses. between: those with a return from 10 to 90 % of the way between
    both sides. lost: those with a lost pulse there.
    """

    low_m: float
    high_m: float
    count: int
    between: int
    lost: int


def steps(image: RangeImage) -> list[Steps]:
    """Return the steps between three pulses that agree to 5 cm and three after it that do."""
    r = image.range_m
    heights, fractions = [], []
    for gap in (0, 1):
        last = r.shape[1] - 5 - gap
        before = np.stack([r[:, k : k + last] for k in range(3)], -1)
        after = np.stack([r[:, k : k + last] for k in range(3 + gap, 6 + gap)], -1)
        flat = (np.ptp(before, axis=-1) < FLAT_M) & (np.ptp(after, axis=-1) < FLAT_M)
        near = np.minimum(before[..., -1], after[..., 0])
        height = np.abs(before[..., -1] - after[..., 0])
        own = flat & (height >= STEPS_M[0])
        if gap:
            middle = (r[:, 3 : 3 + last] - near) / height
            own &= ~(middle < 0.1) & ~(middle > 0.9)  # on a side: a step without a pulse between
            fractions.append(middle[own])
        else:
            fractions.append(np.full(int(own.sum()), np.inf))
        heights.append(height[own])
    height, fraction = np.concatenate(heights), np.concatenate(fractions)
    found = []
    for low, high in pairwise(STEPS_M):
        own = fraction[(height >= low) & (height < high)]
        found.append(Steps(low, high, len(own), int(np.isfinite(own).sum()), int(np.isnan(own).sum())))
    return found


def alone(image: RangeImage) -> tuple[int, int]:
    """Return the returns farther than `ALONE_M` in range from all returns within two rows and columns.

    Beside the number of all returns that have eight or more of these.
    """
    r = np.pad(image.range_m, 2, constant_values=np.nan)
    rows, columns = image.range_m.shape
    parts = [
        r[2 + j : 2 + j + rows, 2 + i : 2 + i + columns] for j in range(-2, 3) for i in range(-2, 3) if i or j
    ]
    apart = np.abs(np.stack(parts) - image.range_m)
    enough = np.isfinite(apart).sum(axis=0) >= 8
    with np.errstate(invalid="ignore"):
        far = np.nanmin(np.where(np.isfinite(apart), apart, np.inf), axis=0) > ALONE_M
    return int((far & enough).sum()), int(enough.sum())


def row_biases(image: RangeImage, least_rows: int) -> tuple[F64, NDArray[np.int64]]:
    """Return the mean range error of each row against planes through several rows, and its patches.

    A patch is `BIASED_COLUMNS` columns of at least `least_rows` rows in succession that a plane fits with a
    median residual below 1 cm.
    """
    rows, columns = image.range_m.shape
    found: list[list[float]] = [[] for _ in range(rows)]
    for start in range(0, columns - BIASED_COLUMNS + 1, BIASED_COLUMNS):
        points = image.points_m[:, start : start + BIASED_COLUMNS]
        whole = np.isfinite(points[:, :, 0]).sum(axis=1) >= BIASED_COLUMNS - 2
        for first in range(0, rows - least_rows + 1, least_rows // 2):
            chosen = slice(first, first + least_rows)
            if not whole[chosen].all():
                continue
            p = points[chosen].reshape(-1, 3)
            there = np.isfinite(p[:, 0])
            fit = _plane(p[there])
            if fit is None:
                continue
            normal, offset = fit
            unit = p / np.linalg.norm(p, axis=1, keepdims=True)
            along = unit @ normal
            if np.nanmin(np.abs(along)) < 0.4:
                continue
            error = ((p @ normal - offset) / along).reshape(least_rows, -1)
            if np.nanmedian(np.abs(error)) > 0.01:
                continue
            for k in range(least_rows):
                found[first + k].append(float(np.nanmedian(error[k])))
    mean = np.array([np.median(f) if f else np.nan for f in found])
    return mean, np.array([len(f) for f in found])


def _plane(points: F64) -> tuple[F64, float] | None:
    """Return a robust plane (unit normal, offset) through points, None if they are a line."""
    weight = np.ones(len(points))
    normal, offset = np.zeros(3), 0.0
    for _ in range(5):
        centre = weight @ points / weight.sum()
        _, size, axes = np.linalg.svd((points - centre) * np.sqrt(weight)[:, np.newaxis], full_matrices=False)
        if size[1] < 0.05 * size[0]:
            return None
        normal, offset = axes[2], float(axes[2] @ centre)
        error = np.abs(points @ normal - offset)
        scale = 1.4826 * np.median(error) + 1e-6
        weight = np.where(error < 2.5 * scale, 1.0, 1e-6)
    return normal, offset
