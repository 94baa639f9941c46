"""An odometry in a frame of its own, beside an autopilot that errs: where the vehicle is placed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.external_pose import ExternalPose
from companion.flight.fusion.external_odometry.odometry_topic import ChildFrame
from companion.flight.geometry.sensor_mount import Mount
from params import Parameters
from tests.unit.companion.flight.fusion.external_odometry.odometers import FRAME, Odometer

Floats = NDArray[np.float64]
EAST = np.array([1.0, 0.0, 0.0])
LIDAR = ChildFrame.of_lidar(Mount(Parameters(lidar_x_m=0.3, lidar_z_m=0.2)))
BEGIN_S = 8.0


def worst_m(flown: Odometer, last_s: float = 8.0) -> float:
    """Return the greatest error of the place in the last seconds of a flight, m."""
    return float(np.linalg.norm(np.array(flown.off)[-round(last_s / 0.1) :], axis=1).max())


def drift(rate_ms: float) -> object:
    return lambda t: rate_ms * EAST * max(0.0, t - BEGIN_S)


def moved(by_m: Floats) -> object:
    """Return an edit that moves the poses after 15 s in their own frame."""
    return lambda t, pose: replace(pose, position_m=pose.position_m + by_m) if t > BEGIN_S else pose


def count(flown: Odometer, name: str) -> int:
    return flown.odometry.statistics()[name]


@pytest.mark.parametrize("child", [ChildFrame.of_vehicle(), LIDAR])
def test_a_gps_that_drifts_moves_nothing_on_the_map(child: ChildFrame) -> None:
    flown = Odometer(error_enu_m=drift(0.3), child=child).run(20.0)  # type: ignore[arg-type]
    assert worst_m(flown) < 0.3
    assert flown.odometry.gps_drift_m == pytest.approx(3.0, abs=0.25)
    assert flown.odometry.tells_place(flown.now_ns)
    assert flown.odometry.why_not(flown.now_ns) == ""


def test_the_height_datum_keeps_its_slide_within_a_scan() -> None:
    flown = Odometer().run(BEGIN_S)
    flown.history.correction = replace(flown.history.correction, slide_up_ms=1.0)
    assert flown.run(0.5).history.correction.slide_up_ms == 1.0


def test_without_gps_the_autopilot_may_go_off_faster() -> None:
    def ever_faster(t: float) -> Floats:
        return np.asarray(0.5 * 0.034 * EAST * max(0.0, t - BEGIN_S) ** 2)

    flown = Odometer(error_enu_m=ever_faster).run(BEGIN_S)
    flown.gps_lost = True
    flown.run(20.0)
    assert np.linalg.norm(ever_faster(flown.t)) > 6.0
    assert worst_m(flown, 19.0) < 0.3


def test_nothing_is_used_before_five_metres_of_way() -> None:
    hovering = Odometer(path=lambda t: np.array([0.5 * np.sin(t), 0.0, 20.0])).run(20.0)
    assert count(hovering, "alignments") == 0
    assert hovering.history.correction.is_none
    assert hovering.odometry.why_not(hovering.now_ns) == "needs 5 m of way"
    assert not hovering.odometry.tells_place(hovering.now_ns)


def test_a_compass_that_errs_turns_neither_the_way_nor_the_map() -> None:
    """The frame is turned as the way is, and the heading stays the autopilot's while it does not drift."""
    flown = Odometer(path=lambda t: np.array([4.0 * t, 0.0, 20.0]), yaw_error_rad=lambda _t: 0.1).run(25.0)
    assert worst_m(flown) < 0.4
    assert abs(flown.history.correction.turn_rad[2]) < np.radians(0.5)


def test_a_heading_that_drifts_is_corrected() -> None:
    flown = Odometer(yaw_error_rad=lambda t: 0.01 * max(0.0, t - BEGIN_S)).run(20.0)
    assert flown.history.correction.turn_rad[2] == pytest.approx(-0.12, abs=0.02)
    assert np.abs(flown.history.correction.turn_rad[:2]).max() == 0.0  # roll and pitch are gravity's


def test_a_frame_that_is_slowly_tilted_is_levelled() -> None:
    """An odometry without gravity: its heights would climb by the tilt, but for what is levelled."""

    def tilted(t: float, pose: ExternalPose) -> ExternalPose:
        slow = Rotation.from_rotvec([np.radians(0.12) * t, 0.0, 0.0]).as_matrix()
        return replace(pose, rotation=FRAME.as_matrix().T @ slow @ FRAME.as_matrix() @ pose.rotation)

    flown = Odometer(told=tilted).run(40.0)  # 4.8 degrees: more than is taken for the vehicle's attitude
    assert (count(flown, "alignments"), count(flown, "restarts")) == (1, 0)


