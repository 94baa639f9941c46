"""Image stage of the flash LiDAR: triage, median filter, and pixels to map points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.flash.frame_processing import Quality, map_points, median_of_neighbours, process_frame, sensor_points
from tests.unit.slz.flash.waveforms import frame_of, noisy_camera, some_peaks


def test_median_takes_nine_points_inside_six_at_edges_four_at_corners() -> None:
    image = np.random.default_rng(1).normal(size=(9, 11))
    found = median_of_neighbours(image)
    assert np.array_equal(found[1:-1, 1:-1], ndimage.median_filter(image, 3)[1:-1, 1:-1])
    assert found[0, 4] == np.median(image[:2, 3:6])
    assert found[-1, -1] == np.median(image[-2:, -2:])


def test_median_repairs_single_holes_keeps_edges_and_leaves_larger_holes_open() -> None:
    image = np.where(np.arange(12) < 6, 10.0, 12.0) * np.ones((12, 1))
    image[5, 5] = np.nan
    image[8:11, 1:4] = np.nan
    found = median_of_neighbours(image)
    assert found[5, 5] == 10.0
    assert np.isnan(found[9, 2])
    assert set(np.unique(found[np.isfinite(found)])) == {10.0, 12.0}


def test_frames_are_sorted_by_what_they_hold() -> None:
    camera = noisy_camera(0.05, rows=32, cols=32)
    frame, _ = frame_of(camera, some_peaks(camera), 1500.0, 0.05)
    assert process_frame(frame, camera).triage.quality is Quality.WHOLE
    for share, quality in ((0.4, Quality.LIMIT), (0.8, Quality.EMPTY), (0.15, Quality.PARTIAL)):
        counter = frame.counter.copy()
        counter[: round(32 * share)] = camera.gate_counter
        image = process_frame(type(frame)(frame.samples, counter), camera)
        assert image.triage.quality is quality
        assert (len(sensor_points(image, camera)[0]) == 0) == (quality is not Quality.PARTIAL)
    clipping = noisy_camera(0.05, rows=32, cols=32, saturated_counts=8_100)
    image = process_frame(frame, clipping)
    assert image.triage.quality is Quality.SATURATED
    assert not len(sensor_points(image, clipping)[0])


def test_repaired_and_falsely_triggered_pixels_give_no_point() -> None:
    camera = noisy_camera(0.02, rows=16, cols=16)
    frame, _ = frame_of(camera, some_peaks(camera), 1500.0, 0.02)
    counter = frame.counter.copy()
    counter[4, 4] = camera.gate_counter
    counter[9, 9] += 20  # 7 m farther than all around
    image = process_frame(type(frame)(frame.samples, counter), camera)
    assert image.repaired[4, 4]
    assert np.isfinite(image.filtered_m[4, 4])
    assert len(sensor_points(image, camera)[0]) == 16 * 16 - 2


def test_points_of_a_plane_met_head_on_lie_in_it() -> None:
    camera = noisy_camera(0.0, rows=16, cols=16, fov_deg=20.0)
    along = camera.directions()[..., 0]
    peaks = 9.0 + (250.0 / along - 250.0) / camera.sample_m * 0
    way = 250.0 / along
    counter = np.floor(way / camera.sample_m).astype(np.uint32) + 10
    peaks = way / camera.sample_m - counter + 19.0
    frame, _ = frame_of(camera, peaks, 1500.0, 0.0)
    points, _ = sensor_points(process_frame(type(frame)(frame.samples, counter), camera), camera)
    inner = np.abs(points[:, 1:]).max(axis=1) < 30  # the median of neighbours is not that of a plane at edges
    assert np.allclose(points[inner, 0], 250.0, atol=0.35)
    assert points[0, 1] > 0 > points[-1, 1]  # column 0 lies left, row 0 up
    assert points[0, 2] > 0 > points[-1, 2]


def test_points_are_placed_by_the_pose_and_a_bad_pose_is_refused() -> None:
    down = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    found = map_points(np.array([[10.0, 1.0, 2.0]]), np.array([5.0, 6.0, 30.0]), down)
    assert found.tolist() == [[4.0, 8.0, 20.0]]
    with pytest.raises(ValueError, match="not finite"):
        map_points(np.zeros((1, 3)), np.array([np.nan, 0, 0]), down)
    with pytest.raises(ValueError, match="no rotation"):
        map_points(np.zeros((1, 3)), np.zeros(3), 2 * down)
