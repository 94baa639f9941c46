"""Extent of a survey: strays, density, coverage and memory."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.desk.clouds import cloud_source
from companion.desk.survey.cloud_quality import coverage_for, density_per_m2, inlier_mask
from companion.desk.survey.tiled.cell_sums import per_m2
from companion.runtime.errors import UsageError


def scattered(n: int, side: float, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, side, (n, 3))


def test_zeros_among_real_coordinates_are_astray() -> None:
    points = scattered(1000, 100.0) + np.array([500_000, 4_000_000, 0])
    points[[3, 500]] = 0
    keep = inlier_mask(points, 1.0)
    assert not keep[[3, 500]].any()
    assert keep.sum() == 998


def test_a_long_strip_has_no_strays() -> None:
    points = scattered(1000, 1.0) * [5000, 3, 1]
    assert inlier_mask(points, 1.0).all()


def test_a_tile_apart_is_not_astray() -> None:
    points = np.vstack([scattered(900, 100.0), scattered(100, 100.0) + np.array([5000, 0, 0])])
    assert inlier_mask(points, 1.0).all()


def test_points_on_one_line_have_no_strays_across_it() -> None:
    points = scattered(1000, 100.0) * [0, 1, 1]
    points[17, 0] = 40.0  # nothing tells how wide the cloud is
    assert inlier_mask(points, 1.0).all()


def test_heights_no_ground_has_are_astray_in_the_unit_of_the_file() -> None:
    points = scattered(100, 10.0)
    points[0, 2], points[1, 2] = 30_000, -70_000
    assert inlier_mask(points, 1.0).sum() == 98
    assert inlier_mask(points, 0.3048).sum() == 99


def test_density_is_that_of_the_ground_that_holds_points() -> None:
    half_empty = scattered(40_000, 100.0)
    half_empty[:, 1] *= 0.5  # 100 m x 50 m: 8 a square metre
    far_corner = np.array([[99.0, 99.0, 0.0]])
    assert density_per_m2(np.vstack([half_empty, far_corner])) == pytest.approx(8, rel=0.05)
    assert density_per_m2(np.empty((0, 3))) == per_m2([], 0.5) == 0.0


@settings(deadline=None)
@given(st.floats(0.3, 100), st.sampled_from([0.2, 0.5, 1.0]))
def test_coverage_is_as_wide_as_chance_leaves_gaps_and_no_wider(density: float, cell_m: float) -> None:
    width = coverage_for(density, cell_m, 1.0, 100.0)
    if width > 1.0:
        assert np.exp(-density * width**2) <= 0.005 + 1e-9
        narrower = width - 2 * cell_m
        assert narrower <= 0 or np.exp(-density * narrower**2) > 0.005
        assert round(width / cell_m) % 2 == 1


def test_coverage_stays_within_its_limits() -> None:
    assert coverage_for(1000.0, 0.5, 1.0, 3.0) == 1.0
    assert coverage_for(0.01, 0.5, 1.0, 3.0) == 3.0
    assert coverage_for(0.0, 0.5, 1.0, 3.0) == 1.0


def test_a_grid_too_large_names_a_cell_that_would_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cloud_source, "total_bytes", lambda: 8 * 2**30)
    with pytest.raises(UsageError, match="too many cells") as caught:
        cloud_source.check_cells(20_000, 10_000, 0.5, 1000)
    fits = re.search(r"--cell-m (\S+) would do", str(caught.value))
    assert fits is not None
    cloud_source.check_cells(20_000, 10_000, float(fits[1]), 1000)
    with pytest.raises(UsageError):
        cloud_source.check_cells(20_000, 10_000, float(fits[1]) * 0.95, 1000)
