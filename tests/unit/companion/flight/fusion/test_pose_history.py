"""Pose interpolation against the sampled flight, and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from companion.flight.fusion.pose_history import PoseHistory
from params import Parameters
from slz import LocalFrame
from tests.unit.companion.flight.fusion.flights import ENU_FROM_NED, HOME, MS, Flight

P = Parameters()
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)


def test_between_samples_the_pose_is_that_of_the_flight() -> None:
    flight = Flight()
    stamps = np.arange(5 * MS, 1990 * MS, 3_777_777)
    poses = flight.history(P).interpolate(stamps)
    assert poses.valid.all()
    np.testing.assert_allclose(poses.position_enu_m, flight.position_enu_m(stamps * 1e-9), atol=2e-6)
    for stamp, rotation in zip(stamps, poses.rotation_enu_from_frd, strict=True):
        np.testing.assert_allclose(rotation, flight.enu_from_frd(stamp * 1e-9), atol=1e-9)


def test_attitudes_far_apart_follow_scipys_slerp() -> None:
    rng = np.random.default_rng(8)
    rotations = Rotation.random(30, random_state=rng)
    history = PoseHistory(P, HOME)
    times = np.arange(30) * 40 * MS  # turns that no vehicle makes: farther apart they would be refused
    for stamp, (x, y, z, w) in zip(times, rotations.as_quat(), strict=True):
        history.add_attitude(int(stamp), (w, x, y, z), STILL)
        history.add_position(int(stamp), HOME.lat_deg, HOME.lon_deg, 500.0, STILL)
    stamps = rng.integers(0, times[-1], 400)
    expected = ENU_FROM_NED @ Slerp(times, rotations)(stamps).as_matrix()
    np.testing.assert_allclose(history.interpolate(stamps).rotation_enu_from_frd, expected, atol=1e-9)


@pytest.mark.parametrize(("step_ms", "refused"), [(20, False), (40, False), (250, True)])
def test_between_attitudes_too_far_apart_for_a_turn_there_is_no_pose(step_ms: int, refused: bool) -> None:
    """At 1.8 s the vehicle begins to roll by 30 degrees within 0.2 s, as gusts and pilots make it."""
    history = PoseHistory(P, HOME)
    for ms in range(0, 4001, step_ms):
        half = math.radians(15) * min(max((ms - 1800) / 200, 0), 1)
        history.add_attitude(ms * MS, (math.cos(half), math.sin(half), 0.0, 0.0), STILL)
        history.add_position(ms * MS, HOME.lat_deg, HOME.lon_deg, 500.0, STILL)
        if ms == 2000:
            rolls = history.interpolate(np.arange(1760, 2000, 40) * MS).valid
            assert rolls.any() != refused
    assert history.interpolate(np.arange(3000, 3900, 50) * MS).valid.all()
    assert (history.steps.coarse > 0) == refused


def test_nothing_is_extrapolated() -> None:
    history = Flight().history(P)  # attitudes 0 to 2000 ms, positions 3 to 2003 ms
    stamps = np.array([-1, 0, 3 * MS - 1, 3 * MS, 2000 * MS, 2000 * MS + 1, 2003 * MS])
    assert history.interpolate(stamps).valid.tolist() == [False, False, False, True, True, False, False]
    assert history.bracketed_until_ns == 2000 * MS


@pytest.mark.parametrize("lacking", ["attitude", "position"])
def test_a_gap_in_either_stream_holds_no_pose(lacking: str) -> None:
    flight, history = Flight(), PoseHistory(P, HOME)
    for stamp in range(0, 3000 * MS, 20 * MS):
        in_gap = 1000 * MS < stamp < 1600 * MS
        if not (in_gap and lacking == "attitude"):
            flight.report_attitude(history, stamp)
        if not (in_gap and lacking == "position"):
            flight.report_position(history, stamp)
    valid = history.interpolate(np.array([990, 1001, 1300, 1599, 1601]) * MS).valid
    assert valid.tolist() == [True, False, False, False, True]


def test_a_gap_just_within_the_limit_is_bridged() -> None:
    flight, history = Flight(), PoseHistory(P, HOME)
    for stamp in (0, 20 * MS, 520 * MS, 540 * MS):
        flight.report_attitude(history, stamp)
        flight.report_position(history, stamp)
    assert history.interpolate(np.array([270 * MS])).valid.all()


def test_without_samples_there_is_no_pose() -> None:
    history = PoseHistory(P)
    assert not history.interpolate(np.array([0, 1])).valid.any()
    assert history.latest(0) is None
    assert history.bracketed_until_ns is None


def test_the_first_position_is_the_origin_of_the_map() -> None:
    history = PoseHistory(P)
    history.add_position(1, 47.0, 8.0, 400.0, STILL)
    history.add_position(2, 47.0, 8.00001, 401.0, STILL)
    assert history.frame == LocalFrame(47.0, 8.0, 400.0)


@pytest.mark.parametrize(
    "position",
    [
        (math.nan, 8.0, 400.0, STILL),
        (91.0, 8.0, 400.0, STILL),
        (47.0, 181.0, 400.0, STILL),
        (47.0, 8.0, math.inf, STILL),
        (47.0, 8.0, 400.0, (0.0, math.nan, 0.0)),
    ],
)
def test_a_place_that_is_none_is_refused(position: tuple[float, float, float, tuple[float, ...]]) -> None:
    history = PoseHistory(P)
    history.add_position(0, *position)
    assert history.frame is None
    assert history.refused == 1


@pytest.mark.parametrize("quat", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0, 0, 1), (3.0, 0, 0, 0)])
def test_an_attitude_that_is_none_is_refused(quat: tuple[float, ...]) -> None:
    history = PoseHistory(P)
    history.add_attitude(0, quat, STILL)
    assert history.refused == 1


def test_repeated_and_overtaken_samples_are_refused_and_counted() -> None:
    flight = Flight()
    history = flight.history(P)
    before = history.interpolate(np.array([1000 * MS])).position_enu_m
    flight.report_attitude(history, 2000 * MS)
    flight.report_attitude(history, 1990 * MS)
    flight.report_position(history, 2003 * MS)
    assert history.refused == 3
    np.testing.assert_array_equal(history.interpolate(np.array([1000 * MS])).position_enu_m, before)


def test_clocks_set_anew_begin_the_history_anew() -> None:
    flight = Flight()
    history = flight.history(P, until_ns=2000 * MS)
    epoch = history.epoch
    for stamp in (0, 20 * MS):
        flight.report_attitude(history, stamp)
        flight.report_position(history, stamp)
    assert history.epoch > epoch
    assert history.interpolate(np.array([10 * MS, 1000 * MS])).valid.tolist() == [True, False]


@pytest.mark.parametrize("jump_m", [3.0, -3.0, 40.0])
def test_a_height_that_is_reset_moves_nothing_on_the_map(jump_m: float) -> None:
    """The vehicle did not move, and nor did the ground: the map goes on."""
    history = PoseHistory(P, HOME)
    for i in range(100):
        stamp = i * 20 * MS
        up_m = 10.0 - 0.5 * stamp * 1e-9 + (jump_m if i >= 50 else 0.0)
        lat, lon, alt = HOME.lla([0.0, 0.0, up_m])
        history.add_attitude(stamp, UPRIGHT, STILL)
        history.add_position(stamp, lat, lon, alt, (0.0, 0.0, 0.5))
    assert (history.jumps, history.epoch, history.absorbed) == (0, 0, 1)
    assert history.interpolate(np.array([970, 990, 1010]) * MS).valid.tolist() == [True, False, True]
    pose = history.latest(1980 * MS)
    assert pose is not None
    assert pose.position_enu_m[2] == pytest.approx(10.0 - 0.99, abs=1e-3)
    assert history.correction_at(970 * MS).is_none


def test_a_height_that_is_another_after_a_gap_begins_a_new_map() -> None:
    history = PoseHistory(P, HOME)
    for stamp, up_m in ((0, 10.0), (20, 10.0), (1500, 16.0), (1520, 16.0)):
        lat, lon, alt = HOME.lla([0.0, 0.0, up_m])
        history.add_position(stamp * MS, lat, lon, alt, (0.0, 0.0, 0.0))
    assert (history.jumps, history.absorbed) == (1, 0)


def test_a_jump_of_the_estimate_is_counted_and_not_bridged() -> None:
    history = PoseHistory(P, HOME)
    for i in range(100):
        stamp = i * 20 * MS
        east_m = 5.0 * stamp * 1e-9 + (3.0 if i >= 50 else 0.0)
        lat, lon, alt = HOME.lla([east_m, 0.0, 10.0])
        history.add_attitude(stamp, UPRIGHT, STILL)
        history.add_position(stamp, lat, lon, alt, (0.0, 5.0, 0.0))
    assert (history.jumps, history.epoch) == (1, 1)
    poses = history.interpolate(np.array([970, 990, 1010]) * MS)
    assert poses.valid.tolist() == [True, False, True]
    assert poses.position_enu_m[2, 0] - poses.position_enu_m[0, 0] == pytest.approx(3.2, abs=1e-3)


def test_hard_manoeuvres_are_no_jumps() -> None:
    flight = Flight(velocity_enu_ms=(20.0, -15.0, 6.0), acceleration_enu_ms2=(-9.0, 9.0, -3.0))
    assert flight.history(P, step_ns=200 * MS).jumps == 0


def seen_again(gap_s: float, position_enu_m: np.ndarray, velocity_enu_ms: np.ndarray) -> PoseHistory:
    """Return a history of 15 m/s eastwards, and one position after a gap."""
    history = PoseHistory(P, HOME)
    fast = np.array([15.0, 0.0, 0.0])
    samples = [(i * 0.02, i * 0.02 * fast, fast) for i in range(-25, 1)]
    samples.append((gap_s, position_enu_m, velocity_enu_ms))
    for t_s, place, (east, north, up) in samples:
        lat, lon, alt = HOME.lla(place + np.array([0.0, 0.0, 20.0]))
        stamp = round((t_s + 1) * 1e9)
        history.add_attitude(stamp, UPRIGHT, STILL)
        history.add_position(stamp, float(lat), float(lon), float(alt), (north, east, -up))
    return history


@pytest.mark.parametrize("gap_s", [0.1, 0.4, 0.6, 0.8, 1.0, 1.5])
@pytest.mark.parametrize("way", [(5.0, 0, 0), (0, -5.0, 0), (-3.0, 4.0, 0), (0, 0, 5.0)])
def test_a_jump_of_five_metres_is_found_after_a_gap(gap_s: float, way: tuple[float, ...]) -> None:
    fast = np.array([15.0, 0.0, 0.0])
    history = seen_again(gap_s, fast * gap_s + way, fast)
    of_height = way[2] != 0 and gap_s <= P.pose_timeout_s  # the map goes on: nothing else moved
    assert (history.jumps, history.absorbed) == ((0, 1) if of_height else (1, 0))


@pytest.mark.parametrize("gap_s", [0.6, 0.8, 1.5, 3.0, 8.0, 20.0])
@pytest.mark.parametrize("begins_at", [0.0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("acceleration", [(-4.0, 0.0, 0.0), (0.0, 4.0, 1.0), (-2.5, -2.5, -1.5)])
def test_a_flight_at_15_ms_that_brakes_or_turns_in_a_gap_with_gusts_has_not_jumped(
    gap_s: float, begins_at: float, acceleration: tuple[float, ...]
) -> None:
    t = np.linspace(0.0, gap_s, 4001)[:, None]
    gusts = np.hstack([np.sin(2 * t), np.sin(1.3 * t + 1), 0.3 * np.sin(3 * t)])
    turning = (t >= begins_at * gap_s) & (t < begins_at * gap_s + 15 / 4)  # then it stands, or flies on
    rates = np.array(acceleration) * turning + gusts
    velocity = np.array([15.0, 0, 0]) + np.cumsum(rates, axis=0) * (gap_s / 4000)
    place = np.sum(velocity, axis=0) * (gap_s / 4001)
    assert seen_again(gap_s, place, velocity[-1]).jumps == 0


def test_begun_anew_it_has_another_epoch_and_no_pose_until_both_samples_came() -> None:
    flight = Flight()
    history = flight.history(P)
    epoch, frame = history.epoch, history.frame
    history.clear()
    assert history.epoch == epoch + 1
    assert history.frame is frame
    assert history.latest(2003 * MS) is None
    flight.report_attitude(history, 2020 * MS)
    flight.report_position(history, 2020 * MS)
    pose = history.latest(2020 * MS)
    assert pose is not None
    assert pose.epoch == epoch + 1


def test_the_history_keeps_the_newest_samples_when_it_is_full() -> None:
    flight = Flight(acceleration_enu_ms2=STILL, rates_frd=(0.0, 0.0, 0.5))
    history = flight.history(P, until_ns=60_000 * MS)
    stamps = np.arange(40_000 * MS, 59_990 * MS, 7 * MS)
    poses = history.interpolate(stamps)
    assert poses.valid.all()
    np.testing.assert_allclose(poses.position_enu_m, flight.position_enu_m(stamps * 1e-9), atol=1e-4)
    assert not history.interpolate(np.array([1000 * MS])).valid.any()


def test_the_latest_pose_is_carried_on_by_velocity_and_rates() -> None:
    flight = Flight(acceleration_enu_ms2=STILL)
    pose = flight.history(P).latest(2060 * MS)
    np.testing.assert_allclose(pose.position_enu_m, flight.position_enu_m(np.float64(2.06)), atol=1e-5)
    np.testing.assert_allclose(pose.rotation_enu_from_frd, flight.enu_from_frd(2.06), atol=1e-9)
    np.testing.assert_allclose(pose.velocity_enu_ms, flight.velocity_enu_ms)
    assert pose.stamp_ns == 2060 * MS


def test_the_latest_pose_is_carried_on_by_a_tenth_of_a_second_at_most() -> None:
    flight = Flight(acceleration_enu_ms2=STILL)
    pose = flight.history(P).latest(2400 * MS)
    assert pose.stamp_ns == 2100 * MS
    np.testing.assert_allclose(pose.position_enu_m, flight.position_enu_m(np.float64(2.1)), atol=1e-5)


@pytest.mark.parametrize("now_ns", [2501 * MS, 1400 * MS, 10**15])
def test_a_pose_of_another_time_is_not_the_latest(now_ns: int) -> None:
    assert Flight().history(P).latest(now_ns) is None


# ---- another frame ------------------------------------------------------------------------------


def far_from_home(north_m: float, east_m: float = 0.0) -> PoseHistory:
    """Return a history of a straight flight that began at HOME and ends so far from it, at 50 m/s."""
    history = PoseHistory(P, HOME)
    way = math.hypot(north_m, east_m)
    north, east = north_m / way, east_m / way
    for k in range(-50, 1):
        along = way + k * 1.0
        lat, lon, alt = HOME.lla([along * east, along * north, 0.0])
        history.add_attitude((k + 50) * 20 * MS, UPRIGHT, STILL)
        history.add_position((k + 50) * 20 * MS, lat, lon, alt, (50.0 * north, 50.0 * east, 0.0))
    return history


@pytest.mark.parametrize(
    ("north_m", "east_m", "far"),
    [(2100.0, 0.0, False), (2300.0, 0.0, True), (0.0, 1400.0, False), (0.0, 1600.0, True), (30e3, 0.0, True)],
)
def test_a_frame_reaches_as_far_as_its_axes_are_turned_by_a_fiftieth_of_a_degree(
    north_m: float, east_m: float, far: bool
) -> None:
    assert far_from_home(north_m, east_m).is_far is far


def test_poses_follow_into_another_frame_without_a_gap() -> None:
    history = far_from_home(30e3)
    stamps = np.arange(100, 900, 7) * MS
    before = HOME.lla(history.interpolate(stamps).position_enu_m)
    epoch = history.epoch
    frame = history.begin_frame()
    assert history.frame == frame != HOME
    assert not history.is_far
    assert history.epoch == epoch + 1
    poses = history.interpolate(stamps)
    assert poses.valid.all()
    lat, lon, alt = before.T
    np.testing.assert_allclose(poses.position_enu_m, frame.enu_m(lat, lon, alt), atol=1e-3)
    latest = history.latest(1000 * MS)
    assert latest is not None
    assert latest.epoch == history.epoch
    np.testing.assert_allclose(latest.position_enu_m, 0.0, atol=1e-6)
    lat, lon, alt = frame.lla([0.0, 1.0, 0.0])
    history.add_position(1020 * MS, lat, lon, alt, (50.0, 0.0, 0.0))
    assert history.jumps == 0


def test_another_frame_does_not_bridge_a_jump_before_it() -> None:
    history = far_from_home(3e3)
    lat, lon, alt = HOME.lla([0.0, 3006.0, 0.0])
    history.add_attitude(1020 * MS, UPRIGHT, STILL)
    history.add_position(1020 * MS, lat, lon, alt, (50.0, 0.0, 0.0))
    assert history.jumps == 1
    history.begin_frame()
    assert history.interpolate(np.array([990, 1010]) * MS).valid.tolist() == [True, False]


def test_a_jump_to_far_away_begins_another_frame_and_a_near_one_does_not() -> None:
    for north_m, begins in ((5.0, False), (111e3, True)):
        history = far_from_home(1.0)
        lat, lon, alt = HOME.lla([0.0, north_m, 0.0])
        history.add_position(1020 * MS, float(lat), float(lon), float(alt), STILL)
        assert history.jumps == 1
        assert history.frame == (LocalFrame(float(lat), float(lon), float(alt)) if begins else HOME)
        assert not history.is_far


def test_a_frame_cannot_begin_without_a_position() -> None:
    with pytest.raises(ValueError, match="without a position"):
        PoseHistory(P, HOME).begin_frame()


def test_places_around_0_0_are_places() -> None:
    history = PoseHistory(P)
    for k, (lat, lon) in enumerate([(-1e-6, 0.0), (0.0, 0.0), (0.0, 1e-6)]):
        history.add_position(k * 20 * MS, lat, lon, 10.0, STILL)
    assert (history.refused, history.jumps) == (0, 0)
    assert history.frame == LocalFrame(-1e-6, 0.0, 10.0)
