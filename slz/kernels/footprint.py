"""Plane, slope and relief of the ground under a footprint, from per-cell evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel
from slz.kernels.scatter import COUNT, HIGH, HIGH2, LOW, LOW2, MEAN, NOISE, TIME

FEW = 20  # returns of 3 x 3 cells up to which each stands for itself
CROWD = 64  # returns of a cell from which on its hazards show in more than one of them

# Layers of `summarise`.
HEIGHT, BOTTOM, TOP, WEIGHT, EXCESS, SPREAD = range(6)


@kernel("float64(float64)")
def expected_maximum(n: float) -> float:
    """Return the expected maximum of n > 8 standard normal numbers (its Gumbel limit; 7 % too large at 9)."""
    root = np.sqrt(2 * np.log(n))
    return float(root - (np.log(np.log(n)) + np.log(4 * np.pi) - 2 * 0.5772) / (2 * root))


@kernel("float32[:, :, :](float32[:, :, :, :], float32, float32)")
def summarise(evidence: NDArray[np.float32], now_s: float, max_age_s: float) -> NDArray[np.float32]:
    """Return height, bottom, top, number of returns, excess and spread of every cell; NaN, 0 where unknown.

    Top is the highest return of the cell, but only as far up as a second return reaches; bottom likewise. So
    one ghost cannot condemn the ground, two returns of a pole do. Where returns are few, a wire or fence may
    have sent back one only, and each stands for itself. The second is one of the cell, or while
    the cell has few returns, one of the cells around: of many, two ghosts in neighbours are mere chance. The
    height is the mean without an extreme that found no such support. The excess is how far beyond one
    standard deviation the sensor's noise alone is expected to carry the highest and the lowest return of so
    many; the spread is the variance of that noise.
    """
    rows, cols = evidence.shape[0], evidence.shape[1]
    out = np.full((6, rows, cols), np.float32(np.nan))
    nan = np.float32(np.nan)
    extreme = np.full((4, rows, cols), nan)  # highest, second highest, lowest, second lowest
    for r in range(rows):
        for c in range(cols):
            out[WEIGHT, r, c] = 0
            now, before = evidence[r, c, 0], evidence[r, c, 1]
            if now[COUNT] == 0 or now_s - before[TIME] > max_age_s:
                continue
            hi, lo = now[HIGH], now[LOW]
            two = now[COUNT] > 1
            hi2, lo2 = (now[HIGH2], now[LOW2]) if two else (np.float32(-np.inf), np.float32(np.inf))
            n, mean, noise = now[COUNT], now[MEAN], now[NOISE]
            if before[COUNT] > 0:
                hi2 = max(min(hi, before[HIGH]), max(hi2, before[HIGH2] if before[COUNT] > 1 else hi2))
                lo2 = min(max(lo, before[LOW]), min(lo2, before[LOW2] if before[COUNT] > 1 else lo2))
                hi, lo = max(hi, before[HIGH]), min(lo, before[LOW])
                mean = (mean * n + before[MEAN] * before[COUNT]) / (n + before[COUNT])
                noise = (noise * n + before[NOISE] * before[COUNT]) / (n + before[COUNT])
                n += before[COUNT]
            extreme[0, r, c], extreme[1, r, c], extreme[2, r, c], extreme[3, r, c] = hi, hi2, lo, lo2
            out[HEIGHT, r, c], out[WEIGHT, r, c], out[SPREAD, r, c] = mean, n, noise
            out[EXCESS, r, c] = (expected_maximum(n) - 1) * np.sqrt(noise) if n > 8 else np.float32(0)
    for r in range(rows):
        for c in range(cols):
            n = out[WEIGHT, r, c]
            if n == 0:
                continue
            hi, lo = extreme[0, r, c], extreme[2, r, c]
            high2, low2 = extreme[1, r, c], extreme[3, r, c]
            nearby = np.float32(0)
            for i in range(max(0, r - 1), min(rows, r + 2)):
                for j in range(max(0, c - 1), min(cols, c + 2)):
                    nearby += out[WEIGHT, i, j]
            if nearby <= FEW:
                out[TOP, r, c], out[BOTTOM, r, c] = hi, lo
                continue
            around = 1 if n < CROWD else 0
            for i in range(max(0, r - around), min(rows, r + around + 1)):
                for j in range(max(0, c - around), min(cols, c + around + 1)):
                    if (i != r or j != c) and out[WEIGHT, i, j] > 0:
                        second = 0 if out[WEIGHT, i, j] < CROWD else 1
                        high2 = max(high2, extreme[second, i, j])
                        low2 = min(low2, extreme[2 + second, i, j])
            top, bottom = min(hi, high2), max(lo, low2)
            if np.isinf(high2):  # a lone return without neighbours stands for itself
                top, bottom = hi, lo
            if top < bottom:  # a lone return above or below everything around it
                top = bottom = high2 if hi > high2 else low2
            if n > 1:
                dropped = np.float32(0)
                total = out[HEIGHT, r, c] * n
                if hi - top > np.float32(0.5):
                    total, dropped = total - hi, dropped + 1
                if bottom - lo > np.float32(0.5) and n - dropped > 1:
                    total, dropped = total - lo, dropped + 1
                out[HEIGHT, r, c] = total / (n - dropped)
            else:
                out[HEIGHT, r, c] = min(max(out[HEIGHT, r, c], bottom), top)
            out[TOP, r, c], out[BOTTOM, r, c] = top, bottom
    return out


@kernel("uint8[:, :](uint8[:, :], int64)")
def closed(known: NDArray[np.uint8], radius: int) -> NDArray[np.uint8]:
    """Return the morphological closing by a square of 2 radius + 1 cells, the outside being unknown.

    Gaps narrower than the square are filled; the edge of the known ground is not moved outwards.
    """
    rows, cols = known.shape
    out = known.copy()
    if radius == 0:
        return out
    wide = np.zeros((rows, cols), np.uint8)
    for r in range(rows):
        last = -radius - 1  # horizontal dilation by distance to the last known cell
        for c in range(cols):
            if known[r, c]:
                last = c
            if c - last <= radius:
                wide[r, c] = 1
        last = cols + radius + 1
        for c in range(cols - 1, -1, -1):
            if known[r, c]:
                last = c
            if last - c <= radius:
                wide[r, c] = 1
    dilated = np.zeros((rows, cols), np.uint8)
    seen = np.full(cols, -radius - 1)
    for r in range(rows):
        for c in range(cols):
            if wide[r, c]:
                seen[c] = r
            if r - seen[c] <= radius:
                dilated[r, c] = 1
    seen[:] = rows + radius + 1
    for r in range(rows - 1, -1, -1):
        for c in range(cols):
            if wide[r, c]:
                seen[c] = r
            if seen[c] - r <= radius:
                dilated[r, c] = 1
    tall = np.zeros((rows, cols), np.uint8)
    run = np.zeros(cols, np.int64)
    for r in range(rows):  # vertical erosion by length of the run of dilated cells
        for c in range(cols):
            run[c] = run[c] + 1 if dilated[r, c] else 0
            if run[c] > 2 * radius:
                tall[r - radius, c] = 1
    for r in range(rows):
        length = 0
        for c in range(cols):
            length = length + 1 if tall[r, c] else 0
            if length > 2 * radius:
                out[r, c - radius] = 1
    return out


@kernel("float32[:, :](float32[:, :], int64, float32)")
def highest_around(values: NDArray[np.float32], radius: int, fall: float) -> NDArray[np.float32]:
    """Return the maximum over a square of 2 radius + 1 cells around every cell, NaN being passed over.

    A value counts for less by `fall` with every row and column that it is away.
    """
    rows, cols = values.shape
    low = np.float32(-np.inf)
    wide = np.full((rows, cols), low)
    for r in range(rows):
        for c in range(cols):
            v = values[r, c]
            if not np.isnan(v):
                for j in range(max(0, c - radius), min(cols, c + radius + 1)):
                    wide[r, j] = max(wide[r, j], v - fall * abs(j - c))
    out = wide.copy()
    for r in range(rows):
        for i in range(max(0, r - radius), min(rows, r + radius + 1)):
            for c in range(cols):
                out[r, c] = max(out[r, c], wide[i, c] - fall * abs(i - r))
    return out


@kernel("float32[:, :, :](float32[:, :, :], uint8[:, :], int64, float64, float64, float64, float64)")
def planes(
    cells: NDArray[np.float32],
    covered: NDArray[np.uint8],
    radius: int,
    cell_m: float,
    noise_m: float,
    slope_limit: float,
    relief_limit: float,
) -> NDArray[np.float32]:
    """Fit a plane to the cells of the footprint around every cell.

    Returns (6, rows, cols): slope (deg), its standard deviation (deg), relief (m): the peak-to-peak of
    tops and bottoms about the plane, less their excess, rms residual of the heights (m), standard deviation
    of one return (m), and the relief without the outermost cells of the footprint (m). NaN where any cell of
    the footprint is not covered or fewer than six have a height. Where the slope exceeds its limit by three
    standard deviations both reliefs stay NaN; where a cheap upper bound is below half of the limit, that one
    is returned; above twice the limit they are lower bounds. Else they are exact.
    """
    rows, cols = covered.shape
    k = radius
    out = np.full((6, rows, cols), np.float32(np.nan))
    if rows < 2 * k + 1 or cols < 2 * k + 1:
        return out
    reference = np.float64(0)
    found = False
    for r in range(rows):
        for c in range(cols):
            if not found and cells[WEIGHT, r, c] > 0:
                reference, found = np.float64(cells[HEIGHT, r, c]), True
    if not found:
        return out
    # Column sums over 2k+1 rows of w, wy, wyy, wz, wyz, wzz, w/n, covered and spread.
    column = np.zeros((cols, 9))
    highest, lowest = highest_around(cells[TOP], k, 0), highest_around(-cells[BOTTOM], k, 0)
    for r in range(rows + k):
        for c in range(cols):
            for row, sign in ((r, 1.0), (r - 2 * k - 1, -1.0)):
                if row < 0 or row >= rows:
                    continue
                column[c, 7] += sign * covered[row, c]
                if cells[WEIGHT, row, c] == 0:
                    continue
                y, z = row * cell_m, cells[HEIGHT, row, c] - reference
                column[c, 0] += sign
                column[c, 1] += sign * y
                column[c, 2] += sign * y * y
                column[c, 3] += sign * z
                column[c, 4] += sign * y * z
                column[c, 5] += sign * z * z
                column[c, 6] += sign / cells[WEIGHT, row, c]
                column[c, 8] += sign * cells[SPREAD, row, c]
        row = r - k
        if row < k or row >= rows - k:
            continue
        w = wx = wxx = wy = wxy = wyy = wz = wxz = wyz = wzz = spread = seen = single = 0.0
        for c in range(cols + k):
            for col, sign in ((c, 1.0), (c - 2 * k - 1, -1.0)):
                if col < 0 or col >= cols:
                    continue
                x = col * cell_m
                s = column[col]
                w += sign * s[0]
                wx += sign * x * s[0]
                wxx += sign * x * x * s[0]
                wy += sign * s[1]
                wxy += sign * x * s[1]
                wyy += sign * s[2]
                wz += sign * s[3]
                wxz += sign * x * s[3]
                wyz += sign * s[4]
                wzz += sign * s[5]
                spread += sign * s[6]
                seen += sign * s[7]
                single += sign * s[8]
            col = c - k
            if col < k or col >= cols - k or seen < (2 * k + 1) ** 2 - 0.5 or w < 5.5:
                continue
            mx, my, mz = wx / w, wy / w, wz / w
            sxx, sxy, syy = wxx - w * mx * mx, wxy - w * mx * my, wyy - w * my * my
            sxz, syz, szz = wxz - w * mx * mz, wyz - w * my * mz, wzz - w * mz * mz
            det = sxx * syy - sxy * sxy
            if det < 1e-9 * (sxx + syy) ** 2:
                continue
            a, b = (sxz * syy - syz * sxy) / det, (syz * sxx - sxz * sxy) / det
            gradient = np.sqrt(a * a + b * b)
            squares = max(0.0, szz - a * sxz - b * syz)
            rms = np.sqrt(squares / w)
            noise = max(noise_m * np.sqrt(spread / w), np.sqrt(squares / (w - 3)))
            sigma = noise * np.sqrt(0.5 * (sxx + syy) / det) / (1 + gradient * gradient)
            at = mz + a * (col * cell_m - mx) + b * (row * cell_m - my)
            out[0, row, col] = np.degrees(np.arctan(gradient))
            out[1, row, col] = np.degrees(sigma)
            out[3, row, col] = rms
            out[4, row, col] = np.sqrt(max(0.0, single / w))
            if out[0, row, col] > slope_limit + 3 * out[1, row, col]:
                continue
            bound = highest[row, col] + lowest[row, col] + 2 * k * cell_m * (abs(a) + abs(b))
            if bound < 0.5 * relief_limit:
                out[2, row, col] = out[5, row, col] = bound
                continue
            low, high, inner_low, inner_high = np.inf, -np.inf, np.inf, -np.inf
            for i in range(row - k, row + k + 1):
                tilt = at + b * (i - row) * cell_m + reference
                for j in range(col - k, col + k + 1):
                    if cells[WEIGHT, i, j] == 0:
                        continue
                    level = tilt + a * (j - col) * cell_m
                    bottom = cells[BOTTOM, i, j] + cells[EXCESS, i, j] - level
                    top = cells[TOP, i, j] - cells[EXCESS, i, j] - level
                    low, high = min(low, bottom), max(high, top)
                    if abs(i - row) < k and abs(j - col) < k:
                        inner_low, inner_high = min(inner_low, bottom), max(inner_high, top)
                if inner_high - inner_low > 2 * relief_limit:
                    break
            out[2, row, col] = max(0.0, high - low)
            out[5, row, col] = max(0.0, inner_high - inner_low)
    return out
