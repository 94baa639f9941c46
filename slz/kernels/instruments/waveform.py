"""Waveform peaks: unwrapping, polynomial fit and maximum likelihood.

The first n - 1 samples in time are used: the last one carries the end marker of the ring buffer.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Strided1D, Strided2D, Strided3D
from slz.kernels.jit import kernel, kernel_part

MISSING, GOOD, SATURATED, ODD = range(4)
EDGE_SAMPLES = 3  # samples at either end of the buffer without a peak search
CLIPPED_MOST = 4  # clipped samples, above which too little of the pulse is left
STEPS = 5  # Gauss-Newton or Newton iterations, at most
SETTLED = 1e-3  # samples; a smaller step is the last one
ODD_OVER = 9.0  # variance of the residuals over that of the noise, above which it is not one pulse


@kernel_part
def unwrap(ring: Strided1D[np.uint16], marker: float, baseline: float, out: Strided1D[np.float64]) -> int:
    """Write the samples before the marker in time order, less the baseline; return 1 if sound.

    A ring without a marker, or with two, has no order (Flash paper, section 4.2): 0.
    """
    n = len(ring)
    at, count = -1, 0
    for i in range(n):
        if ring[i] < marker:
            at = i
            count += 1
    if count != 1:
        return 0
    for k in range(n - 1):
        i = at + 1 + k
        out[k] = ring[i - n if i >= n else i] - baseline
    return 1


@kernel
def polynomial_peaks(
    samples: Strided3D[np.uint16],
    counter: Strided2D[np.uint32],
    gate: int,
    fit: Strided2D[np.float64],
    marker: float,
    baseline: float,
    clipped: float,
    least: float,
    ticks: Strided2D[np.float64],
    height: Strided2D[np.float64],
    state: Strided2D[np.uint8],
) -> None:
    """Fit a polynomial to each waveform; write time (clock ticks) and value of its maximum.

    `fit` (degree + 1, n - 1) maps samples to coefficients of powers of u, which runs from -1 at the first
    sample to 1 at the last before the marker: the fit is one fixed linear map (Flash paper, section 4.2). The
    maximum is searched without the outermost `EDGE_SAMPLES` samples.
    """
    rows, cols, n = samples.shape
    m, order = n - 1, fit.shape[0]
    y, a = np.empty(m), np.empty(order)
    half = (m - 1) / 2.0
    for r in range(rows):
        for c in range(cols):
            ticks[r, c], height[r, c], state[r, c] = np.nan, np.nan, MISSING
            if counter[r, c] >= gate or unwrap(samples[r, c], marker, baseline, y) == 0:
                continue
            n_clipped = 0
            for k in range(m):
                n_clipped += y[k] >= clipped - baseline
            for j in range(order):
                a[j] = 0.0
                for k in range(m):
                    a[j] += fit[j, k] * y[k]
            best, top = 0.0, -np.inf
            for k in range(2 * EDGE_SAMPLES, 2 * (m - 1 - EDGE_SAMPLES) + 1):
                u = (0.5 * k - half) / half
                p = a[order - 1]
                for j in range(order - 2, -1, -1):
                    p = p * u + a[j]
                if p > top:
                    best, top = u, p
            u, step = best, 0.5 / half
            for _ in range(STEPS):
                p, d, dd = a[order - 1], 0.0, 0.0
                for j in range(order - 2, -1, -1):
                    dd = dd * u + 2.0 * d
                    d = d * u + p
                    p = p * u + a[j]
                if dd >= 0.0:
                    break
                u = min(max(u - d / dd, best - step), best + step)
            p = a[order - 1]
            for j in range(order - 2, -1, -1):
                p = p * u + a[j]
            if p < least:
                continue
            ticks[r, c] = counter[r, c] - m + half + u * half
            height[r, c] = p
            state[r, c] = SATURATED if n_clipped > CLIPPED_MOST else GOOD


@kernel
def likely_peaks(
    samples: Strided3D[np.uint16],
    counter: Strided2D[np.uint32],
    gate: int,
    sigma: float,
    noise: float,
    marker: float,
    baseline: float,
    clipped: float,
    least: float,
    ticks: Strided2D[np.float64],
    height: Strided2D[np.float64],
    error: Strided2D[np.float64],
    state: Strided2D[np.uint8],
) -> None:
    """Fit a Gaussian pulse to each waveform by maximum likelihood; write time, its standard error and height.

    Times are in clock ticks. `sigma` is the pulse's standard deviation in samples, `noise` that of a sample.
    The fit starts at the maximum of the matched filter over whole samples; Gauss-Newton steps in time and
    height follow, over the samples that are not clipped. Neighbouring values of a Gaussian differ by a factor
    that itself changes by a constant factor, so no exponential is taken per sample.
    """
    rows, cols, n = samples.shape
    m = n - 1
    y = np.empty(m)
    reach = int(np.ceil(2.5 * sigma))
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    bend = np.exp(-1.0 / sigma**2)
    for r in range(rows):
        for c in range(cols):
            ticks[r, c], height[r, c], error[r, c], state[r, c] = np.nan, np.nan, np.nan, MISSING
            if counter[r, c] >= gate or unwrap(samples[r, c], marker, baseline, y) == 0:
                continue
            t, top = 0.0, -np.inf
            for k in range(EDGE_SAMPLES, m - EDGE_SAMPLES):
                total = 0.0
                for i in range(max(0, k - reach), min(m, k + reach + 1)):
                    total += bell[i - k + reach] * y[i]
                if total > top:
                    t, top = float(k), total
            n_clipped = 0
            ss = sss = syd = sys_ = syy = 0.0
            a, move = 0.0, 1.0
            for step in range(STEPS + 1):
                s = np.exp(-0.5 * (t / sigma) ** 2)
                ratio = np.exp((t - 0.5) / sigma**2)
                ss = sdd = sds = sys_ = syd = syy = 0.0
                n_clipped = 0
                for k in range(m):
                    if y[k] >= clipped - baseline:
                        n_clipped += 1
                    else:
                        d = s * (k - t) / sigma**2
                        ss += s * s
                        sdd += d * d
                        sds += s * d
                        sys_ += s * y[k]
                        syy += y[k] * y[k]
                        syd += d * y[k]
                    s *= ratio
                    ratio *= bend
                sss = sdd - sds * sds / ss
                a = sys_ / ss
                if step == STEPS or abs(move) < SETTLED or a <= 0.0 or sss <= 0.0:
                    break
                move = min(max((syd - a * sds) / (a * sss), -1.0), 1.0)
                t += move
                t = min(max(t, 0.0), m - 1.0)
            if a < least or sss <= 0.0 or t < 1.0 or t > m - 2.0:
                continue
            left = syy - a * sys_  # residual sum of squares
            ticks[r, c] = counter[r, c] - m + t
            height[r, c] = a
            error[r, c] = noise / (a * np.sqrt(sss))
            odd = left > ODD_OVER * (noise**2 + (0.02 * a) ** 2) * (m - n_clipped)
            state[r, c] = SATURATED if n_clipped > CLIPPED_MOST else ODD if odd else GOOD
