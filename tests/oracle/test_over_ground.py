"""Points over surveyed and mapped ground, against hand-made results."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.points.prior_agreement import contradict, heights_over

SAFE = np.array([[1, 0, 1], [1, 1, 255]], np.uint8)
HEIGHT = np.array([[10, 11, 12], [20, 21, 22]], np.float32)


@pytest.mark.parametrize(
    ("east", "north", "over"),
    [
        (100.0, 200.0, 5.0),  # the corner of the first cell
        (102.5, 200.5, np.nan),  # not safe
        (104.0, 201.9, 3.0),
        (100.5, 202.0, -5.0),
        (105.9, 203.0, np.nan),  # unknown
        (99.99, 201.0, np.nan),  # outside, on each side
        (106.0, 201.0, np.nan),
        (101.0, 199.99, np.nan),
        (101.0, 204.0, np.nan),
    ],
)
def test_heights_are_over_safe_ground_alone(east: float, north: float, over: float) -> None:
    got = heights_over(np.array([[east, north, 15.0]]), 100.0, 200.0, 2.0, SAFE, HEIGHT)
    np.testing.assert_array_equal(got, [over])


def contradicted(
    over: list[float], at: list[list[float]], angle_noise_rad: float = 0.0
) -> tuple[int, list[int]]:
    marks = np.zeros((2, 3), np.uint8)
    points = np.array([[*xy, 0.0] for xy in at])
    sensor = np.array([100.0, 200.0, 30.0])
    n = contradict(points, np.array(over), sensor, 0.5, 1.0, angle_noise_rad, 100.0, 200.0, 2.0, marks)
    return n, marks.ravel().tolist()


def test_only_what_differs_by_more_than_the_least_contradicts() -> None:
    at = [[100.5, 200.5], [102.5, 200.5], [104.5, 200.5], [100.5, 202.5]]
    assert contradicted([1.5, 1.6, -0.5, -0.6], at) == (2, [0, 1, 0, 1, 0, 0])


def test_a_cell_is_counted_once_and_a_height_that_is_not_known_never() -> None:
    at = [[100.5, 200.5], [100.6, 200.6], [102.5, 200.5]]
    assert contradicted([9.0, 9.0, np.nan], at) == (1, [1, 0, 0, 0, 0, 0])


def test_four_standard_deviations_of_the_angle_at_the_distance_are_allowed() -> None:
    at = [[103.0, 202.999], [103.0, 202.999]]  # 4.242 m away: 4 x 0.1 x 4.242 = 1.697 m
    assert contradicted([0.5 + 1.0 + 1.69, 0.5], at, 0.1)[0] == 0
    assert contradicted([0.5 + 1.0 + 1.71, 0.5], at, 0.1)[0] == 1
