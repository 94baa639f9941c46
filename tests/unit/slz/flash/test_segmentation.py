"""Segmentation, hazards and histogram on drawn maps."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.flash.elevation import elevation_map, grid_around, histogram_peaks, relative_elevation
from slz.flash.hazard_detection import find_hazards
from slz.flash.segmentation import segment
from slz.grid import Grid

F64 = NDArray[np.float64]
GRID = Grid(-6.4, -6.4, 0.1, 128, 128)


def two_boxes(noise_m: float = 0.02, seed: int = 1) -> F64:
    heights = np.random.default_rng(seed).normal(0, noise_m, (128, 128))
    heights[50:80, 10:40] += 1.0
    heights[50:80, 88:118] += 2.0
    return heights


@pytest.mark.parametrize("xi", [2.0, 6.0])
def test_both_boxes_are_found_with_their_heights_and_sizes_at_either_xi(xi: float) -> None:
    found = find_hazards(two_boxes(), GRID, xi=xi)
    large = [hazard for hazard in found if hazard.area_m2 > 4]
    assert [round(h.height_m, 1) for h in large] == [2.0, 1.0]
    assert all(abs(h.height_m - t) < 0.03 for h, t in zip(large, (2.0, 1.0), strict=True))
    assert large[1].extent_m == pytest.approx((-5.4, -1.4, -2.4, 1.6), abs=0.11)
    assert large[0].east_m == pytest.approx(3.9, abs=0.1)
    assert len(found) == 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_where_a_hazard_is_and_how_large_is_told_to_the_cell(sign: float) -> None:
    heights = np.random.default_rng(2).normal(0, 0.002, (128, 128))
    heights[40:47, 70:81] += sign * 0.8
    heights[90, 20] += sign * 0.8  # a single cell is noise
    (found,) = find_hazards(heights, GRID)
    assert found.extent_m == pytest.approx((0.6, -2.4, 1.7, -1.7))
    assert (found.east_m, found.north_m) == (pytest.approx(1.15), pytest.approx(-2.05))
    assert found.area_m2 == pytest.approx(0.77)
    assert found.height_m == pytest.approx(sign * 0.8, abs=0.003)


@pytest.mark.parametrize(("height_m", "beside_m", "seen"), [(0.3, 0.2, 1), (0.3, 0.17, 0), (0.24, 0.24, 0)])
def test_a_hazard_has_a_cell_that_reaches_the_least_and_another_of_three_quarters(
    height_m: float, beside_m: float, seen: int
) -> None:
    heights = np.zeros((128, 128))
    heights[60:68, 60:68] = beside_m
    heights[60, 60] = height_m
    assert len(find_hazards(heights, GRID)) == seen


@pytest.mark.parametrize("xi", [2.0, 6.0])
def test_segments_show_the_boxes_and_the_coarser_map_has_fewer(xi: float) -> None:
    segments = segment(two_boxes(), xi)
    assert segments.mean_m[65, 25] == pytest.approx(1.0, abs=0.03)
    assert segments.mean_m[65, 100] == pytest.approx(2.0, abs=0.03)
    assert abs(segments.mean_m[5, 60]) < 0.03
    assert len(np.unique(segment(two_boxes(), 6.0).mean_m)) < len(np.unique(segment(two_boxes(), 2.0).mean_m))


def test_noise_alone_is_one_segment_of_each_square_and_no_hazard() -> None:
    noise = np.random.default_rng(4).normal(0, 0.03, (128, 128))
    assert (segment(noise, 6.0).side == 128).all()
    assert find_hazards(noise, GRID) == ()


def test_by_the_letter_nothing_is_ever_divided_above_the_root_of_three() -> None:
    """Whatever the heights: |H - Hm| of a quarter is at most sqrt(3) deviations of the whole."""
    rng = np.random.default_rng(5)
    for heights in (two_boxes(0.0), rng.exponential(1.0, (64, 64)) ** 4, rng.random((64, 64)) > 0.99):
        segments = segment(np.asarray(heights, float), 1.74, spread="deviation")
        assert (segments.side == segments.side.max()).all()


def test_unknown_cells_stay_unknown_and_a_pit_is_a_hazard() -> None:
    heights = two_boxes()
    heights[:, :5] = np.nan
    heights[100:110, 50:60] -= 0.6
    assert np.isnan(segment(heights, 2.0).mean_m[:, :5]).all()
    assert min(h.height_m for h in find_hazards(heights, GRID)) == pytest.approx(-0.6, abs=0.05)


def test_histogram_has_a_peak_for_ground_and_each_box() -> None:
    assert histogram_peaks(two_boxes()) == pytest.approx([0.0, 1.0, 2.0], abs=0.02)
    assert not len(histogram_peaks(np.full((3, 3), np.nan)))


def test_ground_that_swells_is_taken_off_and_what_stands_on_it_is_not() -> None:
    x, y = np.meshgrid((np.arange(300) + 0.5) * 0.1, (np.arange(300) + 0.5) * 0.1)
    z = 0.1 * x + 0.3 * np.sin(y / 6)
    z[140:170, 140:170] += 1.0
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    elevation = elevation_map(points, grid_around(points, 0.1))
    dem = relative_elevation(elevation)
    assert np.abs(dem[45:-45, 45:130]).max() < 0.08
    assert dem[155, 155] == pytest.approx(1.0, abs=0.1)


def test_bad_settings_and_maps_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="xi is 0"):
        segment(np.zeros((4, 4)), 0.0)
    with pytest.raises(ValueError, match="first is 12"):
        segment(np.zeros((4, 4)), 2.0, 12)
    with pytest.raises(ValueError, match=r"DEM is \(4, 4\)"):
        find_hazards(np.zeros((4, 4)), GRID)
    with pytest.raises(ValueError, match="no point"):
        grid_around(np.empty((0, 3)), 0.1)
