"""TLOF, FATO and safety area around a point, on maps of hand-made ground."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import Pipeline
from slz.landing_point.helicopter_areas import HelicopterAreas, helicopter_areas
from tests.unit.slz.hand_made import near_map, returns, window

Floats = NDArray[np.float64]
CELL_M = 0.2
HALF = 50  # cells
D = ("d_value_m=4", "min_boundary_points=4")  # TLOF 1.66 m, FATO 3 m, safety area 6 m around the point


def ground(slope: float = 0.0) -> Floats:
    rows, cols = np.mgrid[-HALF:HALF, -HALF:HALF]
    return np.asarray(slope * (rows + 0.0 * cols) * CELL_M)


def raised(north_m: float, east_m: float, high_m: float, heights: Floats | None = None) -> Floats:
    """Ground with a block of two cells across."""
    out = (ground() if heights is None else heights).copy()
    row, col = HALF + round(north_m / CELL_M), HALF + round(east_m / CELL_M)
    out[row : row + 2, col : col + 2] += high_m
    return out


def areas(heights: Floats, *own: str) -> HelicopterAreas | None:
    parameters = params.load("quadcopter", [*D, *own])
    pipe = Pipeline(parameters, (0.0, 0.0), follow=False)
    points = returns(heights, CELL_M, -HALF * CELL_M, -HALF * CELL_M)
    pipe.process(window(np.repeat(points, 3, axis=0)))
    return helicopter_areas(np.array([0.1, 0.1, 0.0]), near_map(pipe).terrain, parameters)


def fitting(heights: Floats, *own: str) -> HelicopterAreas:
    found = areas(heights, *own)
    assert found is not None
    return found


@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_open_ground_holds_all_three(slope: float) -> None:
    found = fitting(ground(slope))
    assert found.n_met == 3
    assert found.text == "TLOF 0.83 D yes, FATO 1.5 D yes, safety area yes"


def test_a_fence_beyond_the_fato_is_in_the_safety_area() -> None:
    found = fitting(raised(4.4, 0.0, 0.6))
    assert (found.tlof, found.fato, found.safety_area) == ("", "", "0.6 m high at 4.3 m")
    assert found.text == "TLOF 0.83 D yes, FATO 1.5 D yes, safety area no: 0.6 m high at 4.3 m"
    assert found.n_met == 2


@pytest.mark.parametrize(("high_m", "met"), [(0.15, True), (0.25, False)])
def test_what_rises_by_no_more_than_20_cm_may_stand_in_the_safety_area(high_m: float, met: bool) -> None:
    assert (fitting(raised(5.0, 0.0, high_m)).safety_area == "") is met


def test_what_stands_in_the_fato_is_told_with_its_place() -> None:
    found = fitting(raised(0.0, 2.4, 0.8))
    assert found.fato == "0.8 m high at 2.3 m"
    assert found.safety_area == ""


def test_a_slope_within_the_fato_is_told() -> None:
    heights = ground()
    heights[HALF + 10 :] += 0.3 * np.arange(HALF - 10)[:, None] * CELL_M  # 17 degrees from 2 m north on
    found = fitting(heights, "relief_m=0.3")
    assert found.fato != ""
    assert found.safety_area.endswith("m")


def test_ground_that_was_not_seen_fits_nothing() -> None:
    hole = ground()
    hole[HALF + 24 : HALF + 34, HALF - 5 : HALF + 5] = np.nan  # from 4.8 m north on
    found = fitting(hole)
    assert found.fato == ""
    assert found.safety_area == "not seen at 4.7 m"
    assert fitting(ground()[:, :HALF]).fato.startswith("not seen")


def test_a_small_vehicle_keeps_three_metres_of_safety_area() -> None:
    """0.25 D would be 0.25 m."""
    assert fitting(raised(3.4, 0.0, 0.6), "d_value_m=1").safety_area != ""
    assert fitting(raised(4.4, 0.0, 0.6), "d_value_m=1").safety_area == ""


def test_a_vehicle_without_d_and_a_point_that_is_nowhere_have_no_areas() -> None:
    assert areas(ground(), "d_value_m=0") is None
    parameters = params.load("quadcopter", D)
    pipe = Pipeline(parameters, (0.0, 0.0), follow=False)
    pipe.process(window(returns(ground(), CELL_M)))
    assert helicopter_areas(np.full(3, math.nan), near_map(pipe).terrain, parameters) is None
