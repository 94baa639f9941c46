"""Pictures of the radar's section."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from slz.grid import Grid
from slz.radar.accuracy import height_error_m
from slz.radar.interferogram import Interferogram
from slz.radar.interferometer import Interferometer

F64 = NDArray[np.float64]
DPI = 110


def figure_2(file: Path, tilts_deg: Sequence[float], altitude_m: float) -> Path:
    """Draw the height error against the baseline by look angle and tilt (Radar letter, Figure 2)."""
    figure = Figure((13, 4.2), layout="constrained")
    baselines = np.linspace(0.1, 1.2, 221)
    for k, tilt in enumerate(tilts_deg, start=1):
        axes = figure.add_subplot(1, len(tilts_deg), k)
        for look_deg in (30, 40, 50, 60):
            radars = [Interferometer(baseline_m=float(b), tilt_deg=tilt) for b in baselines]
            errors = [float(height_error_m(radar, altitude_m, np.radians(look_deg))) for radar in radars]
            axes.plot(baselines, 100 * np.array(errors), label=f"{look_deg}°")
        axes.axvspan(0.48, 0.57, color="#cccccc", alpha=0.6)
        axes.set(ylim=(0, 30), title=f"tilt {tilt:g}°", xlabel="baseline, m", ylabel="height error, cm")
        axes.legend(title="look angle")
    figure.savefig(file, dpi=DPI)
    return file


def phases(file: Path, images: Sequence[Interferogram]) -> Path:
    """Draw phase without the flat Earth, and coherence, of every observation (Radar letter, Figure 5)."""
    figure = Figure((14, 7), layout="constrained")
    for k, image in enumerate(images):
        for row, (values, title, limits) in enumerate(
            ((image.phase_rad, "phase, rad", (-np.pi, np.pi)), (image.coherence, "coherence", (0, 1)))
        ):
            axes = figure.add_subplot(2, len(images), 1 + k + row * len(images))
            cmap = "twilight" if row == 0 else "viridis"
            shown = axes.imshow(values.T, aspect="auto", vmin=limits[0], vmax=limits[1], cmap=cmap)
            figure.colorbar(shown, ax=axes)
            axes.set(title=f"{90 * k}°: {title}", xlabel="line", ylabel="range bin")
    figure.savefig(file, dpi=DPI)
    return file


def dems(file: Path, heights_m: Sequence[F64], grid: Grid) -> Path:
    """Draw the DEM of every observation (Radar letter, Figure 6)."""
    figure = Figure((14, 3.8), layout="constrained")
    for k, height in enumerate(heights_m):
        axes = figure.add_subplot(1, len(heights_m), k + 1)
        shown = axes.imshow(height, origin="lower", extent=_extent(grid), vmin=-1, vmax=3, cmap="terrain")
        axes.set(title=f"{90 * k}°", xlabel="east, m", ylabel="north, m")
    figure.colorbar(shown, ax=figure.axes, label="m")
    figure.savefig(file, dpi=DPI)
    return file


def result(file: Path, height_m: F64, truth_m: F64, even: NDArray[np.bool_], grid: Grid) -> Path:
    """Draw the fused DEM, the truth, and the errors (Radar letter, Figure 7)."""
    figure = Figure((14, 4), layout="constrained")
    for k, (values, title) in enumerate(((height_m, "fused; white: unknown"), (truth_m, "truth")), start=1):
        axes = figure.add_subplot(1, 3, k)
        shown = axes.imshow(values, origin="lower", extent=_extent(grid), vmin=-1, vmax=3, cmap="terrain")
        axes.set(title=title, xlabel="east, m", ylabel="north, m")
    figure.colorbar(shown, ax=figure.axes, label="m")
    axes = figure.add_subplot(1, 3, 3)
    error = (height_m - truth_m)[even]
    error = error[np.isfinite(error)]
    axes.hist(error, np.arange(-0.15, 0.151, 0.005).tolist(), color="#35608d")
    axes.set(title=f"error on even ground, std {error.std():.3f} m", xlabel="m", ylabel="cells")
    figure.savefig(file, dpi=DPI)
    return file


def _extent(grid: Grid) -> tuple[float, float, float, float]:
    east, north = grid.west_m + grid.cols * grid.cell_m, grid.south_m + grid.rows * grid.cell_m
    return grid.west_m, east, grid.south_m, north
