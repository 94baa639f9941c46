"""Compilation or loading of every kernel before the first window."""

from __future__ import annotations

import numpy as np

from params import Parameters
from slz.frame import LocalFrame
from slz.kernels.jit import load_kernels
from slz.pipeline import Pipeline
from slz.window import Window


def warm_up(parameters: Parameters) -> None:
    """Load all kernels, run the pipeline on two windows of synthetic ground, and discard the result."""
    load_kernels(parameters.mode == "source")
    rng = np.random.default_rng(0)
    side = 12 * max(parameters.cell_m, parameters.footprint_m, parameters.min_square_m / 4)
    points = np.column_stack([rng.uniform(-side, side, (4000, 2)), rng.normal(0, 0.01, 4000)])
    points[:5, 2] += 3.0
    pipeline = Pipeline(parameters, (0.0, 0.0))
    for start in (0, 1_000_000_000):
        stamps = start + np.linspace(0, 0.9e9, len(points)).astype(np.int64)
        window = Window(
            points_enu_m=points,
            stamp_ns=stamps,
            sensor_enu_m=np.zeros(3),
            frame=LocalFrame(0.0, 0.0, 0.0),
            start_ns=int(stamps[0]),
            end_ns=int(stamps[-1]),
        )
        pipeline.process(window)
        pipeline.select(np.zeros(3))
        pipeline.maps()
