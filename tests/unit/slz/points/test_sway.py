"""Sway within a window: scans are registered one by one, and only where they differ by more than noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNSAFE, LocalFrame, Pipeline, Scan, join

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
SENSOR = np.array([0.0, 0.0, 15.0])
SCANS = 20  # of a window of two seconds
PARTS = 10  # of a scan, where a sensor sends many small ones
SETTINGS = ["zone_m=60", "min_boundary_points=10", "gear=none", "angle_noise_deg=0"]


def ground(rng: np.random.Generator, n: int = 1500) -> Floats:
    xy = rng.uniform(-12, 12, (n, 2))
    return np.column_stack([xy, 0.03 * xy[:, 0] + rng.normal(0, 0.015, n)])


def flown(
    sway: Callable[[float], Floats], shape: Callable[[Floats], Floats] = lambda p: p, parts: int = 1
) -> Pipeline:
    """Fly four windows; `sway` gives height and slopes by the time since the first window has ended."""
    pipeline, rng = Pipeline(params.load("quadcopter", SETTINGS), (0.0, 0.0)), np.random.default_rng(1)
    for window in range(4):
        scans = []
        for scan in range(SCANS):
            points = shape(ground(rng))
            if window:
                off = sway((window - 1) * 2 + scan / 10)
                points[:, 2] += off[0] + points[:, :2] @ off[1:]
            start = (window * 20 + scan) * 100_000_000
            stamps = start + np.linspace(0, 9e7, len(points)).astype(np.int64)
            scans += [Scan(points[k::parts], stamps[k::parts], SENSOR, FRAME) for k in range(parts)]
        pipeline.process(join(scans))
    return pipeline


def relief_m(pipeline: Pipeline) -> Floats:
    maps = pipeline.maps(which="near")
    assert maps is not None
    return np.asarray(maps.relief_m[np.isfinite(maps.relief_m)], np.float64)


def still(_: float) -> Floats:
    return np.zeros(3)


def heave(time_s: float) -> Floats:
    return np.array([0.08 * np.sin(2 * np.pi * time_s / 1.7), 0, 0])


def rock(time_s: float) -> Floats:
    slopes = 0.012 * np.sin(2 * np.pi * time_s / 2.3), 0.01 * np.cos(np.pi * time_s)
    return np.array([heave(time_s)[0], *slopes])


@pytest.mark.parametrize("sway", [heave, rock])
def test_ground_seen_by_a_swaying_estimate_is_as_even_as_by_a_steady_one(
    sway: Callable[[float], Floats],
) -> None:
    assert np.quantile(relief_m(flown(sway)), 0.99) < np.quantile(relief_m(flown(still)), 0.99) + 0.02


def test_small_scans_are_taken_together() -> None:
    whole, split = relief_m(flown(heave)), relief_m(flown(heave, parts=PARTS))
    assert np.quantile(split, 0.99) < np.quantile(whole, 0.99) + 0.01


def test_an_object_that_fills_the_view_of_a_scan_is_no_sway() -> None:
    """A roof of 0.3 m below all returns of every fourth scan stands."""

    def shape(points: Floats) -> Floats:
        shape.number += 1  # type: ignore[attr-defined]
        if shape.number > SCANS and shape.number % 4 == 0:  # type: ignore[attr-defined]
            points = points[(np.abs(points[:, :2]) < 4).all(axis=1)]
            points[:, 2] += 0.3
        return points

    shape.number = 0  # type: ignore[attr-defined]
    maps = flown(still, shape).maps(which="near")
    assert maps is not None
    at = tuple(round((0 - low) / maps.grid.cell_m) for low in (maps.grid.south_m, maps.grid.west_m))
    assert maps.state[at[0] - maps.box.row0, at[1] - maps.box.col0] == UNSAFE


def test_a_box_stays_a_box_under_sway() -> None:
    def with_box(points: Floats) -> Floats:
        points[(np.abs(points[:, :2] - 5) < 1).all(axis=1), 2] += 0.5
        return points

    maps = flown(rock, with_box).maps(which="near")
    assert maps is not None
    grid, box = maps.grid, maps.box

    def state(east: float, north: float) -> int:
        return int(
            maps.state[
                int((north - grid.south_m) / grid.cell_m) - box.row0,
                int((east - grid.west_m) / grid.cell_m) - box.col0,
            ]
        )

    assert state(5.9, 5) == UNSAFE
    assert state(-5, -5) == SAFE


def test_a_steady_window_is_taken_as_it_is() -> None:
    """Scans that differ by noise alone are not moved: the maps are those of one scan a window."""
    steady = flown(still)
    hummed = flown(lambda t: np.array([0.003 * np.sin(20 * t), 0, 0]))
    heights = [m.height_m for m in (steady.maps(which="near"), hummed.maps(which="near")) if m is not None]
    assert np.nanmax(np.abs(heights[0] - heights[1])) < 0.004
    assert np.nanmax(np.abs(heights[0] - heights[1])) > 0


def test_a_scan_without_known_ground_below_sways_as_its_neighbours() -> None:
    """Every second scan sees new ground alone, which must not stand off from the old."""

    def shape(points: Floats) -> Floats:
        shape.number += 1  # type: ignore[attr-defined]
        if shape.number > SCANS and shape.number % 2:  # type: ignore[attr-defined]
            points[:, 0] += 24.0
            points[:, 2] += 24.0 * 0.03
        return points

    shape.number = 0  # type: ignore[attr-defined]
    maps = flown(heave, shape).maps(which="near")
    assert maps is not None
    new = maps.relief_m[:, maps.relief_m.shape[1] * 3 // 4 :]
    assert np.nanquantile(new, 0.9) < 0.16


def test_a_line_scanner_is_not_registered_by_its_scans() -> None:
    """A slab of 0.18 m that comes under most of each line is no sway."""
    with_gear = params.load("quadcopter", ["zone_m=40", "min_boundary_points=10"])
    pipeline, rng = Pipeline(with_gear, (0.0, 0.0)), np.random.default_rng(1)
    for window in range(12):
        scans = []
        for scan in range(40):
            north = 3 * np.sin((window * 40 + scan) / 25)
            x = 5 * np.tan(np.radians(-50 + 25 * (scan % 4) + 25 * rng.uniform(size=250)))
            points = np.column_stack([x, north + rng.normal(0, 0.05, 250), rng.normal(0, 0.015, 250)])
            if window >= 6:
                points[(x > 0.1) & (x < 2.3) & (np.abs(points[:, 1]) < 0.5), 2] += 0.18
            stamps = (window * 40 + scan) * 50_000_000 + np.linspace(0, 4e7, 250).astype(np.int64)
            scans.append(Scan(points, stamps, np.array([0.0, north, 5.0]), FRAME))
        pipeline.process(join(scans))
    maps = pipeline.maps(which="near")
    assert maps is not None
    rows, cols = (
        slice(*(round((v - low) / maps.grid.cell_m) - first for v in span))
        for span, low, first in (
            ((-0.3, 0.3), maps.grid.south_m, maps.box.row0),
            ((0.4, 2.0), maps.grid.west_m, maps.box.col0),
        )
    )
    assert not (maps.state[rows, cols] == SAFE).any()


def test_scans_from_an_unknown_place_sway_as_the_others() -> None:
    """Every second scan is of a sensor whose position is not known."""
    pipeline, rng = Pipeline(params.load("quadcopter", SETTINGS), (0.0, 0.0)), np.random.default_rng(1)
    for window in range(4):
        scans = []
        for scan in range(SCANS):
            points = ground(rng)
            points[:, 2] += heave(window * 2 + scan / 10)[0] if window else 0
            stamps = (window * 20 + scan) * 100_000_000 + np.linspace(0, 9e7, len(points)).astype(np.int64)
            sensor = SENSOR if scan % 2 or scan == SCANS - 1 else np.full(3, np.nan)
            scans.append(Scan(points, stamps, sensor, FRAME))
        report = pipeline.process(join(scans))
    maps = pipeline.maps(which="near")
    assert maps is not None
    assert report.zones
    assert np.quantile(relief_m(pipeline), 0.9) < 0.16
