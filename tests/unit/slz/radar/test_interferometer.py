"""Geometry and accuracy of the interferometer, against trigonometry, differences and random samples."""

from __future__ import annotations

import numpy as np
import pytest

from slz.radar.accuracy import coherence, height_error_m, phase_error_rad, whole_height_error_m
from slz.radar.interferometer import Interferometer

LOOKS = np.radians(np.arange(30.0, 61.0, 5.0))
H_M = 75.0


@pytest.mark.parametrize("tilt_deg", [0.0, 45.0, 90.0, -30.0])
@pytest.mark.parametrize("both", [True, False])
def test_height_comes_back_from_the_distances_to_two_antennas(tilt_deg: float, both: bool) -> None:
    radar = Interferometer(tilt_deg=tilt_deg, both_transmit=both)
    x, z = np.array([50.0, 70.0, 110.0]), np.array([-2.0, 0.7, 5.0])
    first = np.hypot(x, H_M - z)
    tilt = radar.tilt_rad
    second = np.hypot(x - 0.5 * np.cos(tilt), H_M + 0.5 * np.sin(tilt) - z)
    phase = (4 if both else 2) * np.pi / radar.wavelength_m * (first - second)
    assert np.allclose(radar.phase_rad(first, np.arctan2(x, H_M - z)), phase, atol=1e-6)
    assert np.allclose(radar.height_m(H_M, first, phase), z, atol=1e-6)


def test_equation_1_as_printed_holds_for_a_tilt_counted_downwards_only() -> None:
    look, b = np.radians(40.0), 0.5
    for tilt_deg, holds in ((0.0, True), (45.0, False)):
        radar = Interferometer(tilt_deg=tilt_deg)
        r = H_M / np.cos(look)
        far = r - radar.phase_rad(np.array(r), np.array(look)) * radar.wavelength_m / (4 * np.pi)
        s = (r**2 + b**2 - far**2) / (2 * r * b)
        printed = H_M - r * np.cos(radar.tilt_rad) * np.sqrt(1 - s**2) - r * np.sin(radar.tilt_rad) * s
        assert (abs(printed) < 1e-6) == holds
        downwards = H_M - r * np.cos(-radar.tilt_rad) * np.sqrt(1 - s**2) - r * np.sin(-radar.tilt_rad) * s
        assert abs(downwards) < 1e-6


@pytest.mark.parametrize("tilt_deg", [0.0, 45.0, 90.0])
def test_metres_per_radian_is_the_derivative_of_the_height(tilt_deg: float) -> None:
    """To half a percent: Eq. (3) takes the two rays as parallel."""
    radar = Interferometer(tilt_deg=tilt_deg)
    r = H_M / np.cos(LOOKS)
    phase = radar.phase_rad(r, LOOKS)
    step = (radar.height_m(H_M, r, phase + 1e-4) - radar.height_m(H_M, r, phase - 1e-4)) / 2e-4
    assert np.allclose(np.abs(radar.metres_per_radian(r, LOOKS)), np.abs(step), rtol=6e-3)


def test_figure_2_gives_6_to_10_cm_for_a_vertical_baseline_of_half_a_metre() -> None:
    errors = [height_error_m(Interferometer(baseline_m=b), H_M, LOOKS) for b in np.arange(0.48, 0.5701, 0.01)]
    assert 0.055 < np.min(errors) < 0.065
    assert 0.09 < np.max(errors) < 0.11
    assert np.median(errors) == pytest.approx(0.072, abs=0.005)


def test_a_baseline_that_is_too_long_has_no_coherence_and_no_height() -> None:
    radar = Interferometer(baseline_m=2.0)
    assert coherence(radar, H_M, np.radians(30.0)) == 0.0
    assert np.isinf(height_error_m(radar, H_M, np.radians(30.0)))


@pytest.mark.parametrize(("gamma", "looks"), [(0.6, 64), (0.8, 32), (0.95, 16)])
def test_equation_3_is_what_dice_give_where_looks_are_many(gamma: float, looks: int) -> None:
    rng = np.random.default_rng(1)
    dice = (rng.normal(size=(2, 6_000, looks, 2)) @ np.array([1, 1j])) / np.sqrt(2)
    first = dice[0]
    second = gamma * dice[0] + np.sqrt(1 - gamma**2) * dice[1]
    phase = np.angle((first * second.conj()).sum(axis=1))
    assert phase.std() == pytest.approx(float(phase_error_rad(gamma, looks)), rel=0.1)


def test_equation_2_adds_squares() -> None:
    assert whole_height_error_m(0.03, 0.04, 0.0, 0.12) == pytest.approx(0.13)


@pytest.mark.parametrize(
    "wrong", [{"baseline_m": 0.0}, {"frequency_hz": -1.0}, {"range_m": np.nan}, {"looks": 0}]
)
def test_impossible_radars_are_refused_by_name(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Interferometer(**wrong)  # type: ignore[arg-type]
