"""Variance of the map by the time at which its parts were placed."""

from __future__ import annotations

import numpy as np

from companion.flight.fusion.odometry.odometry_estimate import MOST, STEP_NS, MapUncertainty

STEP_M2 = np.array([1e-4, 2e-4, 3e-4])


def test_an_empty_map_is_sure() -> None:
    assert not MapUncertainty().variance_m2(10).any()


def test_variances_add_up_where_each_part_is_placed_by_the_one_before() -> None:
    unsure = MapUncertainty()
    unsure.add(0, np.zeros(3))
    for number in range(1, 21):
        before = unsure.variance_m2((number - 1) * STEP_NS)
        unsure.add(number * STEP_NS, before + STEP_M2)
    np.testing.assert_allclose(unsure.variance_m2(20 * STEP_NS), 20 * STEP_M2)


def test_over_ground_that_stays_in_view_nothing_is_added() -> None:
    unsure = MapUncertainty()
    unsure.add(0, np.zeros(3))
    for number in range(1, 21):
        unsure.add(number * STEP_NS, unsure.variance_m2(0) + STEP_M2)
    np.testing.assert_allclose(unsure.variance_m2(20 * STEP_NS), STEP_M2)


def test_between_two_notes_the_earlier_one_counts() -> None:
    unsure = MapUncertainty()
    unsure.add(0, STEP_M2)
    unsure.add(STEP_NS // 2, 5 * STEP_M2)  # too soon to be noted
    unsure.add(STEP_NS, 2 * STEP_M2)
    for at_ns, times in ((-5, 1), (0, 1), (STEP_NS - 1, 1), (STEP_NS, 2), (9 * STEP_NS, 2)):
        np.testing.assert_allclose(unsure.variance_m2(at_ns), times * STEP_M2)


def test_a_long_flight_keeps_its_whole_time_more_thinly() -> None:
    unsure = MapUncertainty()
    for number in range(3 * MOST):
        unsure.add(number * STEP_NS, number * STEP_M2)
    for number in (0, MOST // 2, MOST, 3 * MOST - 1):
        assert abs(float(unsure.variance_m2(number * STEP_NS)[0] / STEP_M2[0]) - number) <= 8


def test_a_new_map_is_sure() -> None:
    unsure = MapUncertainty()
    unsure.add(0, STEP_M2)
    unsure.clear()
    assert not unsure.variance_m2(0).any()
