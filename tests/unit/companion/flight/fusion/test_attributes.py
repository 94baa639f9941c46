"""Attributes of returns and lost rays through range gate, filter and placement."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.georeference import Georeferencer
from companion.flight.fusion.vehicle_and_dust_filter import VehicleAndDustFilter
from companion.flight.sensors.returns import Returns
from params import Parameters
from slz import Scan
from slz.window import LOST_M
from tests.unit.companion.flight.fusion.flights import FRD_FROM_FLU, MS, Flight, returns_of

P = Parameters(
    lidar_x_m=0.3, lidar_y_m=-0.2, lidar_z_m=0.5, lidar_roll_deg=10, lidar_pitch_deg=-35, lidar_yaw_deg=120
)
FLIGHT = Flight()
N, LOST = 500, 3_000
WHITE = 100.0


def measured(n: int = N, lost: int = LOST, seed: int = 0) -> Returns:
    """Returns whose intensity, echo and echoes tell their index, and lost rays in all directions."""
    rng = np.random.default_rng(seed)
    stamps = np.sort(rng.integers(10 * MS, 1990 * MS, n))
    xyz = rng.normal(size=(n, 3))
    xyz *= rng.uniform(0.05, 60, (n, 1)) / np.linalg.norm(xyz, axis=1)[:, None]
    unit = rng.normal(size=(lost, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    index = np.arange(n)
    return Returns(
        xyz.astype(np.float32),
        stamps,
        index.astype(np.float32),
        np.zeros(n, np.uint8),
        (1 + index % 2).astype(np.uint8),
        np.full(n, 2, np.uint8),
        lost=unit.astype(np.float32),
        lost_ns=rng.integers(10 * MS, 1990 * MS, lost),
        lost_weight=11.0,
        white=WHITE,
    )


def placed(returns: Returns) -> Scan:
    scan = Georeferencer(P).georeference(returns, FLIGHT.history(P))
    assert scan is not None
    return scan


def test_attributes_follow_their_returns_through_gate_and_order() -> None:
    shuffle = np.random.default_rng(1).permutation(N)
    in_order = measured()
    for returns in (in_order, in_order.select(shuffle)):
        scan = placed(returns)
        assert scan.attributes is not None
        index = np.rint(scan.attributes.intensity * WHITE).astype(int)
        distance = np.linalg.norm(in_order.xyz_sensor_m, axis=1)
        gate = (distance >= P.lidar_min_m) & (distance <= P.lidar_max_m)
        assert sorted(index.tolist()) == np.flatnonzero(gate).tolist()
        assert 0 < len(scan) < N
        np.testing.assert_array_equal(scan.stamp_ns, in_order.stamp_ns[index])
        np.testing.assert_array_equal(scan.attributes.echo, 1 + index % 2)
        assert set(scan.attributes.echoes) == {2}


def test_intensity_on_an_unknown_scale_tells_nothing() -> None:
    found = placed(replace(measured(), white=math.nan)).attributes
    assert found is not None
    assert np.isnan(found.intensity).all()


def test_lost_rays_are_placed_with_the_pose_at_their_own_stamp() -> None:
    returns = measured()
    found = placed(returns).attributes
    assert found is not None
    flu = Rotation.from_euler("ZYX", [P.lidar_yaw_deg, P.lidar_pitch_deg, P.lidar_roll_deg], degrees=True)
    lever = np.array([P.lidar_x_m, P.lidar_y_m, P.lidar_z_m])
    ends, origins = [], []
    for direction, stamp_ns in zip(returns.lost, returns.lost_ns, strict=True):
        turn, at = FLIGHT.enu_from_frd(stamp_ns * 1e-9), FLIGHT.position_enu_m(np.float64(stamp_ns * 1e-9))
        along = turn @ FRD_FROM_FLU @ flu.apply(direction.astype(float))
        origin = at + turn @ lever
        if np.degrees(np.arcsin(along[2])) <= -5:
            origins.append(origin)
            ends.append(origin + LOST_M * along)
    assert LOST / 3 < len(ends) < LOST / 2
    assert len(found.lost_enu_m) == len(ends)
    np.testing.assert_allclose(found.lost_enu_m, ends, atol=2e-3)
    np.testing.assert_allclose(found.lost_origin_enu_m, origins, atol=1e-3)
    assert set(found.lost_weight) == {11.0}


def test_lost_rays_without_a_pose_or_direction_are_left_out() -> None:
    returns = measured(lost=4)
    lost_ns = returns.lost_ns.copy()
    lost_ns[1] = 50_000 * MS
    down = np.tile(np.float32(measured_down()), (4, 1))
    down[2] = np.nan
    found = placed(replace(returns, lost=down, lost_ns=lost_ns)).attributes
    assert found is not None
    assert len(found.lost_enu_m) == len(found.lost_origin_enu_m) == 2
    assert np.isfinite(found.lost_enu_m).all()


def measured_down() -> np.ndarray:
    """Return the direction of the sensor's frame that is down when the body is level; it is nearly so."""
    flu = Rotation.from_euler("ZYX", [P.lidar_yaw_deg, P.lidar_pitch_deg, P.lidar_roll_deg], degrees=True)
    return np.asarray(flu.inv().apply(FRD_FROM_FLU @ [0.0, 0.0, 1.0]))


