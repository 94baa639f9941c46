"""Plane, slope and relief of the ground under a footprint."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.arctangent import arctangent
from slz.kernels.jit import kernel
from slz.kernels.lanes import LANES, every, load, multiplied, store, where
from slz.kernels.record import BOTTOM, EXCESS, HEIGHT, SPREAD, TOP, WEIGHT

SOME = 64  # cells whose median height stands for all
GAP = 8  # cells, up to which footprints on both sides are judged with those between

Row = NDArray[np.float32]
F0, DEGREES = np.float32(0), np.float32(57.29577951308232)


@kernel("void(float32[:, :, ::1], uint8[:, ::1], int64, float64, float64, float64, float64[:, ::1])")
def _add_row(
    cells: NDArray[np.float32],
    covered: NDArray[np.uint8],
    row: int,
    y: float,
    sign: float,
    reference: float,
    column: NDArray[np.float64],
) -> None:
    """Add a row to sums by column, or take it away, without a branch, so that the compiler takes several."""
    weight, height, spread = cells[WEIGHT, row], cells[HEIGHT, row], cells[SPREAD, row]
    seen = covered[row]
    for c in range(np.uint64(len(seen))):
        known = weight[c] != np.float32(0)
        z = height[c] - reference
        column[7, c] += sign * seen[c]
        column[0, c] += sign if known else 0.0
        column[1, c] += sign * y if known else 0.0
        column[2, c] += sign * y * y if known else 0.0
        column[3, c] += sign * z if known else 0.0
        column[4, c] += sign * y * z if known else 0.0
        column[5, c] += sign * z * z if known else 0.0
        column[6, c] += sign / weight[c] if known else 0.0
        column[8, c] += sign * spread[c] if known else 0.0


# Sums over a footprint, by their place in what `_over_columns` returns.
W, WX, WXX, WY, WXY, WYY, WZ, WXZ, WYZ, WZZ, S_SPREAD, S_SEEN, S_SINGLE = range(13)


@kernel("void(float64[:, ::1], int64, float64, float64[:, ::1])")
def _over_columns(column: NDArray[np.float64], k: int, cell_m: float, sums: NDArray[np.float64]) -> None:
    """Add up sums by column over 2 k + 1 of them, about each but the first and last k."""
    cols = column.shape[1]
    w = wx = wxx = wy = wxy = wyy = wz = wxz = wyz = wzz = spread = seen = single = 0.0
    for c in range(cols):
        for col, sign in ((c, 1.0), (c - 2 * k - 1, -1.0)):
            if col < 0:
                continue
            x = col * cell_m
            w += sign * column[0, col]
            wx += sign * x * column[0, col]
            wxx += sign * x * x * column[0, col]
            wy += sign * column[1, col]
            wxy += sign * x * column[1, col]
            wyy += sign * column[2, col]
            wz += sign * column[3, col]
            wxz += sign * x * column[3, col]
            wyz += sign * column[4, col]
            wzz += sign * column[5, col]
            spread += sign * column[6, col]
            seen += sign * column[7, col]
            single += sign * column[8, col]
        if c < 2 * k:
            continue
        at = c - k
        sums[W, at], sums[WX, at], sums[WXX, at], sums[WY, at], sums[WXY, at] = w, wx, wxx, wy, wxy
        sums[WYY, at], sums[WZ, at], sums[WXZ, at], sums[WYZ, at], sums[WZZ, at] = wyy, wz, wxz, wyz, wzz
        sums[S_SPREAD, at], sums[S_SEEN, at], sums[S_SINGLE, at] = spread, seen, single


# Planes of a row, by their place in what `_solve` leaves.
EAST, NORTH, LEVEL, RMS, SIGMA, RETURN, GRADIENT = range(7)


@kernel("void(float64[:, ::1], int64, float64, float64, float64, float64[:, ::1])")
def _solve(
    sums: NDArray[np.float64], k: int, cell_m: float, y: float, noise_m: float, fit: NDArray[np.float64]
) -> None:
    """Leave the planes of a row; their gradient is NaN where there is none."""
    cols = sums.shape[1]
    enough = (2 * k + 1) ** 2 - 0.5
    for c in range(np.uint64(cols)):
        w = sums[W, c]
        share = 1.0 / w
        mx, my, mz = sums[WX, c] * share, sums[WY, c] * share, sums[WZ, c] * share
        sxx, sxy = sums[WXX, c] - w * mx * mx, sums[WXY, c] - w * mx * my
        syy, sxz = sums[WYY, c] - w * my * my, sums[WXZ, c] - w * mx * mz
        syz, szz = sums[WYZ, c] - w * my * mz, sums[WZZ, c] - w * mz * mz
        det = sxx * syy - sxy * sxy
        scale = 1.0 / det
        a, b = (sxz * syy - syz * sxy) * scale, (syz * sxx - sxz * sxy) * scale
        square = a * a + b * b
        gradient = np.sqrt(square)
        left = szz - a * sxz - b * syz
        squares = left if left > 0.0 else 0.0
        single2, spread2 = noise_m * noise_m * (sums[S_SPREAD, c] * share), squares / (w - 3)
        noise2 = spread2 if spread2 > single2 else single2
        good = (sums[S_SEEN, c] >= enough) & (w >= 5.5) & (det >= 1e-9 * (sxx + syy) ** 2)
        fit[EAST, c], fit[NORTH, c] = a, b
        fit[LEVEL, c] = mz + a * (float(c) * cell_m - mx) + b * (y - my)
        fit[RMS, c] = np.sqrt(squares * share)
        fit[SIGMA, c] = np.sqrt(noise2 * 0.5 * (sxx + syy) * scale) / (1 + square)
        fit[RETURN, c] = np.sqrt(max(0.0, sums[S_SINGLE, c] * share))
        fit[GRADIENT, c] = gradient if good else np.nan


@kernel(
    "void(float32[::1], float32[::1], float64[:, ::1], int64, int64, int64, int64, float64,"
    " float32[::1], float32[:, ::1], float32[:, :, ::1])"
)
def _reliefs(
    lower: Row,
    upper: Row,
    fit: NDArray[np.float64],
    row: int,
    first: int,
    stop: int,
    k: int,
    cell_m: float,
    away: Row,
    room: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Leave the peak-to-peak of a row's footprints about their planes, and that of their inner cells.

    Sixteen footprints at a time, of each one cell after the other.

    Parameters
    ----------
    lower, upper
        Of the cells, over the same height as the planes' levels, row after row, and LANES more.
    first, stop
        The columns about which the footprints are; those whose gradient is NaN stay.
    away
        How far the columns of a footprint are to the east of its middle (m).
    room
        Scratch, (7, columns + LANES).
    """
    n, cols, wide = stop - first, fit.shape[1], room.shape[1]
    flat = room.ravel()
    level_of, west_of, north_of = room[0], room[1], room[2]
    for c in range(n):
        level_of[c], west_of[c] = fit[LEVEL, first + c], -fit[EAST, first + c]
        north_of[c] = fit[NORTH, first + c]
    for c in range(0, n, LANES):
        level, west, north = load(flat, c), load(flat, wide + c), load(flat, 2 * wide + c)
        low, high = every(np.float32(np.inf)), every(np.float32(-np.inf))
        inner_low, inner_high = low, high
        for i in range(-k, k + 1):
            tilt, at = level + north * every(np.float32(i * cell_m)), (row + i) * cols + first + c
            within = k if abs(i) < k else -k
            least, most = every(np.float32(np.inf)), every(np.float32(-np.inf))
            for d in range(1 - within, within):
                far = every(away[k + d])
                under = multiplied(west, far, load(lower, at + d))
                over = multiplied(west, far, load(upper, at + d))
                least = where(under < least, under, least)  # NaN is not
                most = where(most < over, over, most)
            least, most = least - tilt, most - tilt
            inner_low, inner_high = (
                where(least < inner_low, least, inner_low),
                where(inner_high < most, most, inner_high),
            )
            least, most = every(np.float32(np.inf)), every(np.float32(-np.inf))
            for d in range(-k, k + 1, 2 * k if abs(i) < k else 1):
                far = every(away[k + d])
                under = multiplied(west, far, load(lower, at + d))
                over = multiplied(west, far, load(upper, at + d))
                least, most = where(under < least, under, least), where(most < over, over, most)
            least, most = least - tilt, most - tilt
            low, high = where(least < low, least, low), where(high < most, most, high)
        store(flat, 3 * wide + c, low)
        store(flat, 4 * wide + c, high)
        store(flat, 5 * wide + c, inner_low)
        store(flat, 6 * wide + c, inner_high)
    low_of, high_of, inner_low_of, inner_high_of = room[3], room[4], room[5], room[6]
    for c in range(n):
        if not np.isnan(fit[GRADIENT, first + c]):
            whole = max(high_of[c], inner_high_of[c]) - min(low_of[c], inner_low_of[c])
            inner = inner_high_of[c] - inner_low_of[c]
            out[2, row, first + c], out[5, row, first + c] = max(F0, whole), max(F0, inner)


