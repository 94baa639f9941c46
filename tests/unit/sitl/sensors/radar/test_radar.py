"""Simulated radar: backscatter by surface, and contents of its images."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors.radar import SideLooker, Track
from sitl.sensors.radar.backscatter import sigma0
from sitl.world.primitives import Box, Ground, Kind
from sitl.world.world import World

F64 = NDArray[np.float64]
WAVE_M = 0.00857


def decibel(kind: Kind, incidence_deg: float) -> float:
    found = sigma0(np.array([kind], np.uint8), np.radians([incidence_deg]), WAVE_M)
    return float(10 * np.log10(found[0]))


def test_cross_sections_fall_with_incidence_and_lie_where_handbooks_have_them() -> None:
    for kind in (Kind.GRASS, Kind.SNOW, Kind.SAND, Kind.SOIL, Kind.CONCRETE):
        falling = [decibel(kind, angle) for angle in (20, 35, 50, 65)]
        assert falling == sorted(falling, reverse=True)
        assert -25 < decibel(kind, 45) < 5
    assert decibel(Kind.GRASS, 45) == pytest.approx(10 * np.log10(0.125 * (np.pi / 4 + 0.012) ** 1.5))
    assert decibel(Kind.SNOW, 45) > decibel(Kind.GRASS, 45) > decibel(Kind.WATER, 45) + 25


def flat(kind: Kind = Kind.GRASS, solids: tuple[Box, ...] = ()) -> World:
    ground = Ground(-200.0, -200.0, 4.0, np.zeros((101, 101)), np.full((100, 100), kind, np.uint8))
    return World(ground, solids)


def images(ground: World, lines: int = 12, seed: int = 1, **more: float) -> tuple[NDArray[np.complex64], F64]:
    north = (np.arange(lines) - lines / 2) * 0.8
    track = Track(np.column_stack([np.full(lines, -85.0), north, np.full(lines, 75.0)]), 0.0, np.zeros(lines))
    raw = SideLooker(np.random.default_rng(seed), **more).fly(track, ground)  # type: ignore[arg-type]
    return raw.samples, raw.first_m + raw.step_m * np.arange(raw.samples.shape[3])


def test_speckle_is_exponential_in_power_and_uniform_in_phase() -> None:
    samples, ranges = images(flat())
    middle = samples[:, :, 0, (ranges > 100) & (ranges < 112)]
    power = np.abs(middle) ** 2
    assert power.std() / power.mean() == pytest.approx(1.0, abs=0.1)
    assert abs(np.exp(1j * np.angle(middle)).mean()) < 0.05


def test_signal_to_noise_of_grass_at_45_degrees_is_as_told_and_water_leaves_noise() -> None:
    samples, ranges = images(flat(), snr_db=13.0)
    dry = (np.abs(samples[..., np.abs(ranges - 106.0) < 4]) ** 2).mean()
    wet_samples, _ = images(flat(Kind.WATER), snr_db=13.0)
    wet = (np.abs(wet_samples[..., np.abs(ranges - 106.0) < 4]) ** 2).mean()
    assert 10 * np.log10(dry / wet - 1) == pytest.approx(13.0, abs=0.7)


def test_a_wall_throws_a_shadow_behind_it() -> None:
    wall = Box(-15.0, 0.0, 0.0, 1.0, 20.0, 6.0)  # 70 m from the track
    samples, ranges = images(flat(solids=(wall,)))
    power = (np.abs(samples[:, :, 0]) ** 2).mean(axis=(0, 1))
    behind = (ranges > 103.5) & (ranges < 106.0)  # from 102.6 m on, till the ray over its top comes down
    assert power[behind].mean() < 0.15 * power[(ranges > 112) & (ranges < 120)].mean()


def test_looks_are_independent_and_the_same_seed_gives_the_same_images() -> None:
    samples, ranges = images(flat())
    one, two = (samples[:, k, 0, (ranges > 95) & (ranges < 120)] for k in (0, 1))
    alike = abs((one * two.conj()).mean()) / np.sqrt((abs(one) ** 2).mean() * (abs(two) ** 2).mean())
    assert alike < 0.1
    assert np.array_equal(images(flat(), 3)[0], images(flat(), 3)[0])
