"""Slope errors on noisy inclined planes, for the sources' gradient and for the plane fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import params
from companion.desk.reproduce.survey_recording import FRAME
from slz import Pipeline, Window

SLOPES_DEG = (0.0, 5.0, 10.0, 15.0, 20.0)
HALF_M = 20.0


@dataclass(frozen=True, slots=True)
class SlopeError:
    """RMS error of the slope over the cells that have one, and the share of such cells."""

    slope_deg: float
    gradient_rms_deg: float
    gradient_share: float
    plane_rms_deg: float
    plane_share: float


def slope_errors(
    density_per_m2: float = 20.0, noise_m: float = 0.02, cell_m: float = 0.2, seed: int = 1
) -> list[SlopeError]:
    """Return the errors of both methods on planes of known slope."""
    found = []
    for slope in SLOPES_DEG:
        cloud = _plane(slope, density_per_m2, noise_m, seed)
        gradient = _slopes(
            cloud, [f"cell_m={cell_m}", "mode=source", "worst_slope_deg=89", "safe_slope_deg=45"]
        )
        plane = _slopes(cloud, [f"cell_m={cell_m}", "worst_slope_deg=89", "safe_slope_deg=45", "relief_m=5"])
        found.append(SlopeError(slope, *_rms(gradient, slope), *_rms(plane, slope)))
    return found


def _plane(slope_deg: float, density_per_m2: float, noise_m: float, seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    n = round(density_per_m2 * (2 * HALF_M) ** 2)
    xy = rng.uniform(-HALF_M, HALF_M, (n, 2))
    return np.column_stack([xy, np.tan(np.radians(slope_deg)) * xy[:, 0] + rng.normal(0, noise_m, n)])


def _slopes(cloud: NDArray[np.float64], settings: list[str]) -> NDArray[np.float32]:
    own = [f"zone_m={4 * HALF_M:g}", "min_boundary_points=1", *settings]
    pipeline = Pipeline(params.load("quadcopter", own), (0.0, 0.0))
    pipeline.process(Window(cloud, np.zeros(len(cloud), np.int64), np.full(3, np.nan), FRAME, 0, 0))
    maps = pipeline.maps()
    if maps is None:
        raise RuntimeError("no map of a plane")
    rows, cols = np.mgrid[maps.box.row0 : maps.box.row1, maps.box.col0 : maps.box.col1]
    east = maps.grid.west_m + (cols + 0.5) * maps.grid.cell_m
    north = maps.grid.south_m + (rows + 0.5) * maps.grid.cell_m
    inner = (np.abs(east) < HALF_M - 2) & (np.abs(north) < HALF_M - 2)
    return np.asarray(maps.slope_deg[inner])


def _rms(slope_deg: NDArray[np.float32], truth_deg: float) -> tuple[float, float]:
    known = np.isfinite(slope_deg)
    error = slope_deg[known] - truth_deg
    return float(np.sqrt(np.mean(error**2))) if known.any() else float("nan"), float(known.mean())
