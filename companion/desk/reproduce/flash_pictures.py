"""Pictures of the flash LiDAR's section."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from slz.flash.frame_processing import FlashImage
from slz.flash.hazard_detection import Hazard
from slz.grid import Grid

F64 = NDArray[np.float64]
DPI = 110


def images(file: Path, image: FlashImage) -> Path:
    """Draw intensity and range (Flash paper, Figure 5)."""
    figure = Figure((11, 4.6), layout="constrained")
    for axes, values, title, bar in (
        (figure.add_subplot(1, 2, 1), image.measured.intensity, "intensity", "counts"),
        (figure.add_subplot(1, 2, 2), image.filtered_m, "range, 9-point median", "m"),
    ):
        shown = axes.imshow(values, cmap="viridis")
        figure.colorbar(shown, ax=axes, label=bar)
        axes.set(title=title, xlabel="column", ylabel="row")
    figure.savefig(file, dpi=DPI)
    return file


def dem(file: Path, heights_m: F64, grid: Grid, peaks_m: F64) -> Path:
    """Draw the DEM and its histogram (Flash paper, Figure 7)."""
    figure = Figure((11, 4.6), layout="constrained")
    axes = figure.add_subplot(1, 2, 1)
    shown = axes.imshow(heights_m, origin="lower", extent=_extent(grid), cmap="viridis")
    figure.colorbar(shown, ax=axes, label="elevation, m")
    axes.set(title="DEM, cells of 0.1 m; white: not seen", xlabel="east, m", ylabel="north, m")
    axes = figure.add_subplot(1, 2, 2)
    axes.hist(
        heights_m[np.isfinite(heights_m)], np.arange(-0.8, 2.6, 0.05).tolist(), log=True, color="#35608d"
    )
    for peak in peaks_m:
        axes.axvline(peak, color="#c0392b", linewidth=0.8)
    axes.set(title="histogram of elevations", xlabel="m", ylabel="cells")
    figure.savefig(file, dpi=DPI)
    return file


def segments(file: Path, maps: dict[float, F64]) -> Path:
    """Draw classified maps by xi (Flash paper, Figure 8)."""
    figure = Figure((11, 4.8), layout="constrained")
    for k, (xi, mean_m) in enumerate(maps.items(), start=1):
        axes = figure.add_subplot(1, len(maps), k)
        shown = axes.imshow(mean_m, origin="lower", cmap="viridis", vmin=-0.2, vmax=2.1)
        figure.colorbar(shown, ax=axes, label="mean of the segment, m")
        axes.set(title=f"segments, xi = {xi:g}", xlabel="cell", ylabel="cell")
    figure.savefig(file, dpi=DPI)
    return file


def hazards(file: Path, dem_m: F64, grid: Grid, found: tuple[Hazard, ...]) -> Path:
    """Draw the DEM of the whole pit with the reported hazards."""
    figure = Figure((8.5, 7.5), layout="constrained")
    axes = figure.add_subplot(1, 1, 1)
    shown = axes.imshow(dem_m, origin="lower", extent=_extent(grid), cmap="RdBu_r", vmin=-1, vmax=1)
    figure.colorbar(shown, ax=axes, label="height over the ground around, m")
    for hazard in found:
        west, south, east, north = hazard.extent_m
        axes.plot([west, east, east, west, west], [south, south, north, north, south], "k", linewidth=0.7)
    axes.set(
        title=f"{len(found)} hazards", xlabel="east, m", ylabel="north, m", xlim=(-27, 27), ylim=(-27, 27)
    )
    figure.savefig(file, dpi=DPI)
    return file


def _extent(grid: Grid) -> tuple[float, float, float, float]:
    east, north = grid.west_m + grid.cols * grid.cell_m, grid.south_m + grid.rows * grid.cell_m
    return grid.west_m, east, grid.south_m, north
