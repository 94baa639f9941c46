"""Slope and roughness by central differences on known surfaces (SLZ paper, Eq. (6) to (9))."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.arctangent import arctangent
from slz.kernels.jit import kernel
from slz.kernels.paper.gradient import gradient_slope_deg
from slz.kernels.simd import LANES, load, store

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], Floats]
SIDE_M = 16.0


def places(cell_m: float) -> tuple[Floats, Floats]:
    """East and north of every cell of a map; the places of a coarse map are among those of a finer one."""
    steps = np.arange(round(SIDE_M / cell_m) + 1) * cell_m
    east, north = np.meshgrid(steps, steps)
    return east, north


def slope_of(surface: Surface, cell_m: float) -> Floats:
    return gradient_slope_deg(surface(*places(cell_m)).astype(np.float32), cell_m).astype(np.float64)


def errors(
    surface: Surface, exact_deg: Surface, where: Callable[[Floats, Floats], NDArray[np.bool_]]
) -> Floats:
    """Largest error at the same places for cells of 0.5, 0.25 and 0.125 m."""
    found = []
    for cell_m, every in ((0.5, 1), (0.25, 2), (0.125, 4)):
        east, north = (a[::every, ::every] for a in places(cell_m))
        error = np.abs(slope_of(surface, cell_m)[::every, ::every] - exact_deg(east, north))
        found.append(error[where(east, north)].max())
    return np.array(found)


def second_order(error: Floats) -> None:
    assert error[0] > 0.05  # far above the rounding of float32
    np.testing.assert_allclose(error[:-1] / error[1:], 4.0, rtol=0.15)


@pytest.mark.parametrize("cell_m", [0.2, 1.0, 2.5])
@pytest.mark.parametrize("slope_deg", [0.0, 1.0, 4.0, 10.0, 39.0, 70.0])
@pytest.mark.parametrize("aspect_deg", [0, 30, 45, 90, 200, 315])
def test_a_plane_has_its_slope_everywhere_and_no_roughness(
    slope_deg: float, aspect_deg: float, cell_m: float
) -> None:
    east, north = np.meshgrid(np.arange(9) * cell_m, np.arange(7) * cell_m)
    aspect = np.radians(aspect_deg)
    height = np.tan(np.radians(slope_deg)) * (np.sin(aspect) * east + np.cos(aspect) * north)
    slope = gradient_slope_deg(height.astype(np.float32), cell_m)
    np.testing.assert_allclose(slope[1:-1, 1:-1], slope_deg, atol=2e-4)
    roughness = gradient_slope_deg(slope, cell_m)
    np.testing.assert_allclose(roughness[2:-2, 2:-2], 0, atol=0.05)


def test_the_edge_of_the_map_has_no_slope_and_the_next_ring_no_roughness() -> None:
    slope = gradient_slope_deg(np.zeros((6, 8), np.float32), 1.0)
    roughness = gradient_slope_deg(slope, 1.0)
    for layer, ring in ((slope, 1), (roughness, 2)):
        expected = np.zeros((6, 8), bool)
        expected[ring:-ring, ring:-ring] = True
        np.testing.assert_array_equal(np.isfinite(layer), expected)


def test_a_cone_is_met_to_second_order_away_from_its_tip() -> None:
    def cone(east: Floats, north: Floats) -> Floats:
        return 1.2 * np.hypot(east - 8, north - 8)

    def ring(east: Floats, north: Floats) -> NDArray[np.bool_]:
        r = np.hypot(east - 8, north - 8)
        return (r > 1.6) & (r < 7)

    second_order(errors(cone, lambda e, n: np.full(e.shape, np.degrees(np.arctan(1.2))), ring))


def wave(east: Floats, north: Floats) -> Floats:
    return 0.8 * np.sin(0.9 * east + 0.5 * north)


def test_a_wave_is_met_to_second_order() -> None:
    def exact(east: Floats, north: Floats) -> Floats:
        along = 0.8 * np.hypot(0.9, 0.5) * np.cos(0.9 * east + 0.5 * north)
        return np.degrees(np.arctan(np.abs(along)))

    def inner(east: Floats, north: Floats) -> NDArray[np.bool_]:
        return (np.minimum(east, north) > 0.6) & (np.maximum(east, north) < 15.4)

    second_order(errors(wave, exact, inner))


def test_the_roughness_of_a_bowl_is_the_gradient_of_its_slope() -> None:
    """z = 0.05 r^2: the slope is atan(0.1 r), its gradient 0.1/(1 + 0.01 r^2) radians per metre, outwards."""
    found = []
    for cell_m, every in ((0.5, 1), (0.25, 2), (0.125, 4)):
        east, north = places(cell_m)
        r2 = (east - 8) ** 2 + (north - 8) ** 2
        slope = gradient_slope_deg((0.05 * r2).astype(np.float32), cell_m)
        roughness = gradient_slope_deg(slope, cell_m)
        exact = np.degrees(np.arctan(np.degrees(0.1 / (1 + 0.01 * r2))))
        ring = (r2 > 9) & (r2 < 36)
        found.append(np.abs(roughness - exact)[::every, ::every][ring[::every, ::every]].max())
    assert found[0] < 0.1
    assert found[2] < found[1] < found[0]


@pytest.mark.parametrize("seed", range(4))
def test_an_unknown_cell_or_neighbour_leaves_the_slope_unknown(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height = rng.normal(0, 1, (12, 15)).astype(np.float32)
    height[rng.random(height.shape) < 0.15] = np.nan
    slope = gradient_slope_deg(height, 0.5)
    for row in range(12):
        for col in range(15):
            if not (0 < row < 11 and 0 < col < 14):
                assert np.isnan(slope[row, col])
                continue
            h, k = height.astype(np.float64), (row, col)
            dx, dy = h[row, col + 1] - h[row, col - 1], h[row + 1, col] - h[row - 1, col]
            expected = np.degrees(np.arctan(np.hypot(dx, dy))) if np.isfinite(h[k]) else np.nan
            np.testing.assert_allclose(slope[k], expected, atol=1e-3)


@kernel("void(float32[::1], float32[::1])")
def arctangents(x: Floats, out: Floats) -> None:
    for i in range(0, len(x), LANES):
        store(out, i, arctangent(load(x, i)))


def test_the_arc_tangent_is_numpy_s_to_the_last_bits_of_single_precision() -> None:
    x = np.concatenate([[0.0, np.nan], np.geomspace(1e-6, 1e6, 4014)]).astype(np.float32)
    ours = np.empty(len(x), np.float32)
    arctangents(x, ours)
    np.testing.assert_allclose(ours, np.arctan(x.astype(np.float64)), rtol=2.5e-7, atol=0)
