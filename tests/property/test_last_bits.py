"""What differs in the last bit between processors changes no verdict but at a limit.

Kernels round alike everywhere: none is contracted to fused operations by the compiler. The C library's
functions and NumPy's vectorised ones do not (docs/benchmark/arm.md); they place returns. So returns are moved
here by more than such a difference. No return crosses the edge of a cell.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from slz import SAFE, Pipeline, TerrainMaps, Window
from slz.kernels.footprint.plane_fit import SIGMAS
from tests.property.test_pipeline_invariance import FRAME, PARAMETERS, SENSOR, scene

Floats = NDArray[np.float64]

MOVED_M = 1e-8
"""Seven times the most measured between aarch64 and x86-64; the last bit of the Earth's radius is 9e-10 m."""
HEIGHT_M, SLOPE_DEG, RELIEF_M = 1e-6, 1e-4, 1e-5
"""Most that such a move may change: heights are summed in single precision."""

seeds = st.integers(0, 10_000)
few = settings(max_examples=20, deadline=None)


def moved(points: Floats, seed: int, by_m: float) -> Floats:
    return points + np.random.default_rng(seed + 1).choice([-by_m, by_m], points.shape)


def maps_of(points: Floats) -> TerrainMaps:
    pipe = Pipeline(PARAMETERS, (0.0, 0.0))
    report = pipe.process(Window(points, np.zeros(len(points), np.int64), SENSOR, FRAME, 0, 0))
    maps = pipe.maps(report.grid.everything)
    assert maps is not None
    return maps


def is_at_a_limit(maps: TerrainMaps) -> NDArray[np.bool_]:
    steep = maps.slope_deg.astype(float) + float(SIGMAS) * maps.slope_sigma_deg
    is_steep = np.abs(steep - PARAMETERS.safe_slope_deg) < SLOPE_DEG
    return np.asarray(is_steep | (np.abs(maps.relief_m - PARAMETERS.relief_m) < RELIEF_M))


@few
@given(seeds)
def test_only_a_cell_at_a_limit_changes_its_verdict(seed: int) -> None:
    points = scene(seed)
    one, two = maps_of(points), maps_of(moved(points, seed, MOVED_M))
    changed = one.state != two.state
    assert not (changed & ~(is_at_a_limit(one) | is_at_a_limit(two))).any()
    for name, most in (("height_m", HEIGHT_M), ("slope_deg", SLOPE_DEG), ("relief_m", RELIEF_M)):
        np.testing.assert_allclose(two.layers[name], one.layers[name], rtol=0, atol=most, err_msg=name)


def test_a_larger_move_is_seen() -> None:
    points = scene(3)
    one, two = maps_of(points), maps_of(moved(points, 3, 0.02))
    assert np.nanmax(np.abs(one.slope_deg - two.slope_deg)) > SLOPE_DEG
    assert ((one.state == SAFE) != (two.state == SAFE)).any()