# What is told of the planes of a row, and which layers of `planes` they are.
A_SLOPE, A_SIGMA, A_RMS, A_RETURN, A_SHARE = range(5)
LAYER = np.array([0, 1, 3, 4, 6])


@kernel("void(float64[:, ::1], float64[::1], int64, float32[:, ::1])")
def _tell(fit: NDArray[np.float64], known: NDArray[np.float64], k: int, told: NDArray[np.float32]) -> None:
    """Leave what is told of the planes of a row by the layers above, NaN where there is none.

    Each layer has LANES numbers more than there are planes.
    """
    share, to_degrees = 1.0 / (2 * k + 1) ** 2, 180.0 / np.pi
    for c in range(np.uint64(fit.shape[1])):
        gradient = fit[GRADIENT, c]
        good = gradient == gradient
        told[A_SLOPE, c] = gradient
        told[A_SIGMA, c] = fit[SIGMA, c] * to_degrees if good else np.nan
        told[A_RMS, c] = fit[RMS, c] if good else np.nan
        told[A_RETURN, c] = fit[RETURN, c] if good else np.nan
        told[A_SHARE, c] = known[c] * share if good else np.nan
    slope = told[A_SLOPE]
    for c in range(0, fit.shape[1], LANES):
        store(slope, c, arctangent(load(slope, c)) * every(DEGREES))


