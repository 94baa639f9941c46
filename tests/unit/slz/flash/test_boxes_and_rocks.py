"""Chain from the simulated instrument over the borrow pit to hazards; the two share no code."""

from __future__ import annotations

import numpy as np
import pytest

import params
from sitl.scenes.hills import BOXES
from slz import SAFE, Pipeline
from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.elevation import elevation_map, grid_around, histogram_peaks
from slz.flash.frame_processing import Quality, map_points, process_frame, sensor_points
from slz.flash.hazard_detection import find_hazards
from slz.frame import LocalFrame
from slz.window import Window
from tests.unit.slz.flash.pit import Pit, judge


@pytest.fixture(scope="module")
def pit() -> Pit:
    return Pit(seed=1)


def test_one_frame_from_250_m_shows_three_levels_and_both_boxes_at_either_xi(pit: Pit) -> None:
    points = pit.points(0.0, 0.0)
    grid = grid_around(points, 0.1)
    heights = elevation_map(points, grid).height_m
    above = heights - np.nanmedian(heights)
    assert histogram_peaks(above) == pytest.approx([0.0, 1.0, 2.0], abs=0.05)
    for xi in (2.0, 6.0):
        large = [h for h in find_hazards(above, grid, xi=xi) if h.area_m2 > 4]
        assert len(large) == 2
        assert sorted(h.height_m for h in large) == pytest.approx([1.0, 2.0], abs=0.1)
        assert sorted(h.east_m for h in large) == pytest.approx([-4.0, 4.0], abs=0.2)


def test_standard_errors_told_are_those_of_the_heights(pit: Pit) -> None:
    raw, position, turn = pit.look(20.0, 20.0)
    camera = FlashCamera()
    image = process_frame(FlashFrame(raw.samples, raw.counter), camera)
    error = image.measured.range_m - pit.true_ranges(20.0, 20.0)
    smooth = np.isfinite(error)
    told = np.sqrt(np.mean(image.measured.sigma_m[smooth] ** 2))
    assert np.median(np.abs(error[smooth])) / 0.6745 == pytest.approx(told, rel=0.1)
    points, _ = sensor_points(image, camera)
    assert len(map_points(points, position, turn)) == pytest.approx(128 * 128, rel=0.03)


def test_frames_too_near_and_too_far_are_not_mapped(pit: Pit) -> None:
    for height_m, quality in ((60.0, Quality.SATURATED), (1100.0, Quality.EMPTY)):
        raw, _, _ = pit.look(0.0, 0.0, height_m, 0.0)
        image = process_frame(FlashFrame(raw.samples, raw.counter), FlashCamera())
        assert image.triage.quality is quality
        assert not len(sensor_points(image, FlashCamera())[0])


@pytest.mark.bench
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_hazard_of_half_a_metre_and_nine_tenths_of_smaller_ones_are_found(seed: int) -> None:
    score = judge(Pit(seed))
    assert score.half_metre[1] == score.half_metre[0] > 25
    assert score.third_metre[1] >= 0.9 * score.third_metre[0]
    assert score.false_alarms <= score.area_m2 / 1000


def test_points_of_a_frame_go_through_the_ordinary_stages(pit: Pit) -> None:
    points = pit.points(0.0, 0.0)
    settings = ["max_range_m=400", "lidar_max_m=400", "angle_noise_deg=0", "adaptive=off"]
    pipeline = Pipeline(params.load("quadcopter", [*settings, "min_square_m=2.5"]), (0.0, 0.0))
    stamps = np.zeros(len(points), np.int64)
    _, position, _ = pit.look(0.0, 0.0)
    report = pipeline.process(Window(points, stamps, position, LocalFrame(35.0, -117.8, 700.0), 0, 0))
    maps = pipeline.maps()
    assert maps is not None

    def state(east_m: float, north_m: float) -> int:
        row = int((north_m - maps.south_m) / maps.grid.cell_m)
        return int(maps.state[row, int((east_m - maps.west_m) / maps.grid.cell_m)])

    assert report.zones
    assert state(0.0, 0.0) == SAFE
    for east, _, _ in BOXES:
        assert all(state(east + side, 0.0) != SAFE for side in (-2.0, -1.4, 1.4, 2.0))
        assert state(east, 2.2) != SAFE  # its shadow
