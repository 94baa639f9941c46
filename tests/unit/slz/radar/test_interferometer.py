"""Geometry and accuracy of the interferometer, against trigonometry, differences and random samples."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.instruments.phase_unwrapping import unwrap_by_quality
from slz.radar.heights import coherence, height_error_m, phase_error_rad, whole_height_error_m
from slz.radar.interferogram import RadarLines, interferogram
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


# Flat-Earth phase removal, against trigonometry of the track.


RADAR = Interferometer()
FIRST_M, STEP_M, BINS = 70.0, 0.5, 100
UP_M, ROLL = np.array([74.0, 76.0, 75.0]), np.radians([0.0, 2.0, -1.0])


def flat_phase(ranges_m: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """Differences of two distances: from each antenna to level ground at a range from the first."""
    across = np.sqrt(np.maximum(ranges_m**2 - UP_M[:, np.newaxis] ** 2, 0.0))
    tilt = (RADAR.tilt_rad + ROLL)[:, np.newaxis]
    b = RADAR.baseline_m
    second = np.hypot(across - b * np.cos(tilt), UP_M[:, np.newaxis] + b * np.sin(tilt))
    return np.asarray(RADAR.phase_rad_m * (ranges_m - second))


def observed() -> RadarLines:
    ranges_m = FIRST_M + STEP_M * np.arange(BINS)
    speckle = np.exp(2j * np.pi * np.random.default_rng(1).random((3, RADAR.looks, BINS)))
    second = speckle * np.exp(-1j * flat_phase(ranges_m))[:, np.newaxis]
    samples = np.stack([speckle, second], axis=2).astype(np.complex64)
    position = np.column_stack([np.zeros(3), np.arange(3.0), UP_M])
    return RadarLines(samples, FIRST_M, STEP_M, position, 0.0, ROLL)


def test_the_phase_of_level_ground_is_its_geometry_and_nothing_is_left_of_it() -> None:
    lines = observed()
    image = interferogram(lines, RADAR, common_band=False)
    lit = lines.ranges_m > UP_M[:, np.newaxis]
    assert image.flat_rad[lit] == pytest.approx(flat_phase(lines.ranges_m)[lit], abs=1e-5)
    assert (image.coherence[~lit] == 0).all()
    assert (~lit).any()


def test_lines_of_another_number_of_looks_are_refused_with_both_numbers() -> None:
    lines, other = observed(), Interferometer(looks=RADAR.looks + 3)
    with pytest.raises(
        ValueError, match=f"{RADAR.looks} looks, but the interferometer has {RADAR.looks + 3}"
    ):
        interferogram(lines, other)


# Phase unwrapping along the best paths.


F64 = NDArray[np.float64]


def wrapped(phase: F64) -> F64:
    return np.asarray(np.angle(np.exp(1j * phase)))


def hills(seed: int) -> F64:
    y, x = np.mgrid[:60, :80] / 10.0
    a, b, c = np.random.default_rng(seed).uniform(3, 6, 3)
    return np.asarray(a * np.sin(x) + b * np.cos(0.7 * y) + c * x)


def test_smooth_phase_comes_back_whole_but_for_one_number_of_turns() -> None:
    for seed in range(5):
        true = hills(seed)
        found, region = unwrap_by_quality(wrapped(true), np.ones(true.shape), 0.5)
        turns = (found - true) / (2 * np.pi)
        assert np.ptp(turns) < 1e-9
        assert abs(turns[0, 0] - round(turns[0, 0])) < 1e-9
        assert (region == 1).all()


def test_one_line_is_as_numpy_unwraps_it() -> None:
    true = np.cumsum(np.random.default_rng(2).uniform(-2.5, 2.5, 300))
    found, _ = unwrap_by_quality(wrapped(true)[np.newaxis], np.ones((1, 300)), 0.5)
    theirs = np.unwrap(wrapped(true))
    assert np.allclose(found[0] - found[0, 0], theirs - theirs[0])


def test_a_patch_of_noise_spoils_nothing_around_it() -> None:
    true = hills(1)
    phase, quality = wrapped(true), np.full(true.shape, 0.95)
    phase[20:40, 30:50] = np.random.default_rng(3).uniform(-np.pi, np.pi, (20, 20))
    quality[20:40, 30:50] = 0.85
    found, _ = unwrap_by_quality(phase, quality, 0.5)
    outside = np.ones(true.shape, bool)
    outside[20:40, 30:50] = False
    assert np.ptp((found - true)[outside]) < 1e-9


def test_islands_are_regions_of_their_own_and_the_sea_is_unknown() -> None:
    quality = np.full((30, 30), 0.9)
    quality[:, 14:17] = 0.1
    quality[5, 5] = np.nan
    found, region = unwrap_by_quality(np.zeros((30, 30)), quality, 0.5)
    assert set(np.unique(region)) == {0, 1, 2}
    assert np.isnan(found[:, 14:17]).all()
    assert np.isnan(found[5, 5])
    assert region[0, 0] != region[0, 29]
