"""Slope and roughness by central differences on known surfaces (SLZ paper, Eq. (6) to (9))."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.grid import Grid
from slz.kernels.argument_types import Array1D
from slz.kernels.elementary_functions import arctangent
from slz.kernels.jit import kernel
from slz.kernels.simd import LANES, load, store
from slz.paper.paper_terrain import PaperTerrain

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], Floats]
SIDE_M = 16.0


def places(cell_m: float) -> tuple[Floats, Floats]:
    """East and north of every cell of a map; the places of a coarse map are among those of a finer one."""
    steps = np.arange(round(SIDE_M / cell_m) + 1) * cell_m
    east, north = np.meshgrid(steps, steps)
    return east, north


def maps_of(height_m: Floats, cell_m: float) -> tuple[Floats, Floats]:
    """Return slope and roughness of a surface with one return in the middle of every cell."""
    rows, cols = height_m.shape
    own = ["mode=source", "fusing=mean", f"cell_m={cell_m}", "worst_slope_deg=89", "safe_slope_deg=4"]
    terrain = PaperTerrain(Grid(0.0, 0.0, cell_m, rows, cols), params.load("quadcopter", own))
    north, east = (np.mgrid[:rows, :cols] + 0.5) * cell_m
    terrain.add(np.column_stack([east.ravel(), north.ravel(), height_m.ravel()]))
    everything = terrain.grid.everything
    return tuple(terrain.layer(name, everything).astype(np.float64) for name in ("slope_deg", "roughness"))


def slope_of(surface: Surface, cell_m: float) -> Floats:
    return maps_of(surface(*places(cell_m)), cell_m)[0]


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
    slope, roughness = maps_of(height, cell_m)
    np.testing.assert_allclose(slope[1:-1, 1:-1], slope_deg, atol=2e-3)
    np.testing.assert_allclose(roughness[2:-2, 2:-2], 0, atol=0.05)


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
        _, roughness = maps_of(0.05 * r2, cell_m)
        exact = np.degrees(np.arctan(np.degrees(0.1 / (1 + 0.01 * r2))))
        ring = (r2 > 9) & (r2 < 36)
        found.append(np.abs(roughness - exact)[::every, ::every][ring[::every, ::every]].max())
    assert found[0] < 0.1
    assert found[2] < found[1] < found[0]


@kernel
def arctangents(x: Array1D[np.float32], out: Array1D[np.float32]) -> None:
    for i in range(0, len(x), LANES):
        store(out, i, arctangent(load(x, i)))


def test_the_arc_tangent_is_numpy_s_to_the_last_bits_of_single_precision() -> None:
    x = np.concatenate([[0.0, np.nan], np.geomspace(1e-6, 1e6, 4014)]).astype(np.float32)
    ours = np.empty(len(x), np.float32)
    arctangents(x, ours)
    np.testing.assert_allclose(ours, np.arctan(x.astype(np.float64)), rtol=2.5e-7, atol=0)
