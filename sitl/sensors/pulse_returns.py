"""Returns of pulses: which echoes a receiver reports of what its beams meet, and what it measures of them.

Rows of all arrays (3, n): the strongest return, the last, and of two the one that is not the last; all equal
where there is one. Powers and exponentials come from NumPy, whose functions round differently.
"""

from __future__ import annotations

import numpy as np

from sitl.array_types import Array1D, Array2D
from sitl.compilation import kernel, kernel_part
from sitl.sensors.layer_echoes import PULSE_M
from sitl.sensors.optics import FAINTEST
from sitl.world.hits import DUST, GHOST, NOTHING

_GREATEST = float(np.finfo(np.float64).max)


@kernel_part
def _is_detected(
    range_m: float, limit_m: float, normal: float, uniform: float, blind_m: float, dropout: float
) -> bool:
    """Return whether a return is bright enough, with a soft edge about the limit of its brightness."""
    limit_m *= 1.0 + 0.04 * min(max(normal, -3.0), 3.0)
    return blind_m <= range_m <= limit_m and uniform >= dropout


@kernel_part
def _power(range_m: float, bright: float, by_power: bool) -> float:
    return min(bright / (range_m * range_m), _GREATEST) if by_power else bright


@kernel
def report_single(
    at: Array1D[np.int64],
    range_m: Array1D[np.float64],
    limit_m: Array1D[np.float64],
    bright: Array1D[np.float64],
    hit: Array1D[np.int64],
    normal: Array2D[np.float64],
    uniform: Array2D[np.float64],
    blind_m: float,
    dropout: float,
    out_range: Array2D[np.float64],
    out_bright: Array2D[np.float64],
    out_hit: Array2D[np.int64],
) -> None:
    """Write true returns of the pulses `at`, with one echo each; range 0 for none."""
    for k in range(at.size):
        n = at[k]
        seen = _is_detected(range_m[k], limit_m[k], normal[n, 3], uniform[n, 0], blind_m, dropout)
        for row in range(3):
            out_range[row, n] = range_m[k] if seen else 0.0
            out_bright[row, n], out_hit[row, n] = bright[k], hit[k] if seen else NOTHING


@kernel
def report_several(
    at: Array1D[np.int64],
    echo_m: Array2D[np.float64],
    echo_bright: Array2D[np.float64],
    label: Array2D[np.int64],
    merged_m: Array2D[np.float64],
    limit_m: Array2D[np.float64],
    merged_bright: Array2D[np.float64],
    by_power: Array1D[np.bool_],
    separation_m: float,
    normal: Array2D[np.float64],
    uniform: Array2D[np.float64],
    blind_m: float,
    dropout: float,
    out_range: Array2D[np.float64],
    out_bright: Array2D[np.float64],
    out_hit: Array2D[np.int64],
) -> None:
    """Write true returns of the pulses `at`, with several echoes each, all of a pulse lost or none.

    Parameters
    ----------
    echo_m, echo_bright, label
        (k, columns) of each echo, and what it comes from: codes of ``hits``.
    merged_m, limit_m, merged_bright
        The same after `merge`, and the greatest ranges of that brightness.
    by_power
        (k,) whether the strongest echo is that of most power, bright / range^2, instead of the brightest.
    separation_m
        Least distance of two returns of one pulse.
    """
    columns = echo_m.shape[1]
    for k in range(at.size):
        n, best, most = at[k], -1, -1.0
        for i in range(columns):
            if merged_bright[k, i] >= FAINTEST and _is_detected(
                merged_m[k, i], limit_m[k, i], normal[n, 3], uniform[n, 0], blind_m, dropout
            ):
                power = _power(merged_m[k, i], merged_bright[k, i], by_power[k])
                if power > most:
                    best, most = i, power
        if best < 0:
            out_range[:, n], out_bright[:, n], out_hit[:, n] = 0.0, 0.0, NOTHING
            continue
        last, second, most = best, best, -1.0
        for i in range(columns):
            if (
                abs(merged_m[k, i] - merged_m[k, best]) >= separation_m
                and merged_bright[k, i] >= FAINTEST
                and _is_detected(merged_m[k, i], limit_m[k, i], normal[n, 3], uniform[n, 0], blind_m, dropout)
            ):
                power = _power(merged_m[k, i], merged_bright[k, i], by_power[k])
                if power > most:
                    second, most = i, power
                if merged_m[k, i] > merged_m[k, last]:
                    last = i
        other = second if last == best else best
        for row, column in enumerate((best, last, other)):
            out_range[row, n], out_bright[row, n] = merged_m[k, column], merged_bright[k, column]
            # Of echoes that overlap, the brightest names the return.
            named, brightest = 0, -1.0
            for i in range(columns):
                if abs(echo_m[k, i] - echo_m[k, column]) <= PULSE_M and echo_bright[k, i] > brightest:
                    named, brightest = i, echo_bright[k, i]
            out_hit[row, n] = label[k, named]


@kernel
def measure(
    near: Array2D[np.float64],
    normal: Array2D[np.float64],
    uniform: Array2D[np.float64],
    flicker: Array1D[np.float64],
    row_m: Array1D[np.float64],
    range_sigma_m: float,
    tail: float,
    tail_factor: float,
    ghost_share: float,
    dust_share: float,
    tagged: float,
    range_m: Array2D[np.float64],
    bright: Array2D[np.float64],
    hit: Array2D[np.int64],
    ghost: Array1D[np.bool_],
    dust: Array1D[np.bool_],
    marked: Array1D[np.bool_],
) -> None:
    """Turn true returns, in place, into measured ones with false ones among them.

    A multi-path ghost is too far, the only return of its pulse. Dust or rain, a few metres ahead, takes the
    place of the strongest return and of the other. The range error is `range_sigma_m` from 10 m on, 1.5 times
    that at 0.2 m.

    Parameters
    ----------
    near
        (3, n) exponentials of minus half the ranges.
    normal, uniform
        (n, 4) random numbers.
    flicker
        (n,) factors of the brightness.
    row_m
        (n,) constant range error of the laser.
    """
    for n in range(flicker.size):
        error = normal[n, 2] * (tail_factor if uniform[n, 0] > 1.0 - tail else 1.0)
        seen = range_m[0, n] > 0.0
        for row in range(3):
            if range_m[row, n] > 0.0:
                sigma = range_sigma_m * (1.0 + 0.5 * near[row, n])
                range_m[row, n] = range_m[row, n] + sigma * error + row_m[n]
        marked[n] = uniform[n, 2] < tagged
        ghost[n] = seen and uniform[n, 1] < ghost_share
        if ghost[n]:
            range_m[:, n] = range_m[0, n] * (1.05 + 0.6 * uniform[n, 3])
            bright[:, n], hit[:, n] = bright[0, n], GHOST
        nearer = 0.3 + 8.0 * (uniform[n, 3] * uniform[n, 3])
        dust[n] = uniform[n, 1] > 1.0 - dust_share and (not seen or nearer < range_m[0, n])
        if dust[n]:
            range_m[0, n] = range_m[2, n] = nearer
            bright[2, n], hit[0, n], hit[2, n] = bright[0, n], DUST, DUST
        for row in range(3):
            bright[row, n] *= flicker[n]
