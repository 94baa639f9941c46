"""Simulated flash LiDAR: contents of its raw frames, read independently of the processing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors.flash import FlashLidar, FocalPlane, RawFrame
from sitl.sensors.lidar_mount import Mount
from sitl.world.primitives import Kind
from tests.unit.sitl.still_world import flat_world

F64 = NDArray[np.float64]
LEVEL: F64 = np.array([1.0, 0.0, 0.0, 0.0])
DOWN = Mount((0.0, 0.0, 0.0), 0.0, 90.0, 0.0)


def plane(**more: object) -> FocalPlane:
    settings: dict[str, object] = {"rows": 24, "cols": 24, "dead": 0.0, "false_trigger": 0.0}
    return FocalPlane(**(settings | more))  # type: ignore[arg-type]


def look(height_m: float, seed: int = 1, **more: object) -> RawFrame:
    lidar = FlashLidar(np.random.default_rng(seed), plane(**more), mount=DOWN)
    return lidar.flash(np.array([0.0, 0.0, height_m]), LEVEL, flat_world(kind=Kind.SOIL))


def in_order(frame: RawFrame) -> F64:
    """Turn every ring until its marker is last."""
    n = frame.samples.shape[2]
    at = np.argmin(frame.samples, axis=2)
    index = (at[..., np.newaxis] + 1 + np.arange(n)) % n
    return np.take_along_axis(frame.samples, index, axis=2).astype(float)


def test_every_ring_has_one_marker_at_any_place() -> None:
    frame = look(250.0)
    assert ((frame.samples == 0).sum(axis=2) == 1).all()
    assert len(np.unique(np.argmin(frame.samples, axis=2))) == 20


def test_counter_and_place_of_the_maximum_tell_the_range() -> None:
    frame = look(250.0, noise_counts=1.0)
    peak = np.argmax(in_order(frame)[..., :-1], axis=2)
    range_m = (frame.counter.astype(int) - 19 + peak) * 2.4 * 0.299792458 / 2
    assert np.abs(range_m - 250.0).max() < 0.36  # one sample is 36 cm


def test_noise_is_as_told_and_the_pulse_as_wide() -> None:
    rings = in_order(look(250.0, noise_counts=60.0))
    assert rings[..., :2].std() == pytest.approx(60.0, rel=0.15)
    mean = in_order(look(250.0, noise_counts=1.0)).mean(axis=(0, 1))[:-1] - 300.0
    above = np.interp([0.5], [0, 1], [0, 1])[0] * mean.max()
    assert (mean > above).sum() * 2.4 == pytest.approx(10.0, abs=2.5)


def test_intensity_falls_with_the_square_of_range_and_with_reflectance() -> None:
    def high(height_m: float, kind: Kind) -> float:
        lidar = FlashLidar(np.random.default_rng(1), plane(), mount=DOWN)
        _, heights = lidar.echoes(np.array([0.0, 0.0, height_m]), LEVEL, flat_world(kind=kind))
        return float(heights.sum(axis=2).mean())

    assert high(200.0, Kind.SOIL) / high(400.0, Kind.SOIL) == pytest.approx(4.0, rel=0.01)
    assert high(200.0, Kind.GRASS) / high(200.0, Kind.ASPHALT) == pytest.approx(0.5 / 0.13, rel=0.01)


def test_near_ground_saturates_and_far_ground_is_missed() -> None:
    assert (look(60.0).samples == 4095).any(axis=2).all()
    far = look(700.0)
    assert 0.2 < (far.counter == 4000).mean() < 1.0
    assert (look(1390.0).counter == 4000).mean() > 0.98


def test_water_and_dead_pixels_never_trigger() -> None:
    lidar = FlashLidar(np.random.default_rng(1), plane(), mount=DOWN)
    frame = lidar.flash(np.array([0.0, 0.0, 250.0]), LEVEL, flat_world(kind=Kind.WATER))
    assert (frame.counter == 4000).all()
    dead = FlashLidar(np.random.default_rng(1), plane(dead=0.3), mount=DOWN)
    first = dead.flash(np.array([0.0, 0.0, 250.0]), LEVEL, flat_world(kind=Kind.SOIL))
    again = dead.flash(np.array([0.0, 0.0, 240.0]), LEVEL, flat_world(kind=Kind.SOIL))
    assert np.array_equal(first.counter == 4000, again.counter == 4000)
    assert (first.counter == 4000).mean() == pytest.approx(0.3, abs=0.06)


def test_same_seed_gives_the_same_frame() -> None:
    assert np.array_equal(look(250.0, 7).samples, look(250.0, 7).samples)
    assert not np.array_equal(look(250.0, 7).samples, look(250.0, 8).samples)
