"""Surfel map: planes where surfaces were first seen, in bounded memory."""

from __future__ import annotations

import numpy as np

from companion.flight.fusion.odometry.odometry_estimate import MOST, STEP_NS, MapUncertainty
from companion.flight.fusion.odometry.surfel_kernels import FEWEST, ROUGHNESS, key_of, slot_of
from companion.flight.fusion.odometry.surfel_map import FULL, HOLD_NS, SIZES_M, SurfelMap

SENSOR = np.array([0.0, 0.0, 20.0])


def unknown(n: int) -> np.ndarray:
    return np.zeros(n, np.bool_)


def plane_at(surfels: SurfelMap, place: tuple[float, float, float], level: int = 0) -> np.ndarray:
    x, y, z = (int(np.floor(v / SIZES_M[level])) for v in place)
    return np.asarray(surfels.planes[level, slot_of(surfels.keys[level], key_of(x, y, z))])


def sloping(rng: np.random.Generator, n: int) -> np.ndarray:
    """Points of the plane z = 0.3 x + 0.1 y + 0.5 in one voxel of 2 m, with noise across it."""
    xy = rng.uniform(0.05, 1.95, (n, 2))
    return np.column_stack([xy, 0.3 * xy[:, 0] + 0.1 * xy[:, 1] + 0.5 + rng.normal(0, 0.01, n)])


def test_the_plane_of_a_voxel_is_that_of_its_points() -> None:
    points = sloping(np.random.default_rng(1), 300)
    surfels = SurfelMap()
    surfels.add(points, unknown(300), 0, SENSOR)
    plane = plane_at(surfels, (1.0, 1.0, 1.0))
    used = points[:288]  # fitted at every 32nd point
    middle = used.mean(axis=0)
    _, spread, axes = np.linalg.svd(used - middle)
    np.testing.assert_allclose(plane[:3], axes[2] * np.sign(axes[2, 2]), atol=2e-4)
    assert abs(plane[3] - float(plane[:3] @ (middle - 1.0))) < 1e-4
    assert abs(plane[ROUGHNESS] - spread[2] / np.sqrt(288)) < 2e-4


def test_a_rough_voxel_and_one_with_few_points_have_no_plane() -> None:
    rng = np.random.default_rng(2)
    surfels = SurfelMap()
    surfels.add(rng.uniform(0.05, 1.95, (200, 3)), unknown(200), 0, SENSOR)
    assert plane_at(surfels, (1.0, 1.0, 1.0))[ROUGHNESS] == -1
    few = SurfelMap()
    few.add(sloping(rng, FEWEST - 1), unknown(FEWEST - 1), 0, SENSOR)
    assert plane_at(few, (1.0, 1.0, 1.0))[ROUGHNESS] == -1


def test_a_plane_stays_where_it_was_first_seen() -> None:
    rng = np.random.default_rng(3)
    surfels = SurfelMap()
    surfels.add(sloping(rng, 100), unknown(100), 0, SENSOR)
    before = plane_at(surfels, (1.0, 1.0, 1.0)).copy()
    surfels.add(sloping(rng, 100) + np.array([0, 0, 0.2]), unknown(100), HOLD_NS + 1, SENSOR)
    np.testing.assert_array_equal(plane_at(surfels, (1.0, 1.0, 1.0)), before)


def test_a_full_map_keeps_what_is_near() -> None:
    rng = np.random.default_rng(4)
    surfels = SurfelMap()
    surfels.add(sloping(rng, 100), unknown(100), 0, SENSOR)
    before = plane_at(surfels, (1.0, 1.0, 1.0)).copy()
    for k in range(12):  # more voxels than a table holds
        far = rng.uniform(200 + 100 * k, 300 + 100 * k, (FULL // 8, 3))
        surfels.add(far, unknown(len(far)), 0, SENSOR)
    assert (surfels.keys != 0).sum(axis=1).max() <= FULL
    np.testing.assert_array_equal(plane_at(surfels, (1.0, 1.0, 1.0)), before)


# Variance of the map by the time at which its parts were placed.


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
