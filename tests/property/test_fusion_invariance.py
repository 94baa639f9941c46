"""Invariance of fusion under translation and rotation of the world, for any flight and mount."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.georeference import Georeferencer
from companion.flight.fusion.pose_history import PoseHistory
from params import Parameters
from slz import LocalFrame
from tests.unit.companion.flight.fusion.flights import returns_of

MS = 1_000_000
HOME = LocalFrame(47.0, 8.0, 400.0)
Floats = NDArray[np.float64]

angles = st.floats(-180, 180)
vectors = st.tuples(*[st.floats(-3, 3)] * 3)


def placed(
    parameters: Parameters, rotvec: Floats, rates: Floats, velocity_enu: Floats, start_enu: Floats, yaw: float
) -> Floats:
    """Place fixed returns of a flight that is turned about the vertical through the origin and shifted."""
    history = PoseHistory(parameters, HOME)
    turn_ned = Rotation.from_rotvec([0, 0, yaw])
    turn_enu = Rotation.from_rotvec([0, 0, -yaw])
    for stamp in range(0, 200 * MS, 20 * MS):
        t = stamp * 1e-9
        x, y, z, w = (turn_ned * Rotation.from_rotvec(rotvec) * Rotation.from_rotvec(t * rates)).as_quat()
        history.add_attitude(stamp, (w, x, y, z), rates)
        lat, lon, alt = HOME.lla(start_enu + turn_enu.apply(t * velocity_enu))
        east, north, up = turn_enu.apply(velocity_enu)
        history.add_position(stamp, lat, lon, alt, (north, east, -up))
    rng = np.random.default_rng(0)
    returns = returns_of(rng.uniform(2, 20, (50, 3)), np.linspace(1 * MS, 179 * MS, 50).astype(np.int64))
    scan = Georeferencer(parameters).georeference(returns, history)
    assert scan is not None
    assert len(scan) == 50
    return scan.points_enu_m.copy()


@settings(max_examples=40, deadline=None)
@given(vectors, vectors, vectors, angles, angles, angles, st.floats(-np.pi, np.pi), vectors)
def test_turning_and_shifting_the_flight_turns_and_shifts_the_points(
    rotvec: tuple[float, ...],
    rates: tuple[float, ...],
    velocity: tuple[float, ...],
    roll: float,
    pitch: float,
    yaw_deg: float,
    turn: float,
    shift: tuple[float, ...],
) -> None:
    p = Parameters(lidar_roll_deg=roll, lidar_pitch_deg=pitch, lidar_yaw_deg=yaw_deg)
    flight = p, np.array(rotvec), np.array(rates), np.array(velocity)
    base = placed(*flight, np.zeros(3), 0.0)
    moved = placed(*flight, np.array(shift), turn)
    expected = Rotation.from_rotvec([0, 0, -turn]).apply(base) + shift
    np.testing.assert_allclose(moved, expected, atol=1e-5)


@settings(max_examples=40, deadline=None)
@given(vectors, angles, angles, angles)
def test_placing_keeps_distances_when_the_vehicle_stands_still(
    rotvec: tuple[float, ...], roll: float, pitch: float, yaw_deg: float
) -> None:
    p = Parameters(lidar_roll_deg=roll, lidar_pitch_deg=pitch, lidar_yaw_deg=yaw_deg)
    points = placed(p, np.array(rotvec), np.zeros(3), np.zeros(3), np.zeros(3), 0.0)
    sensor = np.random.default_rng(0).uniform(2, 20, (50, 3)).astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(points, axis=0), axis=1),
        np.linalg.norm(np.diff(sensor, axis=0), axis=1),
        atol=1e-6,
    )