@pytest.mark.parametrize(
    ("edit", "why"),
    [
        (
            lambda pose: replace(pose, rotation=pose.rotation @ LIDAR.rotation_child_from_frd),
            "attitude not the",
        ),
        (
            lambda pose: replace(pose, rotation=pose.rotation @ Rotation.from_rotvec([0, 0, 1]).as_matrix()),
            "way turned",
        ),
        (lambda pose: replace(pose, position_m=0.5 * pose.position_m), "way not the"),
        (lambda pose: replace(pose, position_m=1.2 * pose.position_m), "parts from the"),
        (lambda pose: replace(pose, position_m=pose.position_m * (1.0, 1.0, -1.0)), "parts from the"),
    ],
)
def test_an_odometry_of_another_frame_or_scale_is_not_used(edit: object, why: str) -> None:
    flown = Odometer(told=lambda _t, pose: edit(pose)).run(20.0)  # type: ignore[operator]
    assert not flown.odometry.tells_place(flown.now_ns)
    assert flown.odometry.why_not(flown.now_ns).startswith(why)
    assert worst_m(flown) < 1.2


def test_an_odometry_of_wheels_that_knows_no_height_is_given_up() -> None:
    def level(_t: float, pose: ExternalPose) -> ExternalPose:
        world = FRAME.apply(pose.position_m)
        return replace(pose, position_m=FRAME.inv().apply([*world[:2], 0.0]))

    def descent(t: float) -> Floats:
        return np.array([3.0 * t, 0.0, 20.0 - min(15.0, 0.7 * max(0.0, t - 10.0))])

    flown = Odometer(path=descent, told=level).run(20.0)
    assert flown.odometry.why_not(flown.now_ns) == "parts from the autopilot"
    assert count(flown, "alignments") == 1
    assert worst_m(flown) < 1.2


def test_an_odometry_that_slides_is_given_up_while_gps_is_there() -> None:
    def slides(t: float, pose: ExternalPose) -> ExternalPose:
        return replace(pose, position_m=pose.position_m + 0.7 * EAST * max(0.0, t - BEGIN_S))

    flown = Odometer(told=slides).run(22.0)
    assert not flown.odometry.tells_place(flown.now_ns)
    assert count(flown, "restarts") >= 1
    assert worst_m(flown) < 2.0


def test_a_jump_of_the_odometry_moves_nothing_on_the_map_and_is_counted() -> None:
    flown = Odometer(told=moved(np.array([3.0, -2.0, 1.0])), error_enu_m=drift(0.2)).run(20.0)  # type: ignore[arg-type]
    assert (count(flown, "jumps"), count(flown, "restarts"), count(flown, "alignments")) == (1, 0, 1)
    assert worst_m(flown, 11.0) < 0.2


def test_an_odometry_that_jumps_again_and_again_is_not_used() -> None:
    def jumps(t: float, pose: ExternalPose) -> ExternalPose:
        return replace(pose, position_m=pose.position_m + 2.0 * EAST * int(max(0.0, t - BEGIN_S)))

    flown = Odometer(told=jumps).run(20.0)
    assert count(flown, "jumps") == 4
    assert not flown.odometry.tells_place(flown.now_ns)
    assert worst_m(flown) < 0.2


@pytest.mark.parametrize("what", ["frame", "child", "publisher", "heading"])
def test_a_restart_in_another_frame_is_aligned_anew_while_the_map_stays(what: str) -> None:
    turn = Rotation.from_rotvec([0.0, 0.0, 0.7]).as_matrix()

    def anew(t: float, pose: ExternalPose) -> ExternalPose:
        if t < BEGIN_S:
            return pose
        turned = replace(pose, position_m=turn @ pose.position_m + 5.0, rotation=turn @ pose.rotation)
        return turned if what == "heading" else replace(turned, **{what: "another"})  # type: ignore[arg-type]

    flown = Odometer(told=anew).run(17.0)
    assert (count(flown, "restarts"), count(flown, "alignments")) == (1, 2)
    assert worst_m(flown, 8.0) < 0.2
    assert flown.odometry.tells_place(flown.now_ns)


