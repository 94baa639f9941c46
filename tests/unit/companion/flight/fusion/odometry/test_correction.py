"""Correction of poses, points and scans: one rigid motion, and its inverse."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.flight.fusion.odometry.correction import Correction
from companion.flight.geometry.axes import body_frd_m
from companion.flight.geometry.pose import Pose
from slz import PointAttributes, Scan
from tests.unit.companion.flight.fusion.odometry.worlds import HOME, Floats

ATTITUDE = np.array([0.8, 0.1, -0.1, 0.58])
vectors = arrays(np.float64, 3, elements=st.floats(-50, 50))
small = arrays(np.float64, 3, elements=st.floats(-0.2, 0.2))
points = arrays(np.float64, (5, 3), elements=st.floats(-50, 50))


def pose_at(enu_m: Floats) -> Pose:
    return Pose(0, enu_m, np.array([1.0, 2.0, -0.5]), ATTITUDE / np.linalg.norm(ATTITUDE), 0)


@given(small, vectors, vectors, points)
def test_what_is_moved_to_the_map_and_back_is_where_it_was(
    turn: Floats, pivot: Floats, shift: Floats, some: Floats
) -> None:
    correction = Correction(turn, pivot, shift)
    np.testing.assert_allclose(correction.of_map(correction.points(some)), some, atol=1e-9)


@given(small, vectors, vectors, points)
def test_the_vehicle_sees_a_moved_point_where_it_saw_it_before(
    turn: Floats, pivot: Floats, shift: Floats, some: Floats
) -> None:
    correction, pose = Correction(turn, pivot, shift), pose_at(np.array([3.0, -7.0, 20.0]))
    seen = body_frd_m(correction.points(some), correction.pose(pose))
    np.testing.assert_allclose(seen, body_frd_m(some, pose), atol=1e-6)


@given(small, vectors, vectors, points, vectors)
def test_after_a_jump_the_place_on_the_map_is_the_same(
    turn: Floats, pivot: Floats, shift: Floats, some: Floats, jump: Floats
) -> None:
    correction = Correction(turn, pivot, shift)
    moved = correction.after_jump(jump).points(some + jump)
    np.testing.assert_allclose(moved, correction.points(some), atol=1e-9)


def test_a_scan_moves_with_its_sensor_and_its_lost_rays() -> None:
    rng = np.random.default_rng(3)
    ends, origins = rng.normal(size=(2, 4, 3))
    unknown = np.zeros(6, np.uint8)
    dark, ones = np.full(6, np.nan, np.float32), np.ones(4, np.float32)
    attributes = PointAttributes.of(dark, unknown, unknown, ends, origins, ones)
    scan = Scan(
        points_enu_m=rng.normal(size=(6, 3)),
        stamp_ns=np.arange(6, dtype=np.int64),
        sensor_enu_m=rng.normal(size=3),
        frame=HOME,
        attributes=attributes,
        open_enu_m=rng.normal(size=(4, 3)),
    )
    correction = Correction(np.array([0.01, -0.02, 0.1]), np.ones(3), np.array([1.0, 2.0, 3.0]))
    moved = correction.scan(scan)
    assert moved.attributes is not None
    assert moved.open_enu_m is not None
    assert scan.open_enu_m is not None
    for before, after in (
        (scan.points_enu_m, moved.points_enu_m),
        (scan.sensor_enu_m, moved.sensor_enu_m),
        (scan.open_enu_m, moved.open_enu_m),
        (ends, moved.attributes.lost_enu_m),
        (origins, moved.attributes.lost_origin_enu_m),
    ):
        np.testing.assert_allclose(after, correction.points(before))


def test_no_correction_changes_nothing() -> None:
    pose = pose_at(np.zeros(3))
    assert Correction().is_none
    assert Correction().pose(pose) is pose
