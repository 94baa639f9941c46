"""Georeferencing of returns from a moving, turning vehicle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from companion.flight.fusion.georeference import Georeferencer
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import rotation_frd_from_sensor
from companion.flight.sensors.returns import Returns
from params import Parameters
from tests.unit.companion.flight.fusion.flights import (
    ENU_FROM_NED,
    HOME,
    MS,
    Flight,
    returns_of,
    sensor_points,
)

TILTED = Parameters(
    lidar_x_m=0.3, lidar_y_m=-0.2, lidar_z_m=0.5, lidar_roll_deg=10, lidar_pitch_deg=-35, lidar_yaw_deg=120
)


def direction(elevation_deg: float, azimuth_deg: float = 0.0) -> np.ndarray:
    e, a = np.radians([elevation_deg, azimuth_deg])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def test_the_default_mount_looks_down_with_the_middle_of_its_view() -> None:
    p = Parameters()
    frd = rotation_frd_from_sensor(p.lidar_roll_deg, p.lidar_pitch_deg, p.lidar_yaw_deg)
    np.testing.assert_allclose(frd @ direction(22.5), [0, 0, 1], atol=1e-12)
    forward, right, down = frd @ [0, 0, 1]
    assert (forward, down) == (pytest.approx(np.cos(np.pi / 8)), pytest.approx(np.sin(np.pi / 8)))
    assert right == pytest.approx(0)
    np.testing.assert_allclose(frd @ [0, 1, 0], [0, -1, 0], atol=1e-12)  # left stays left


@pytest.mark.parametrize(
    ("roll_pitch_yaw", "sensor_flu", "body_frd"),
    [
        ((0, 0, 0), (1, 2, 3), (1, -2, -3)),
        ((0, 30, 0), (1, 0, 0), (np.cos(np.pi / 6), 0, 0.5)),  # positive pitch lowers forward
        ((90, 0, 0), (0, 1, 0), (0, 0, -1)),  # positive roll lifts left
        ((0, 0, 90), (1, 0, 0), (0, -1, 0)),  # positive yaw turns forward to the left
        ((90, 0, 90), (0, 1, 0), (0, 0, -1)),  # roll first, yaw last
    ],
)
def test_boresight_angles_turn_as_documented(
    roll_pitch_yaw: tuple[float, float, float],
    sensor_flu: tuple[float, ...],
    body_frd: tuple[float, ...],
) -> None:
    rotation = rotation_frd_from_sensor(*roll_pitch_yaw)
    np.testing.assert_allclose(rotation @ sensor_flu, body_frd, atol=1e-12)


@pytest.mark.parametrize("parameters", [Parameters(), TILTED])
def test_known_points_come_back_within_a_millimetre(parameters: Parameters) -> None:
    rng = np.random.default_rng(4)
    flight = Flight()
    stamps = np.sort(rng.integers(10 * MS, 1990 * MS, 3000))
    targets = flight.position_enu_m(stamps * 1e-9) + rng.uniform(-30, 30, (3000, 3))
    xyz = sensor_points(flight, parameters, targets, stamps * 1e-9)
    far = np.linalg.norm(xyz, axis=1)
    keep = (far > parameters.lidar_min_m + 0.01) & (far < parameters.lidar_max_m - 0.01)
    scan = Georeferencer(parameters).georeference(
        returns_of(xyz[keep], stamps[keep]), flight.history(parameters)
    )
    assert np.abs(scan.points_enu_m - targets[keep]).max() < 1e-3
    np.testing.assert_array_equal(scan.stamp_ns, stamps[keep])


def test_an_erratic_flight_is_placed_as_plain_loops_place_it() -> None:
    """Every sample turns and moves the vehicle elsewhere, so that each return needs its own two samples."""
    rng = np.random.default_rng(6)
    times = 30 * MS * np.arange(40)
    attitudes = Rotation.random(40, random_state=rng)
    positions = np.array([0.0, 0, 20]) + np.cumsum(rng.uniform(-0.3, 0.3, (40, 3)), axis=0)
    velocities = rng.uniform(-5, 5, (40, 3))
    history = PoseHistory(TILTED, HOME)
    for i, stamp in enumerate(times.tolist()):
        x, y, z, w = attitudes[i].as_quat()
        history.add_attitude(stamp + 11 * MS, (w, x, y, z), (0, 0, 0))
        history.add_position(stamp, *HOME.lla(positions[i]), velocities[i][[1, 0, 2]] * [1, 1, -1])
    stamps = np.sort(rng.integers(11 * MS, times[-1], 2000))
    xyz = rng.uniform(2, 20, (2000, 3)).astype(np.float32)
    scan = Georeferencer(TILTED).georeference(returns_of(xyz, stamps), history)

    track = CubicHermiteSpline(times * 1e-9, positions, velocities)
    ned_from_frd = Slerp(times + 11 * MS, attitudes)(stamps)
    frd_from_flu = rotation_frd_from_sensor(10, -35, 120)
    for i, stamp in enumerate(stamps):
        body = frd_from_flu @ xyz[i] + [0.3, -0.2, 0.5]
        expected = track(stamp * 1e-9) + ENU_FROM_NED @ ned_from_frd[i].apply(body)
        np.testing.assert_allclose(scan.points_enu_m[i], expected, atol=1e-6)


@pytest.mark.parametrize("lacking", ["attitude", "position"])
def test_no_return_is_placed_in_a_gap_of_either_stream(lacking: str) -> None:
    p = Parameters()
    flight, history, georeferencer = Flight(), PoseHistory(p, HOME), Georeferencer(p)
    for stamp in range(0, 3000 * MS, 20 * MS):
        in_gap = 1000 * MS < stamp < 1600 * MS
        if not (in_gap and lacking == "attitude"):
            flight.report_attitude(history, stamp)
        if not (in_gap and lacking == "position"):
            flight.report_position(history, stamp)
    stamps = np.array([990, 1001, 1300, 1599, 1601]) * MS
    scan = georeferencer.georeference(returns_of(np.full((5, 3), 4.0), stamps), history)
    assert (scan.stamp_ns // MS).tolist() == [990, 1601]
    assert georeferencer.without_pose == 3


@pytest.mark.parametrize(
    ("times_ms", "most_pitch_deg", "placed"),
    [([20, 500, 980], 20.0, 3), ([20, 500, 980], 5.0, 0), ([20, 500, 1500], 20.0, 0)],  # the last in a gap
)
def test_returns_that_bear_little_pitch_are_placed_together_or_not_at_all(
    times_ms: list[int], most_pitch_deg: float, placed: int
) -> None:
    p = Parameters(lidar_pitch_deg=0)
    flight, history = Flight(first_ned=(0, np.radians(10), 0), rates_frd=(0, 0, 0)), PoseHistory(p, HOME)
    for stamp in range(0, 1000 * MS, 20 * MS):
        flight.report_attitude(history, stamp)
        flight.report_position(history, stamp)
    some = returns_of(np.full((3, 3), 4.0), np.array(times_ms) * MS)
    georeferencer = Georeferencer(p)
    scan = georeferencer.georeference(replace(some, most_pitch_rad=np.radians(most_pitch_deg)), history)
    assert (0 if scan is None else len(scan.stamp_ns), georeferencer.pitched) == (placed, 3 - placed)


def test_no_return_is_placed_across_a_jump_of_the_estimate() -> None:
    p = Parameters()
    flight, history = Flight(), PoseHistory(p, HOME)
    moved = Flight(start_enu_m=(9.0, -4.0, 30.0))
    for stamp in range(0, 1000 * MS, 20 * MS):
        flight.report_attitude(history, stamp)
        (flight if stamp < 500 * MS else moved).report_position(history, stamp)
    stamps = np.array([470, 490, 510]) * MS
    scan = Georeferencer(p).georeference(returns_of(np.full((3, 3), 4.0), stamps), history)
    assert (scan.stamp_ns // MS).tolist() == [470, 510]


def test_the_ground_stays_flat_under_a_vehicle_that_spins_and_climbs() -> None:
    flight = Flight(rates_frd=(0.8, -0.5, 2.0), velocity_enu_ms=(8.0, -6.0, 2.0))
    p = Parameters()
    rng = np.random.default_rng(5)
    stamps = np.sort(rng.integers(10 * MS, 1000 * MS, 4000))
    ground = np.column_stack([rng.uniform(-20, 20, (4000, 2)), np.zeros(4000)])
    scan = Georeferencer(p).georeference(
        returns_of(sensor_points(flight, p, ground, stamps * 1e-9), stamps), flight.history(p)
    )
    assert np.abs(scan.points_enu_m[:, 2]).max() < 2e-3


def test_the_scan_tells_where_the_sensor_was_at_its_last_return() -> None:
    flight = Flight()
    scan = Georeferencer(TILTED).georeference(
        returns_of(np.full((3, 3), 4.0), np.array([500, 700, 900]) * MS), flight.history(TILTED)
    )
    expected = flight.position_enu_m(np.float64(0.9)) + flight.enu_from_frd(0.9) @ [0.3, -0.2, 0.5]
    np.testing.assert_allclose(scan.sensor_enu_m, expected, atol=1e-5)


def test_returns_out_of_range_or_without_a_pose_are_counted() -> None:
    p = Parameters()
    georeferencer = Georeferencer(p)
    xyz = [[0.5, 0, 0], [p.lidar_min_m + 1e-3, 0, 0], [0, 69.9, 0], [0, 0, 70.1], [np.nan, 1, 1], [5, 5, 5]]
    stamps = np.array([100, 100, 100, 100, 100, 3000]) * MS
    scan = georeferencer.georeference(returns_of(np.array(xyz), stamps), Flight().history(p))
    assert len(scan) == 2
    assert (georeferencer.out_of_range, georeferencer.without_pose) == (3, 1)


def test_no_scan_comes_of_no_frame_or_no_pose() -> None:
    p = Parameters()
    batch = returns_of(np.full((2, 3), 4.0), np.array([9000, 9001]) * MS)
    georeferencer = Georeferencer(p)
    assert georeferencer.georeference(batch, PoseHistory(p)) is None
    assert georeferencer.georeference(batch, Flight().history(p)) is None
    assert georeferencer.without_pose == 4


def test_overtaken_returns_come_in_order_of_time() -> None:
    stamps = np.array([100, 300, 200]) * MS
    xyz = np.array([[1.0, 0, 0], [3, 0, 0], [2, 0, 0]])
    history = Flight().history(Parameters())
    scan = Georeferencer(Parameters()).georeference(returns_of(xyz, stamps), history)
    assert scan.stamp_ns.tolist() == [100 * MS, 200 * MS, 300 * MS]
    sorted_scan = Georeferencer(Parameters()).georeference(
        returns_of(xyz[[0, 2, 1]], np.sort(stamps)), history
    )
    np.testing.assert_allclose(scan.points_enu_m, sorted_scan.points_enu_m, atol=1e-9)


def test_the_sensor_s_place_is_known_where_the_last_return_has_the_stamp_of_the_last_pose() -> None:
    """Seconds without poses follow, so that nothing lies between that pose and the next."""
    history, ms = PoseHistory(Parameters()), 1_000_000
    for stamp in [*range(0, 4000, 20), 9000, 9020]:
        history.add_attitude(stamp * ms, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        history.add_position(stamp * ms, 47.0, 8.0, 400.0, (0.0, 0.0, 0.0))
    stamps = np.array([3979, 3980], np.int64) * ms
    returns = Returns.plain(np.array([[5.0, 0.0, 0.0]] * 2, np.float32), stamps)
    scan = Georeferencer(Parameters()).georeference(returns, history)
    assert scan is not None
    assert np.isfinite(scan.sensor_enu_m).all()
