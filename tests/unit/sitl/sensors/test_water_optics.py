"""Light on water against closed forms: reflection, absorption, and returns over incidence and wind."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate

from sitl.sensors import water_optics
from sitl.sensors.mid360 import REACH

DEG = np.pi / 180


def test_fresnel_is_that_of_the_textbook() -> None:
    """E. Hecht, Optics, 4.6: at normal incidence ((n - 1) / (n + 1))^2; at 60 degrees by Snell's angle."""
    assert water_optics.fresnel(np.array([1.0]), 1.5)[0] == pytest.approx(0.04)
    upright, slanted = water_optics.fresnel(np.array([1.0, 0.5]))
    assert upright == pytest.approx((0.328 / 2.328) ** 2)
    inner = np.arcsin(np.sin(60 * DEG) / 1.328)
    across = np.sin(60 * DEG - inner) ** 2 / np.sin(60 * DEG + inner) ** 2
    along = np.tan(60 * DEG - inner) ** 2 / np.tan(60 * DEG + inner) ** 2
    assert slanted == pytest.approx((across + along) / 2)
    assert slanted == pytest.approx(0.0588, abs=0.0005)


def test_light_along_the_surface_is_reflected_and_none_at_brewsters_angle_along() -> None:
    assert water_optics.fresnel(np.array([1e-9]))[0] == pytest.approx(1.0, abs=1e-6)
    brewster = np.cos(np.arctan(1.328))
    across = ((1.0 - 1.328**2) / (1.0 + 1.328**2)) ** 2
    assert water_optics.fresnel(np.array([brewster]))[0] == pytest.approx(across / 2)


def test_the_slopes_of_all_facets_are_one_distribution() -> None:
    """Brightness, put back to the density of slopes, integrates to one over all slopes."""
    for square_slope in (0.0005, 0.013, 0.044):

        def density(tan: float, s: float = square_slope) -> float:
            cosine = np.array([1.0 / np.hypot(1.0, tan)])
            bright = water_optics.surface_brightness(cosine, s)[0]
            upright = water_optics.fresnel(np.ones(1))[0]
            return float(4.0 * cosine[0] ** 5 * bright / (np.pi * upright) * 2 * np.pi * tan)

        total, _ = integrate.quad(density, 0.0, 12.0 * np.sqrt(square_slope))
        assert total == pytest.approx(1.0, rel=1e-6)


def test_a_bottom_fades_by_the_law_of_absorption_and_seems_a_third_deeper() -> None:
    one, two = water_optics.bottom_brightness(np.ones(2), np.array([0.1, 0.3]), np.full(2, 0.3), 7.0)
    assert two / one == pytest.approx(np.exp(-2 * 7.0 * 0.2))
    assert one < 0.3 * np.exp(-1.4)
    assert water_optics.bottom_range(np.array([20.0]), np.ones(1), np.array([0.1]))[0] == pytest.approx(
        20.133
    )
    slant = np.cos(40 * DEG)
    inside = np.cos(np.arcsin(np.sin(40 * DEG) / 1.328))
    far = water_optics.bottom_range(np.array([20.0]), np.array([slant]), np.array([0.3]))[0]
    assert far == pytest.approx(20.0 + 1.33 * 0.3 / inside)


@pytest.mark.parametrize(("height_m", "wind_ms"), [(10.0, 2.0), (20.0, 8.0), (40.0, 3.0)])
def test_water_is_bright_below_and_beyond_reach_aside(height_m: float, wind_ms: float) -> None:
    angles = np.radians([0.0, 5.0, 10.0, 15.0, 25.0, 35.0])
    bright = water_optics.surface_brightness(np.cos(angles), 0.003 + 0.00512 * wind_ms)
    limit = 40.0 * np.sqrt(bright / 0.1)  # power over the square of the range, from 10 % at 40 m
    assert (np.diff(bright) < 0).all()
    assert limit[0] > height_m
    assert (limit[-2:] < height_m).all()


@pytest.mark.parametrize("bright", [0.001, 0.01, 0.05])
def test_the_reach_of_faint_echoes_follows_the_square_root(bright: float) -> None:
    limit_m = REACH.limit_m(REACH.faint(np.array([bright])))
    assert limit_m[0] == pytest.approx(40.0 * np.sqrt(bright / 0.1))
