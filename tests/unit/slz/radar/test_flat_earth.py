"""Flat-Earth phase removal, against trigonometry of the track."""

from __future__ import annotations

import numpy as np
import pytest

from slz.radar.interferogram import interferogram
from slz.radar.interferometer import Interferometer
from slz.radar.line_buffer import RadarLines

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