def test_when_it_stops_the_autopilot_s_own_estimate_goes_on_from_there() -> None:
    def stops(t: float, pose: ExternalPose) -> ExternalPose | None:
        return pose if t < 14.0 else None

    flown = Odometer(told=stops, error_enu_m=lambda t: 0.3 * EAST * min(max(0.0, t - 6.0), 8.0)).run(14.2)
    assert flown.odometry.tells_place(flown.now_ns)
    flown.run(1.0)
    assert not flown.odometry.tells_place(flown.now_ns)
    assert flown.odometry.is_tracking(flown.now_ns)  # the landing goes on for three seconds
    flown.run(3.0)
    assert not flown.odometry.is_tracking(flown.now_ns)
    assert flown.odometry.why_not(flown.now_ns) == "silent"
    assert flown.odometry.gps_drift_m == 0.0
    assert worst_m(flown, 3.0) < 0.3  # the correction of 2.4 m stays


def test_after_a_silence_the_map_goes_on_where_it_was() -> None:
    def pauses(t: float, pose: ExternalPose) -> ExternalPose | None:
        return None if 8.0 < t < 13.0 else pose

    flown = Odometer(told=pauses, error_enu_m=lambda t: EAST * (10.0 < t < 99.0) * 0.4).run(20.0)
    steps = np.abs(np.diff(np.array(flown.off), axis=0)).max(axis=1)
    assert np.sort(steps)[-2] < 0.1  # the autopilot's own step alone
    assert flown.odometry.tells_place(flown.now_ns)
    assert count(flown, "restarts") == 0


@pytest.mark.parametrize("step_m", [1.0, 10.0])
def test_a_step_of_the_autopilot_is_none_of_the_vehicle(step_m: float) -> None:
    flown = Odometer(error_enu_m=lambda t: step_m * EAST * (t > BEGIN_S)).run(16.0)
    assert worst_m(flown, 7.0) < 0.1
    assert (count(flown, "jumps"), count(flown, "restarts"), flown.history.epoch) == (0, 0, 0)


def test_a_new_map_begins_where_the_autopilot_is() -> None:
    """Without odometry a jump begins a new map; with the first pose on it the odometry goes on there."""

    def pauses(t: float, pose: ExternalPose) -> ExternalPose | None:
        return None if 5.0 < t < 10.0 else pose

    flown = Odometer(told=pauses, error_enu_m=lambda t: 10.0 * EAST * (t > BEGIN_S)).run(17.0)
    assert flown.history.epoch == 1
    off = np.array(flown.off)[-60:]
    np.testing.assert_allclose(off, np.tile(10.0 * EAST, (len(off), 1)), atol=0.1)
    assert flown.odometry.tells_place(flown.now_ns)
    assert count(flown, "alignments") == 1


def test_the_estimate_is_the_vehicle_s_pose_with_what_is_stated_of_it() -> None:
    flown = Odometer(error_enu_m=drift(0.3)).run(18.0)  # type: ignore[arg-type]
    estimate = flown.odometry.estimate
    assert estimate is not None
    t = estimate.stamp_ns * 1e-9 - 1.0
    assert np.linalg.norm(estimate.position_enu_m - flown.path(t)) < 0.3
    velocity = (flown.path(t + 0.01) - flown.path(t - 0.01)) / 0.02
    assert np.linalg.norm(estimate.velocity_enu_ms - velocity) < 0.15
    assert estimate.is_healthy
    sigma = np.sqrt(np.diag(estimate.pose_covariance))
    assert (sigma[:3] >= 0.05).all()
    assert (sigma[:3] < 0.1).all()
    assert np.linalg.eigvalsh(estimate.pose_covariance)[0] > 0


def test_an_odometry_that_states_nothing_grows_unsure_with_its_way() -> None:
    flown = Odometer(told=lambda _t, pose: replace(pose, is_stated=False)).run(20.0)
    estimate = flown.odometry.estimate
    assert estimate is not None
    assert np.sqrt(estimate.pose_covariance[0, 0]) > 0.005 * 3.0 * 16.0


def test_more_poses_than_needed_are_thinned() -> None:
    flown = Odometer(pose_ns=50_000_000).run(2.0)
    assert count(flown, "thinned") == 0
    fast = Odometer()
    for k in range(100):
        fast.now_ns += 5_000_000
        fast.odometry.add_pose(fast.pose())
        if k % 5 == 4:
            fast.run(0.0)
    fast.run(0.1)
    assert count(fast, "thinned") + count(fast, "without_pose") > 50