def test_points_and_stamps_are_the_same_bits_with_and_without_lost_rays() -> None:
    returns = measured()
    bare = Returns.plain(returns.xyz_sensor_m, returns.stamp_ns)
    scan, plain = placed(returns), placed(bare)
    np.testing.assert_array_equal(scan.points_enu_m, plain.points_enu_m)
    np.testing.assert_array_equal(scan.stamp_ns, plain.stamp_ns)
    np.testing.assert_array_equal(scan.sensor_enu_m, plain.sensor_enu_m)
    assert plain.attributes is None


@pytest.mark.parametrize(("echo", "echoes"), [(3, 2), (0, 2), (1, 0), (0, 0)])
def test_contradictory_return_numbers_and_constant_intensity_are_carried(echo: int, echoes: int) -> None:
    returns = measured()
    wrong = replace(
        returns,
        intensity=np.full(N, 255, np.uint8),
        echo=np.full(N, echo, np.uint8),
        echoes=np.full(N, echoes, np.uint8),
    )
    found = placed(wrong).attributes
    assert found is not None
    np.testing.assert_allclose(found.intensity, 255.0 / WHITE)
    assert not found.echoes.any()
    assert not found.echo.any()


def test_the_ray_of_a_dropped_return_is_not_lost() -> None:
    returns = measured()
    kept = VehicleAndDustFilter(Parameters(dust_reach_m=30.0)).filter(returns)
    assert 0 < len(kept) < N
    np.testing.assert_array_equal(kept.lost, returns.lost)
    np.testing.assert_array_equal(kept.lost_ns, returns.lost_ns)


def test_a_near_return_without_intensity_is_weak_as_before() -> None:
    near = returns_of(np.array([[1.0, 0, 0], [9.0, 0, 0]]), np.array([0, 1]))
    dust = VehicleAndDustFilter(Parameters(dust_reach_m=3.0))
    assert len(dust.filter(near)) == 1
    assert dust.dust == 1


def test_lost_rays_reach_the_scan_and_count_against_the_buffer(monkeypatch: pytest.MonkeyPatch) -> None:
    scans: list[Scan] = []
    returns = measured()
    history = FLIGHT.history(P)
    ScanAssembler(P, history, scans.append).add(returns)
    assert sum(len(s.attributes.lost_enu_m) for s in scans if s.attributes is not None) > LOST / 3
    monkeypatch.setattr("companion.flight.fusion.assembler.MOST_WAITING", LOST)
    full = ScanAssembler(P, history, scans.append)
    full.add(replace(returns, stamp_ns=returns.stamp_ns + 10**12))
    assert full.stale == N
