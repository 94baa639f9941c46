"""Rules of surface cells in plain NumPy and SciPy, each as its file of `slz.kernels.surface` describes it."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.surface_record import (
    ASIDE,
    ASIDE_LIGHT,
    ASIDE_M,
    COUNT,
    DARK,
    DEEP,
    GRADIENT,
    HIGH,
    LEVEL,
    LOST_NEAR,
    LOST_OBLIQUE,
    LOST_SLANTED,
    LOW,
    MEAN,
    NADIR,
    NADIR_LIGHT,
    NADIR_M,
    NUMBERED,
    OBLIQUE,
    REPORTED,
    RESIDUAL,
    SEVERAL,
    SLANTED,
    SQUARES,
    TALL,
    N,
)  # fmt: skip

F32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Labels = NDArray[np.int32]
Flags = NDArray[np.bool_]
SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))


def around(layer: NDArray[np.generic], radius: int) -> F32:
    """Return the sums over squares of `radius` cells to every side."""
    side = np.ones((2 * radius + 1, 2 * radius + 1))
    return np.asarray(ndimage.correlate(np.asarray(layer, np.float64), side, mode="constant"), np.float32)


def ramp(x: NDArray[np.floating], low: float, width: float) -> NDArray[np.floating]:
    return np.clip((x - low) / width, 0, 1)


def averages(own: Labels, values: NDArray[np.floating], n: int) -> Floats:
    return np.asarray(np.bincount(own, values, n) / np.maximum(np.bincount(own, minlength=n), 1))


def penetration(f: F32) -> F32:
    seen, apart = f[COUNT] > 0, f[DEEP] + f[TALL]
    pierced = seen & (apart >= 1) & (apart > 0.01 * f[COUNT])
    rough = seen & (spread_m(f) > 0.06)
    places, told = np.maximum(around(seen, 2), 1), around(f[NUMBERED], 2)
    score = (
        -4 + 6 * ramp(around(pierced, 2) / places, 0.2, 0.4) + 2 * ramp(around(rough, 2) / places, 0.5, 0.4)
    )
    several = 3 * ramp(around(f[SEVERAL], 2) / np.maximum(told, 1), 0.02, 0.1)
    score = score + np.where(told >= 30, several, 0)
    return np.asarray(np.where(seen & (around(f[COUNT], 2) >= 30), score, -4), np.float32)


def spread_m(f: F32) -> F32:
    return np.asarray(np.sqrt(np.maximum(f[SQUARES], 0) / np.maximum(f[COUNT], 1)))


def specular_returns(f: F32) -> tuple[F32, F32]:
    both = (f[NADIR] >= 2) & (f[ASIDE] >= 2)
    above, aside = f[NADIR] * both, f[ASIDE] * both
    pairs = above * aside / np.maximum(above + aside, 1)
    n_pairs, drops = around(pairs, 2), around(pairs * (f[NADIR_M] - f[ASIDE_M]), 2)
    n, dim = np.maximum(n_pairs, 1), around(aside * f[ASIDE_LIGHT], 2) / np.maximum(around(aside, 2), 1)
    ratio = around(above * f[NADIR_LIGHT], 2) / np.maximum(around(above, 2) * dim, 1e-6)
    shines = (n_pairs >= 6) & both & (f[NADIR_LIGHT] >= 2 * dim)
    over_bottom = shines & (ratio >= 2) & (drops / n - 0.09 / np.sqrt(n) >= 0.02)
    told = over_bottom | (shines & (ratio >= 6))
    return np.where(told, np.float32(4.5), np.float32(0)), np.where(
        over_bottom, f[NADIR_M], np.float32(np.nan)
    )


def dark_returns(f: F32, level: Flags) -> F32:
    told = around(f[DARK], 1) >= 6
    if (level & (f[DARK] == 0)).any():
        told |= level & (around(f[DARK] * level, 10) >= 60)
    return np.where(told & (f[DARK] >= 0) & (f[DARK] > 0).any(), np.float32(3.5), np.float32(0))


def vanishing_returns(f: F32, level: Flags, sees_obliquely: bool) -> F32:
    def by(answered: F32, lost: F32, fewest: float, oblique: bool) -> F32:
        places = (0.1, 0.2, 0.75, 1.0) if oblique else (0.3, 0.6, 0.85, 0.95)
        scores = (4.5, 2.5, -3.0, -6.0) if oblique else (4.0, 3.0, 0.5, 0.0)
        share = answered / np.maximum(answered + lost, 1e-9)
        return np.where(answered + lost >= fewest, np.interp(share, places, scores), 0).astype(np.float32)

    known, seen = f[REPORTED] >= 3, f[COUNT] > 0
    oblique, lost = f[OBLIQUE], f[LOST_OBLIQUE] * known
    score, silent = by(oblique, lost, 4, True), seen & (oblique < 4)
    if f[REPORTED].any():
        near = around(f[REPORTED], 2) >= 3
        suspect = by(f[SLANTED], f[LOST_SLANTED] * known, 4, False)
        for answered, without in ((OBLIQUE, LOST_OBLIQUE), (SLANTED, LOST_SLANTED)):
            told = by(around(f[answered], 2), around(f[without], 2) * near, 8, answered == OBLIQUE)
            suspect = np.maximum(suspect, told)
        score = np.where(silent, np.maximum(score, np.maximum(suspect, 0)), score)
    elif sees_obliquely:
        above = level & (f[COUNT] >= 4) & (around(oblique, 2) < 1)
        score = np.where(above, np.maximum(score, np.float32(4)), score)
    if (silent & level).any() and oblique.any():
        wide = by(around(oblique * (f[DARK] <= 0) * level, 10), around(lost * level, 10), 40, True)
        score = np.where(silent & level & (score <= 0), np.minimum(wide, 0), score)
    return np.asarray(score, np.float32)


def sloping(planes: F32, watery: Flags, cell_m: float) -> F32:
    n = np.maximum(planes[N], 1)
    sure = planes[GRADIENT] - np.float32(2.5) * (planes[RESIDUAL] / np.sqrt(n) / np.float32(1.4 * cell_m))
    tilted = np.interp(sure, (0.025, 0.045, 0.07), (0.0, -3.4, -5.0))
    score = np.where(watery, tilted, np.interp(sure, (0.004, 0.01, 0.02), (0.0, -3.5, -5.0)))
    return np.where(planes[RESIDUAL] < np.float32(0.05), score, 0).astype(np.float32)


# ---- extents ----------------------------------------------------------------------------------------


def coarser(f: F32) -> F32:
    """Return number, mean and squares in cells twice as wide."""
    rows, cols = (-(-n // 2) for n in f.shape[1:])
    parts = np.zeros((3, 2 * rows, 2 * cols))
    parts[:, : f.shape[1], : f.shape[2]] = f[[COUNT, MEAN, SQUARES]]
    count, mean, squares = parts.reshape(3, rows, 2, cols, 2)
    total = count.sum(axis=(1, 3))
    middle = (count * mean).sum(axis=(1, 3)) / np.maximum(total, 1)
    off = mean - middle[:, None, :, None]
    return np.stack([total, middle, (squares + count * off**2).sum(axis=(1, 3))]).astype(np.float32)


def extents(
    count: F32, mean: F32, planes: F32, cell_m: float, roughest_m: float, falling_m: float
) -> tuple[Labels, F32, Floats, Floats]:
    """Return labels, levels, and of each label its log odds and the residual of its planes."""
    core = (planes[GRADIENT] < np.float32(0.01)) & (planes[RESIDUAL] < np.float32(roughest_m))
    labels, n = ndimage.label(core)
    wide = np.bincount(labels.ravel(), minlength=n + 1) * cell_m**2 >= 40
    wide[0] = False
    labels, n = (np.cumsum(wide) * wide)[labels].astype(np.int32), int(wide.sum()) + 1
    level_m, within = np.full(count.shape, np.nan, np.float32), labels > 0
    if n == 1:
        return labels, level_m, np.zeros(1), np.zeros(1)
    own, height = labels[within], planes[LEVEL][within].astype(np.float64)
    size, residual2 = np.bincount(own, minlength=n), planes[RESIDUAL][within].astype(np.float64) ** 2
    level, noise = averages(own, height, n), averages(own, residual2 / planes[N][within], n)
    inexact_m = np.sqrt(np.maximum(0, averages(own, (height - level[own]) ** 2, n) - noise))
    exact = np.interp(inexact_m, [0.006, 0.03], [1, -1])
    area = np.interp(
        np.log(np.maximum(size, 1) * cell_m**2), np.log([40, 100, 400, 1e4, 4e4]), [-2, 0, 1.5, 1.5, 3]
    )
    off, about_m, fall = falls(labels, height, noise, cell_m)
    falling = (inexact_m > falling_m) & (fall < 0.006)
    exact = np.where(falling, np.interp(about_m, [0.006, 0.012], [1, -1]), exact)
    area = np.where(falling, np.minimum(area, 1.5), area)
    level_m[within] = np.where(falling[own], height - off, level[own])
    score = np.where(falling, np.interp(fall, (0.003, 0.006), (0, -3)), 0)
    score += np.minimum(area, 0) + np.maximum(area, 0) * exact - 1.5 * np.maximum(-exact, 0)
    residual_m = np.sqrt(averages(own, residual2, n))
    for _ in range(3):
        labels, level_m = grown(labels, level_m, count, mean, np.maximum(0.06, 2.5 * residual_m))
    gaps = ndimage.binary_closing((labels > 0) & (count > 0), iterations=2)
    labels = np.where((count > 0) | gaps, labels, 0)
    level_m = np.where(labels > 0, level_m, np.float32(np.nan))
    bank = np.array([banks(count, mean, labels, level_m, k, bool(falling[k]), cell_m) for k in range(n)])
    score += np.where(falling & (bank > 0), bank * np.maximum(exact, 0), bank)
    score[0] = 0
    return labels, level_m, score, residual_m


def falls(labels: Labels, height: Floats, noise: Floats, cell_m: float) -> tuple[Floats, Floats, Floats]:
    """Return heights above planes over blocks of 16 m, and of each label their inexactness and gradient."""
    place, own, n = np.argwhere(labels > 0), labels[labels > 0], len(noise)
    off, gradient = np.zeros(len(own)), np.zeros(len(own))
    block = np.column_stack([place // int(16 / cell_m), own])
    _, part = np.unique(block, axis=0, return_inverse=True)
    for k in range(part.max() + 1):
        at = part.ravel() == k
        y, x, z = (v - v.mean() for v in (*(cell_m * place[at].T), height[at]))
        few = 0.2 * cell_m**2
        normal = [[(x * x).mean() + few, (x * y).mean()], [(x * y).mean(), (y * y).mean() + few]]
        a, b = np.linalg.solve(normal, [(x * z).mean(), (y * z).mean()])
        off[at], gradient[at] = z - a * x - b * y, np.hypot(a, b)
    return off, np.sqrt(np.maximum(0, averages(own, off**2, n) - noise)), averages(own, gradient, n)


def grown(labels: Labels, level: F32, count: F32, mean: F32, band_m: Floats) -> tuple[Labels, F32]:
    out, heights = labels.copy(), level.copy()
    for r, c in np.argwhere((labels == 0) & ndimage.binary_dilation(labels > 0, np.ones((3, 3)))):
        at = slice(max(0, r - 1), r + 2), slice(max(0, c - 1), c + 2)
        own = labels[at].max()
        beside = float(np.mean(level[at][labels[at] == own], dtype=np.float64))
        if count[r, c] == 0 or abs(mean[r, c] - beside) < band_m[own]:
            out[r, c], heights[r, c] = own, beside
    return out, heights


def banks(
    count: F32, mean: F32, labels: Labels, level_m: F32, label: int, falling: bool, cell_m: float
) -> float:
    own = labels == label
    if label == 0 or not own.any():
        return 0.0
    rows, cols = ndimage.find_objects(own.astype(np.int32))[0]
    box = slice(max(0, rows.start - 4), rows.stop + 4), slice(max(0, cols.start - 4), cols.stop + 4)
    own, whole, size = own[box], ndimage.binary_fill_holes(own[box]), own.sum() * cell_m**2
    at, places, kinds = np.argwhere(own), np.argwhere(~whole & (count[box] > 0)), []
    middle, levels = np.argwhere(whole).mean(axis=0), level_m[box][own].astype(np.float64)
    for place in places:
        near = np.abs(at - place).max(axis=1) <= 4
        if not near.any():
            continue
        nearest = ((at - place)[near] ** 2).sum(axis=1).argmin()
        above = mean[box][tuple(place)] - levels[near][nearest]
        if above <= (1.0 if size < 400 else np.inf):
            turn = np.arctan2(*(place - middle)) / (2 * np.pi) + 0.5
            kinds.append((above > 0.1, above < -0.1, min(int(turn * 12), 11)))
    if len(kinds) < 12:
        return 0.0
    up, down, sector = np.array(kinds).T
    sides = sum(2 * up[sector == k].sum() > (sector == k).sum() for k in range(12))
    fewest = float(np.interp(size, (100, 400, 1500, 4000), (7, 6, 3, 1)))
    fewest = max(fewest, 4) if falling else fewest
    even = 1 - up.mean() - down.mean()
    score = -2.5 * ramp(even, 0.3, 0.4) - 4 * ramp(down.mean(), 0.03, 0.15)
    return float(score + 3.5 * ramp(up.mean(), 0.35, 0.35) * ramp(np.float64(sides), fewest, 2))


def level_extents(f: F32, planes: F32, wide_planes: F32, cell_m: float) -> tuple[Labels, F32, Floats]:
    labels, level_m, score, _ = extents(f[COUNT], f[MEAN], planes, cell_m, 0.06, 0.018)
    coarse = coarser(f)
    wide, wide_m, scores, residual_m = extents(coarse[0], coarse[1], wide_planes, 2 * cell_m, 0.2, np.inf)
    rows, cols = labels.shape
    wide, wide_m = (v.repeat(2, axis=0).repeat(2, axis=1)[:rows, :cols] for v in (wide, wide_m))
    near = np.abs(f[MEAN] - wide_m) < np.maximum(0.06, 2.5 * residual_m)[wide]
    better = (wide > 0) & ((f[COUNT] == 0) | near) & ((labels == 0) | (scores[wide] > score[labels]))
    better &= bool(scores.any())
    labels = np.where(better, wide + len(score) - 1, labels)
    return labels, np.where(better, wide_m, level_m), np.concatenate([score, scores[1:]])


# ---- roofs and floods -------------------------------------------------------------------------------


def plateau_labels(height: F32, step: float) -> Labels:
    """Label the cells joined by small steps, also across one unknown cell, in the order of rows."""
    labels, n = np.zeros(height.shape, np.int32), 0
    for start in map(tuple, np.argwhere(~np.isnan(height))):
        if labels[start]:
            continue
        n += 1
        labels[start], waiting = n, [start]
        while waiting:
            r, c = waiting.pop()
            for dr, dc in SIDES:
                i, j = r + dr, c + dc
                if inside(i, j, height) and np.isnan(height[i, j]):
                    i, j = i + dr, j + dc
                if inside(i, j, height) and not labels[i, j] and abs(height[i, j] - height[r, c]) <= step:
                    labels[i, j] = n
                    waiting.append((i, j))
    return labels


def inside(r: int, c: int, of: NDArray[np.generic]) -> bool:
    return 0 <= r < of.shape[0] and 0 <= c < of.shape[1]


def raised_plateaus(f: F32, cell_m: float) -> tuple[F32, F32]:
    seen, reach = f[COUNT] > 0, max(1, round(4 / cell_m))
    height = np.where(seen, f[MEAN], np.float32(np.nan))
    labels = plateau_labels(
        np.where(spread_m(f) < np.float32(0.35), height, np.float32(np.nan)), 0.35 * cell_m
    )
    odds, raised = np.full(labels.shape, -4, np.float32), np.zeros(labels.shape, np.float32)
    size = np.bincount(labels.ravel()) * cell_m**2
    possible = [k for k in range(1, len(size)) if 8 <= size[k] <= 40_000]
    holes = np.zeros_like(labels)
    for label in possible:
        own = labels == label
        holes[ndimage.binary_fill_holes(own) & ~own] = label
    for label in possible:
        drops, known = [], 0
        for r, c in np.argwhere(labels == label):
            for dr, dc in SIDES:
                line = [(r + k * dr, c + k * dc) for k in range(1, reach + 1)]
                line = [at for at in line if inside(*at, labels)]
                if (
                    not line
                    or label in (labels[line[0]], holes[line[0]])
                    or label in [labels[at] for at in line]
                ):
                    continue
                below = sorted(float(height[at]) for at in line if not np.isnan(height[at]))
                farthest = max((k for k, at in enumerate(line, 1) if not np.isnan(height[at])), default=0)
                drop = height[r, c] - below[0] if below else -np.inf
                if drop < 1.5 and farthest < reach - 1:
                    continue
                known += 1
                if drop >= 1.5:
                    apart = below[1] - below[0] if len(below) > 1 else np.inf
                    drops.append(drop - (apart / 2 if apart < 0.5 else 0))
        share = len(drops) / max(known, 1)
        if known >= 8 and share > 0.3:
            odds[labels == label] = -4 + 8 * ramp(np.float64(share), 0.3, 0.6 - 0.3)
            raised[labels == label] = np.median(np.array(drops[:256], np.float32))
    return odds, raised


def flooded(
    water: Floats, f: F32, labels: Labels, level_m: F32, surface_m: F32, cell_m: float
) -> tuple[Floats, bool]:
    """Return the probabilities of water with those of flooded ground, and whether any water floods."""
    level, any_water = np.where(labels > 0, level_m, np.float32(0)), False
    mirrors, _ = ndimage.label(np.isfinite(surface_m))
    for own, base, above, fewest_m2, one_level_m in (
        (labels, level, f[MEAN] - level, 20, np.inf), (mirrors, 0 * level, surface_m, 8, np.float32(0.15))
    ):  # fmt: skip
        seeds = np.where((f[COUNT] > 0) & (water >= 0.2), own, 0)
        may = (f[COUNT] > 0) & ~((f[ASIDE] >= 2) & (f[ASIDE_LIGHT] > np.float32(0.22)))
        under, height, mean = np.zeros_like(seeds), base.copy(), {}
        for label in range(1, own.max() + 1):
            of = seeds == label
            ranked = np.sort(above[of])
            if len(ranked) * cell_m**2 >= fewest_m2:
                low, middle, high = (ranked[int(share * len(ranked))] for share in (0.1, 0.75, 0.9))
                if high - low <= one_level_m:
                    under[of], height[of], mean[label] = label, base[of] + middle, water[of].mean()
        waiting = deque(map(tuple, np.argwhere(under > 0)))
        while waiting:
            r, c = waiting.popleft()
            for dr, dc in SIDES:
                i, j = r + dr, c + dc
                if not inside(i, j, under) or under[i, j] or not may[i, j]:
                    continue
                if -0.4 < f[MEAN][i, j] - height[r, c] < -0.01:
                    under[i, j], height[i, j] = under[r, c], height[r, c]
                    waiting.append((i, j))
        for label, probability in mean.items():
            water = np.where(under == label, np.maximum(water, probability), water)
        any_water |= bool(mean)
    return water, any_water


# ---- all of them ------------------------------------------------------------------------------------


def probability(log_odds: NDArray[np.floating]) -> F32:
    return np.asarray(1 / (1 + np.exp(-np.clip(log_odds, -30, 30))), np.float32)


def classified(
    f: F32,
    planes: F32,
    wide_planes: F32,
    cell_m: float,
    shape: F32 | None,
    said: F32 | None,
    sees_obliquely: bool,
) -> NDArray[np.floating]:
    """Return water, roof, low vegetation, canopy, height of roofs, kind, and shape, (7, rows, cols).

    planes, wide_planes: (4, rows, cols) through the windows of cells, and of cells twice as wide.
    """
    seen = f[COUNT] > 0
    if shape is None:
        labels, level_m, odds = level_extents(f, planes, wide_planes, cell_m)
    else:
        labels, level_m, odds, _ = extents(f[COUNT], f[MEAN], planes, cell_m, 0.06, 0.018)
    on_level = labels > 0 if shape is None else (labels > 0) | (shape != 0)
    roof, raised_m = raised_plateaus(f, cell_m)
    mirror, surface_m = specular_returns(f)
    lost, dark = vanishing_returns(f, on_level, sees_obliquely), dark_returns(f, on_level)
    vanishing = np.where(f[DARK] <= -6, np.minimum(lost, np.float32(1.5)), lost)
    both = np.where(vanishing > 0, np.float32(2), np.float32(0))
    vanishing = np.where(dark > 0, np.maximum(vanishing, dark) + both, vanishing)
    vanishing = np.where(mirror > 0, np.maximum(vanishing, mirror), vanishing)
    level = odds[labels].astype(np.float32)
    if shape is not None:
        level = np.where(shape != 0, np.maximum(level, shape), level)
    level = np.where(roof > 0, np.minimum(level, 0), level)
    watery = ((f[LOST_NEAR] >= 4) | (dark > 0)) & (vanishing > 0)
    score = np.float32(-4.7) + np.where(vanishing > 0, np.maximum(level, -0.5), level) + vanishing
    score += np.where((level > 0) | (mirror > 0), 0, sloping(planes, watery, cell_m))
    start = np.where(seen | on_level, probability(score), 0).astype(np.float64)
    water, _ = flooded(start, f, labels, level_m, surface_m, cell_m)
    beside = around(water >= 0.2, 1) >= 3
    water = np.where(beside & seen, np.maximum(water, 0.1), water)
    plant, tall = penetration(f), np.clip((f[HIGH] - f[LOW] - 2.5) / 0.5 + 0.5, 0, 1)
    if said is not None:
        roof, plant = roof + said[0], plant + said[1]
        tall = np.where(np.isnan(said[2]), tall, said[2])
    plants = np.where(seen, probability(plant), 0) * (1 - water)
    roofs = np.where(seen, probability(roof), 0) * (1 - water - plants)
    parts = np.stack([water, roofs, plants * (1 - tall), plants * tall])
    bare = np.where(seen & (planes[N] >= 8), 1 - parts.sum(axis=0), 0)
    likelihood = np.concatenate([parts, bare[np.newaxis]])
    kind = np.where(likelihood.max(axis=0) > 0.5, np.array([2, 3, 4, 5, 1])[likelihood.argmax(axis=0)], 0)
    return np.stack([*parts, raised_m, kind, level if shape is None else shape])
