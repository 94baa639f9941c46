"""Small flights over given ground, and small cases, without the ray caster."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from companion.desk.open_benchmark.benchmark_case import BenchmarkCase
from companion.desk.open_benchmark.footprint_truth import SceneTruth
from companion.desk.open_benchmark.frozen_scenes import ORIGIN
from companion.desk.open_benchmark.landing_task import F64, U8, CellGrid, FlownReturns, LandingTask

SMALL = LandingTask(CellGrid(-5.0, -5.0, 0.2, 50, 50))
Height = Callable[[F64, F64], F64]


def flight(height: Height, per_m2: int = 40, noise_m: float = 0.005, half_m: float = 5.0) -> FlownReturns:
    """Return the returns of five windows over a square of ground."""
    rng = np.random.default_rng(4)
    n = round(per_m2 * (2 * half_m) ** 2 / 5) * 5
    x, y = rng.uniform(-half_m, half_m, (2, n))
    z = height(x, y) + rng.normal(0, noise_m, n)
    window = np.repeat(np.arange(5), n // 5)
    stamps = window + np.tile(np.linspace(0, 0.9, n // 5), 5)
    sensors = np.column_stack([np.linspace(-2, 2, 5), np.zeros(5), np.full(5, 20.0)])
    return FlownReturns(np.column_stack([x, y, z]).round(3), stamps, window, sensors)


def case_of(safe: U8, kinds: tuple[str, ...] = ("rock", "wall")) -> BenchmarkCase:
    """Return a case with a given truth on cells of 0.5 m; unsafe cells are rocks in the west, else walls."""
    rows, cols = safe.shape
    grid = CellGrid(-cols / 4, -rows / 4, 0.5, rows, cols)
    kind = np.where(safe == 0, (grid.centres()[0] > 0).astype(np.uint8), 255).astype(np.uint8)
    nothing = np.zeros(safe.shape)
    truth = SceneTruth(safe, kind, kinds, nothing, nothing)
    returns = flight(lambda x, y: 0 * x, per_m2=2)
    return BenchmarkCase("small", ORIGIN, LandingTask(grid), truth, {"2": returns}, {"made": "by a test"})
