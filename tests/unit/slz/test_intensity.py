"""Intensities that tell nothing: absent, constant, saturated, negative, infinite."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import params
from slz import LocalFrame, Pipeline, PointAttributes, Scan, join

FRAME = LocalFrame(47.0, 8.0, 400.0)
MEADOW = np.full(20_000, np.nan, np.float32)


def safe_cells(intensity: np.ndarray[tuple[int, ...], np.dtype[np.float32]], weight: float = 1.0) -> int:
    """Return the number of safe cells of a meadow seen from three places, some rays of which are lost."""
    rng = np.random.default_rng(1)
    pipeline = Pipeline(params.load("quadcopter", ["zone_m=60", "min_boundary_points=10"]), (0.0, 0.0))
    none = np.zeros(len(intensity), np.uint8)
    for k in range(3):
        xy = rng.uniform(-12, 12, (len(intensity), 2))
        points = np.column_stack([xy, 0.02 * xy[:, 0] + rng.normal(0, 0.02, len(xy))])
        sensor = np.array([4.0 * k - 4, 0.0, 12.0])
        lost = np.column_stack([rng.uniform(-12, 12, (9, 2)), np.zeros(9)])
        weights = np.full(9, weight, np.float32)
        told = PointAttributes.of(intensity, none, none, lost, np.tile(sensor, (9, 1)), weights)
        stamps = k * 1_000_000_000 + np.linspace(0, 9e8, len(points)).astype(np.int64)
        pipeline.process(join([Scan(points, stamps, sensor, FRAME, attributes=told)]))
    maps = pipeline.maps(which="near")
    assert maps is not None
    return int((maps.state == 1).sum())


@pytest.mark.parametrize("value", [0.0, 0.01, 1.0, 2.55, -1.0, -np.inf, np.inf, 1e38])
def test_a_constant_intensity_is_unknown(value: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert safe_cells(np.full_like(MEADOW, value)) == safe_cells(MEADOW)


@pytest.mark.parametrize("value", [-1.0, np.inf, 1e38])
def test_impossible_intensities_among_others_are_unknown(value: float) -> None:
    bright = np.linspace(0.3, 0.5, len(MEADOW)).astype(np.float32)
    broken = bright.copy()
    broken[::2] = value
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert safe_cells(broken) == safe_cells(bright)


@pytest.mark.parametrize("weight", [np.inf, np.nan, -1e6, 1e6])
def test_lost_rays_of_an_impossible_weight_are_none(weight: float) -> None:
    assert safe_cells(MEADOW, weight) == safe_cells(MEADOW, 0.0)
