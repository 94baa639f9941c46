"""Noise of the simulated VLP-16 and OS0 against that of real recordings, by the same statistics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.returns import RawReturns
from tests.opinion import recordings, simulated_recordings
from tests.opinion.pulse_statistics import alone, neighbour_correlation, row_biases, smooth_pulses, steps
from tests.opinion.range_image import RangeImage

F64 = NDArray[np.float64]
RANGES_M = (0.45, 2.0, 6.0, 15.0)
BEYOND_M = (0.03, 0.05, 0.075, 0.1, 0.15)
LEAST = 200
STREAMS: dict[str, tuple[Callable[[], RawReturns], int, int]] = {
    "VLP-16, real": (recordings.velodyne, 55_296, 4),
    "VLP-16, simulated": (lambda: simulated_recordings.velodyne(1), 55_296, 4),
    "OS0, real": (recordings.ouster, 97_656, 8),
    "OS0, simulated": (lambda: simulated_recordings.ouster(1), 195_313, 8),
}
"""Stream, time between two firings of a laser (ns), and rows of a patch."""


def run() -> int:
    """Print the measures of each stream as a table."""
    columns = [
        _measures(RangeImage.of(make(), firing_ns), rows) for make, firing_ns, rows in STREAMS.values()
    ]
    print("| measure | " + " | ".join(STREAMS) + " |\n|" + "---|" * (len(STREAMS) + 1))
    for name in columns[0]:
        print(f"| {name} | " + " | ".join(column[name] for column in columns) + " |")
    return 0


def _measures(image: RangeImage, patch_rows: int) -> dict[str, str]:
    smooth = smooth_pulses(image)
    told = {"returns": f"{np.isfinite(image.range_m).sum()}", "on smooth surfaces": f"{len(smooth.range_m)}"}
    error = smooth.residual_m
    for low, high in pairwise(RANGES_M):
        own = (smooth.range_m >= low) & (smooth.range_m < high)
        seen = error[own & np.isfinite(error)]
        enough = len(seen) >= LEAST
        told[f"{low:g} to {high:g} m: deviation, mm"] = f"{_spread(seen) * 1e3:.1f}" if enough else ""
        told[f"{low:g} to {high:g} m: lost, %"] = f"{np.isnan(error[own]).mean() * 100:.2f}" if enough else ""
    seen = error[np.isfinite(error)]
    told["excess kurtosis within 15 cm"] = f"{_kurtosis(seen[np.abs(seen) < BEYOND_M[-1]]):.1f}"
    told["beyond three deviations, %"] = f"{(np.abs(seen) > 3 * _spread(seen)).mean() * 100:.2f}"
    for limit in BEYOND_M:
        told[f"beyond {limit * 100:g} cm, %"] = f"{(np.abs(seen) > limit).mean() * 100:.2f}"
    told["correlation of neighbours"] = f"{neighbour_correlation(image, smooth):.2f}"
    bias, patches = row_biases(image, patch_rows)
    told["deviation of the rows' biases, mm"] = f"{np.nanstd(bias[patches >= 5]) * 1e3:.1f}"
    for low, high in ((8, 40), (40, 100)):
        own = (smooth.intensity >= low) & (smooth.intensity < high) & np.isfinite(smooth.relative)
        told[f"intensity {low} to {high}: relative deviation, %"] = (
            f"{_spread(smooth.relative[own]) * 100:.0f}"
        )
    for step in steps(image):
        name = f"steps of {step.low_m:g} to {step.high_m:g} m: with a return between, %"
        told[name] = f"{100 * step.between / max(step.count, 1):.0f} of {step.count}"
    told["pulses with two returns, %"] = f"{100 * image.two_echoes / np.isfinite(image.range_m).sum():.2f}"
    lonely, all_returns = alone(image)
    told["returns alone, %"] = f"{100 * lonely / all_returns:.2f}"
    return told


def _spread(values: F64) -> float:
    """Return the standard deviation by the median absolute deviation."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def _kurtosis(values: Sequence[float] | F64) -> float:
    centred = np.asarray(values) - np.mean(values)
    return float((centred**4).mean() / (centred**2).mean() ** 2 - 3.0)