@kernel("float64(float32[:, :, ::1])")
def _middle_height(cells: NDArray[np.float32]) -> float:
    """Return the median height of some cells, near which most are, so that little is rounded; NaN of none."""
    weight, height = cells[WEIGHT].ravel(), cells[HEIGHT].ravel()
    step, found, n = 1 + len(weight) // SOME, np.empty(SOME, np.float32), 0
    for offset in range(step):  # the first time through is enough but for ground hardly seen
        for i in range(offset, len(weight), step):
            if weight[i] > F0:
                k = n
                while k > 0 and found[k - 1] > height[i]:
                    found[k] = found[k - 1]
                    k -= 1
                found[k] = height[i]
                n += 1
        if n > 0:
            return np.float64(found[n // 2])
    return np.nan


@kernel("float32[:, :, :](float32[:, :, ::1], uint8[:, ::1], int64, float64, float64, float64)")
def planes(
    cells: NDArray[np.float32],
    covered: NDArray[np.uint8],
    radius: int,
    cell_m: float,
    noise_m: float,
    slope_limit: float,
) -> NDArray[np.float32]:
    """Fit a plane to the cells of the footprint around every cell.

    Returns (7, rows, cols): slope (deg), its standard deviation (deg), relief (m): the peak-to-peak of
    tops and bottoms about the plane, less their excess, rms residual of the heights (m), standard deviation
    of one return (m), the relief without the outermost cells of the footprint (m), and the share of its cells
    that hold a return. NaN where any cell of the footprint is not covered or fewer than six have a height;
    both reliefs also where the slope exceeds its limit by three standard deviations.
    """
    rows, cols = covered.shape
    k = radius
    out = np.full((7, rows, cols), np.float32(np.nan))
    if rows < 2 * k + 1 or cols < 2 * k + 1:
        return out
    reference = _middle_height(cells)
    if np.isnan(reference):
        return out
    # Column sums over 2k+1 rows of w, wy, wyy, wz, wyz, wzz, w/n, covered and spread.
    column = np.zeros((9, cols))
    lower, upper = np.zeros(rows * cols + LANES, np.float32), np.zeros(rows * cols + LANES, np.float32)
    bottom, top, excess = cells[BOTTOM].ravel(), cells[TOP].ravel(), cells[EXCESS].ravel()
    for i in range(np.uint64(rows * cols)):
        lower[i], upper[i] = bottom[i] + excess[i] - reference, top[i] - excess[i] - reference
    sums, fit = np.zeros((13, cols)), np.empty((7, cols))
    told = np.zeros((5, cols + LANES), np.float32)
    room, away = np.zeros((7, cols + LANES), np.float32), np.empty(2 * k + 1, np.float32)
    for i in range(2 * k + 1):
        away[i] = (i - k) * cell_m
    for r in range(rows):
        _add_row(cells, covered, r, r * cell_m, 1.0, reference, column)
        if r > 2 * k:
            _add_row(cells, covered, r - 2 * k - 1, (r - 2 * k - 1) * cell_m, -1.0, reference, column)
        if r < 2 * k:
            continue
        row = r - k
        _over_columns(column, k, cell_m, sums)
        _solve(sums, k, cell_m, row * cell_m, noise_m, fit)
        _tell(fit, sums[W], k, told)
        first = stop = k  # of a stretch of footprints whose relief is asked for
        for layer in range(5):
            out[LAYER[layer], row, k : cols - k] = told[layer, k : cols - k]
        for col in range(k, cols - k):
            if not out[0, row, col] <= slope_limit + 3 * out[1, row, col]:  # NaN is not
                fit[GRADIENT, col] = np.nan
                continue
            if col - stop > GAP:
                _reliefs(lower, upper, fit, row, first, stop, k, cell_m, away, room, out)
                first = col
            stop = col + 1
        _reliefs(lower, upper, fit, row, first, stop, k, cell_m, away, room, out)
    return out
