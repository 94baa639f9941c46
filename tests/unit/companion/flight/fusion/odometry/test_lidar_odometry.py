"""LiDAR odometry over closed-form worlds: what is observed is corrected, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from tests.unit.companion.flight.fusion.odometry.worlds import (
    SCAN_NS,
    Floats,
    Odometer,
    beside_wall,
    courtyard,
    plain,
    roofs,
    slope,
    terrace,
)

DRIFT_MS = np.array([0.03, -0.02, 0.03])
BEGINNING_S = 6.0  # walls count from 5 s after they were first seen


def drifting_later(t: float) -> Floats:
    return DRIFT_MS * max(0.0, t - BEGINNING_S)


def carried_off(t: float) -> Floats:
    return np.array([0.1, 0.0, 0.0]) * max(0.0, t - BEGINNING_S)


def estimate_of(odometer: Odometer) -> OdometryEstimate:
    estimate = odometer.odometry.estimate
    assert estimate is not None
    return estimate


def test_between_walls_a_drift_of_the_autopilot_moves_nothing_on_the_map() -> None:
    odometer = Odometer(courtyard, drifting_later).run(30)
    assert np.abs(drifting_later(30.0)).max() > 0.7
    assert np.abs(odometer.offsets[-1] - odometer.offsets[20]).max() < 0.05
    assert estimate_of(odometer).is_healthy
    assert odometer.odometry.is_tracking(odometer.now_ns)


def test_the_height_datum_keeps_its_slide_within_a_scan() -> None:
    odometer = Odometer(plain).run(2)
    odometer.history.correction = replace(odometer.history.correction, slide_up_ms=1.0)
    assert odometer.run(0.5).history.correction.slide_up_ms == 1.0


def test_over_level_ground_height_is_corrected_and_the_place_stays_the_autopilots() -> None:
    odometer = Odometer(plain, drifting_later).run(20)
    off = odometer.offsets[-1]
    np.testing.assert_allclose(off[:2], drifting_later(20.0)[:2], atol=0.02)
    assert abs(off[2]) < 0.03
    assert estimate_of(odometer).observed.tolist() == [False, False, True, True, True, False]
    assert not odometer.odometry.is_tracking(odometer.now_ns)


def test_beside_a_wall_only_the_distance_to_it_is_corrected() -> None:
    odometer = Odometer(beside_wall, drifting_later).run(20)
    off, drift = odometer.offsets[-1], drifting_later(20.0)
    assert abs(off[0] - drift[0]) < 0.05
    assert abs(off[1]) < 0.05
    assert estimate_of(odometer).observed[:2].tolist() == [False, True]
    assert not odometer.odometry.is_tracking(odometer.now_ns)


def test_a_place_that_is_lost_counts_as_tracked_for_three_seconds_more() -> None:
    odometer = Odometer(courtyard).run(12)
    odometer.world = plain
    odometer.run(2.5)
    assert not odometer.odometry.tells_place(odometer.now_ns)
    assert odometer.odometry.is_tracking(odometer.now_ns)
    odometer.run(1)
    assert not odometer.odometry.is_tracking(odometer.now_ns)


def test_an_estimate_is_of_its_own_time_however_late_its_scans_are_used() -> None:
    odometer, scans = Odometer(courtyard, sway_m=5.0).run(12), []
    for _ in range(2):
        odometer.fly(SCAN_NS)
        scans.append(odometer.scan())
    at_s = odometer.now_ns * 1e-9
    odometer.fly(4 * SCAN_NS)
    for scan in scans:
        odometer.odometry.add(scan)
    estimate = estimate_of(odometer)
    assert estimate.stamp_ns == round(at_s * 1e9)
    np.testing.assert_allclose(estimate.position_enu_m, odometer.true_enu_m(at_s), atol=0.05)
    np.testing.assert_allclose(estimate.velocity_enu_ms, odometer.velocity_enu_ms(at_s), atol=0.03)


def test_a_map_that_begins_without_gps_tells_no_place_until_it_is_back() -> None:
    odometer = Odometer(courtyard).run(12)
    odometer.gps_lost = True
    odometer.run(1)
    assert odometer.odometry.tells_place(odometer.now_ns)
    odometer.fly(3_000_000_000)  # without scans
    odometer.run(12)
    assert odometer.odometry.restarts == 1
    assert estimate_of(odometer).observed.tolist() == [False, False, True, True, True, True]
    assert not odometer.odometry.is_tracking(odometer.now_ns)
    assert odometer.history.tracked_until_ns is None
    odometer.gps_lost = False
    odometer.run(1)
    assert odometer.odometry.tells_place(odometer.now_ns)


def test_an_axis_counts_as_observed_by_the_scan_that_shows_it_alone() -> None:
    odometer = Odometer(courtyard).run(12)
    assert estimate_of(odometer).observed.all()
    odometer.world = beside_wall
    odometer.run(0.3)
    assert estimate_of(odometer).observed[:2].tolist() == [False, True]
    odometer.world = courtyard
    odometer.run(0.3)
    assert estimate_of(odometer).observed[:2].all()


def test_over_roofs_their_edges_alone_tell_the_place() -> None:
    odometer = Odometer(roofs, drifting_later).run(20)
    assert np.abs(odometer.offsets[-1]).max() < 0.1
    assert estimate_of(odometer).is_healthy
    assert odometer.odometry.is_tracking(odometer.now_ns)


def test_over_one_edge_only_the_distance_to_it_is_corrected() -> None:
    odometer = Odometer(terrace, drifting_later).run(20)
    off, drift = odometer.offsets[-1], drifting_later(20.0)
    assert abs(off[0] - drift[0]) < 0.05
    assert abs(off[1]) < 0.1
    assert estimate_of(odometer).observed[:2].tolist() == [False, True]


def test_a_slope_tells_no_place() -> None:
    odometer = Odometer(slope, drifting_later).run(20)
    np.testing.assert_allclose(odometer.offsets[-1][:2], drifting_later(20.0)[:2], atol=0.02)
    assert not odometer.odometry.is_tracking(odometer.now_ns)


def test_an_axis_that_is_not_observed_is_less_sure() -> None:
    along, across = np.sqrt(np.diag(estimate_of(Odometer(beside_wall).run(10)).pose_covariance))[:2]
    assert across < 0.1 < 0.4 < along


def turning_later(t: float) -> float:
    return float(np.radians(min(8.0, 1.0 * max(0.0, t - BEGINNING_S))))


def test_a_heading_that_drifts_is_held_by_the_gyroscope_in_the_lidar() -> None:
    odometer = Odometer(plain, yaw_error_rad=turning_later).run(16)
    w, _, _, z = estimate_of(odometer).quat_wxyz
    assert abs(np.degrees(2 * np.arctan2(z, w))) < 0.5
    assert np.degrees(turning_later(16.0)) > 7.9


def test_a_gps_that_drifts_a_decimetre_a_second_is_noticed_within_ten_seconds() -> None:
    odometer = Odometer(courtyard, carried_off).run(BEGINNING_S)
    assert odometer.odometry.gps_drift_m < 0.2
    assert odometer.run(10).odometry.gps_drift_m > 0.8


def test_a_jump_of_the_estimate_moves_nothing_while_the_place_is_known() -> None:
    odometer = Odometer(courtyard).run(10)
    before, epoch = odometer.offsets[-1], odometer.history.epoch
    odometer.error_enu_m = lambda _t: np.array([4.0, -3.0, 1.0])
    odometer.run(3)
    assert odometer.history.epoch == epoch
    assert odometer.history.absorbed == 1
    assert np.abs(np.array(odometer.offsets[-50:]) - before).max() < 0.1


def test_a_jump_begins_a_new_map_while_the_place_is_unknown() -> None:
    odometer = Odometer(plain).run(10)
    epoch = odometer.history.epoch
    odometer.error_enu_m = lambda _t: np.array([4.0, -3.0, 1.0])
    odometer.run(1)
    assert odometer.history.epoch == epoch + 1
    assert odometer.odometry.restarts == 1
    assert odometer.history.correction.is_none or np.abs(odometer.history.correction.shift_enu_m).max() < 0.05


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_crowd_in_half_of_the_returns_moves_nothing(seed: int) -> None:
    offsets = np.array(Odometer(courtyard, crowd=0.5, seed=seed).run(20).offsets)
    assert np.abs(np.diff(offsets, axis=0)).max() < 0.05
    assert np.abs(offsets).max() < 0.1


def test_scans_of_another_world_are_refused_and_do_not_move_the_vehicle() -> None:
    odometer = Odometer(courtyard).run(10)
    odometer.world = lambda rng: rng.uniform((-10, -10, 0), (10, 10, 20), (3000, 3))
    before = odometer.offsets[-1]
    odometer.run(1.5)
    assert odometer.odometry.refused > 0
    assert np.abs(odometer.offsets[-1] - before).max() < 0.1
    assert not odometer.odometry.is_tracking(odometer.now_ns)
    odometer.run(2)
    assert odometer.odometry.restarts == 1
    assert odometer.history.tracked_until_ns is None
