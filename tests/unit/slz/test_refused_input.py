"""Refusal of malformed input in one line that states the fault."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from slz import LocalFrame
from slz.flash.camera import FlashCamera, FlashFrame
from slz.radar.interferogram import RadarLines
from slz.window import PointAttributes, Scan, Windower, join

FRAME = LocalFrame(0.0, 0.0, 0.0)


def scan(n: int = 4, **changed: Any) -> Scan:
    given: dict[str, Any] = {"points_enu_m": np.zeros((n, 3)), "stamp_ns": np.arange(n)}
    given |= {"sensor_enu_m": np.zeros(3), "frame": FRAME}
    return Scan(**{**given, **changed})


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"points_enu_m": np.zeros((3, 3))}, r"points must be \(4, 3\) float64, not \(3, 3\) float64"),
        ({"points_enu_m": np.zeros((4, 3), np.float32)}, r"not \(4, 3\) float32"),
        ({"stamp_ns": np.zeros((4, 1), np.int64)}, r"stamps must be \(4,\) int64, not \(4, 1\) int64"),
        ({"stamp_ns": np.zeros(4)}, r"stamps must be \(4,\) int64, not \(4,\) float64"),
        ({"sensor_enu_m": np.zeros(2)}, r"sensor position must be \(3,\), not \(2,\) float64"),
    ],
)
def test_a_scan_of_another_form_is_refused(changed: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        scan(**changed)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"intensity": np.zeros(4)}, r"intensity must be \(4,\) float32, not \(4,\) float64"),
        ({"echo": np.zeros(3, np.uint8)}, r"echo must be \(4,\) uint8, not \(3,\) uint8"),
        ({"echoes": np.zeros(4)}, r"echoes must be \(4,\) uint8, not \(4,\) float64"),
        ({"lost_enu_m": np.zeros((2, 2))}, r"lost rays must be \(2, 3\) float64, not \(2, 2\) float64"),
        ({"lost_enu_m": np.zeros((2, 3))}, r"origins of lost rays must be \(2, 3\) float64, not \(0, 3\)"),
        ({"lost_weight": np.ones(1, np.float32)}, r"weights of lost rays must be \(0,\) float32, not \(1,\)"),
    ],
)
def test_attributes_of_another_form_are_refused(changed: dict[str, Any], told: str) -> None:
    sound = PointAttributes.unknown(4)
    assert scan(attributes=sound).attributes is sound
    with pytest.raises(ValueError, match=told):
        dataclasses.replace(sound, **changed)
    with pytest.raises(ValueError, match="attributes must be of the 4 points, not of 3"):
        scan(attributes=PointAttributes.unknown(3))


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"origin": np.zeros(4, np.int64)}, r"origin must be \(4,\) uint16, not \(4,\) int64"),
        ({"origin": np.zeros(3, np.uint16)}, r"origin must be \(4,\) uint16, not \(3,\)"),
        ({"origins_enu_m": np.zeros((1, 2))}, r"origins_enu_m must be \(k, 3\) float64, not \(1, 2\)"),
        ({"origins_enu_m": np.zeros((0, 3))}, "origin must be below 0, the number of origins, not 0"),
        ({"origin": np.full(4, 1, np.uint16)}, "origin must be below 1, the number of origins, not 1"),
        ({"origin": None}, "origin and origins_enu_m must both be given, or neither"),
    ],
)
def test_origins_of_another_form_are_refused(changed: dict[str, Any], told: str) -> None:
    sound = join([scan()])
    with pytest.raises(ValueError, match=told):
        dataclasses.replace(sound, **changed)


def test_an_empty_scan_begins_no_window() -> None:
    windower = Windower(1.0)
    assert windower.add(scan(0)) == ()
    assert windower.flush() is None


def lines(**changed: Any) -> RadarLines:
    given: dict[str, Any] = {"samples": np.zeros((2, 1, 2, 8), np.complex64), "first_m": 50.0, "step_m": 1.0}
    given |= {"position_m": np.full((2, 3), 40.0), "heading_rad": 0.0, "roll_rad": np.zeros(2)}
    return RadarLines(**{**given, **changed})


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"samples": np.zeros((2, 1, 2, 8))}, r"must be \(lines, looks, 2, bins\) complex64, not .* float64"),
        ({"samples": np.zeros((2, 1, 3, 8), np.complex64)}, "must be"),
        ({"samples": np.zeros((2, 2, 8), np.complex64)}, "must be"),
        ({"samples": np.zeros((1, 1, 2, 8), np.complex64)}, "too few: give 2 lines and 8 bins at least"),
        ({"samples": np.zeros((2, 0, 2, 8), np.complex64)}, "too few"),
        ({"samples": np.zeros((2, 1, 2, 7), np.complex64)}, "too few"),
        ({"position_m": np.full((3, 3), 40.0)}, "2 lines need as many positions and rolls"),
        ({"roll_rad": np.zeros(3)}, "2 lines need as many positions and rolls"),
        ({"first_m": 0.0}, "ranges begin at 0.0 m, step 1.0 m"),
        ({"step_m": float("nan")}, "step nan m"),
        ({"heading_rad": float("inf")}, "position, heading, roll or level is not finite"),
        ({"roll_rad": np.array([0.0, np.nan])}, "not finite"),
        ({"level_m": 40.0}, "the track is 0.0 m over the ground at level_m 40: it must be above it"),
    ],
)
def test_radar_lines_of_another_form_are_refused(changed: dict[str, Any], told: str) -> None:
    lines()
    with pytest.raises(ValueError, match=told):
        lines(**changed)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"rows": 1}, "rows is 1, it must be 2 or more"),
        ({"cols": 1}, "cols is 1, it must be 2 or more"),
        ({"n_samples": 9}, "n_samples is 9, it must be 10 or more"),
        ({"fov_deg": 0.0}, "fov_deg is 0.0, it must be positive"),
        ({"sample_ns": float("inf")}, "sample_ns is inf, it must be positive"),
        ({"noise_counts": -1.0}, "noise_counts is -1.0, it must be positive"),
        ({"baseline_counts": 8.0}, "must rise, not 8, 8, 4095"),
        ({"saturated_counts": 300}, "must rise, not 8, 300, 300"),
    ],
)
def test_a_flash_camera_that_cannot_be_is_refused(changed: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        dataclasses.replace(FlashCamera(), **changed)


def test_the_least_flash_camera_is_taken() -> None:
    assert dataclasses.replace(FlashCamera(), rows=2, cols=2, n_samples=10).rows == 2


@pytest.mark.parametrize(
    ("samples", "counter", "told"),
    [
        (
            np.zeros((4, 5), np.uint16),
            np.zeros((4, 5), np.uint32),
            r"samples must be \(rows, cols, n\) uint16",
        ),
        (np.zeros((4, 5, 20)), np.zeros((4, 5), np.uint32), r"not \(4, 5, 20\) float64"),
        (np.zeros((4, 6, 20), np.uint16), np.zeros((4, 5), np.uint32), r"beside a counter \(4, 5\)"),
        (np.zeros((4, 5, 20), np.uint16), np.zeros((4, 5)), "the counter must be uint32, not float64"),
    ],
)
def test_a_flash_frame_of_another_form_is_refused(samples: Any, counter: Any, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        FlashFrame(samples=samples, counter=counter)


@pytest.mark.parametrize("shape", [(4, 1, 1, 9), (4, 1, 3, 9), (1, 1, 2, 9), (4, 1, 2, 7), (4, 2, 9)])
def test_radar_lines_are_of_two_antennas_and_of_lines_and_bins_enough(shape: tuple[int, ...]) -> None:
    samples = np.zeros(shape, np.complex64)
    with pytest.raises(ValueError, match="samples must|too few"):
        RadarLines(samples, 80.0, 0.25, np.full((shape[0], 3), 75.0), 0.0, np.zeros(shape[0]))
    sound = np.zeros((4, 1, 2, 9), np.complex64)
    assert RadarLines(sound, 80.0, 0.25, np.full((4, 3), 75.0), 0.0, np.zeros(4)).samples is sound
