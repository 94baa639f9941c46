"""Simulated Mid-360: its frame, its timing, its errors, and the effect of motion on a scan."""

from __future__ import annotations

import struct
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.livox_packets import DataType
from sitl.sensors.mid360 import Mid360
from sitl.sensors.mid360_pattern import angles_rad
from sitl.sensors.optics import Noise
from sitl.sensors.sensor_clock import Clock
from sitl.world.primitives import Box, Kind
from sitl.world.world import World
from tests.unit.sitl.still_world import flat_world, hover

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
MS = 1_000_000
CLOCK = Clock(offset_ns=1_000_000, drift_ppb=0)
CENTRED = Mount(lever_frd_m=(0.0, 0.0, 0.0))
RECORD = np.dtype([("xyz", "<i4", 3), ("reflectivity", "u1"), ("tag", "u1")])


def decode(packets: list[bytes]) -> tuple[F64, I64, NDArray[np.void]]:
    """Return points (m), their stamps (ns) and the raw records of Cartesian 32-bit packets."""
    records, stamps = [], []
    for packet in packets:
        interval, dots = struct.unpack_from("<HH", packet, 3)
        (stamp,) = struct.unpack_from("<Q", packet, 28)
        records.append(np.frombuffer(packet, RECORD, dots, 36))
        stamps.append(stamp + np.arange(dots) * interval * 100 // (dots - 1))
    raw = np.concatenate(records)
    return raw["xyz"] / 1000.0, np.concatenate(stamps), raw


def lidar(seed: int = 1, **options: object) -> Mid360:
    settings: dict[str, object] = {"clock": CLOCK, "noise": Noise.none(), "mount": CENTRED} | options
    return Mid360(np.random.default_rng(seed), **settings)  # type: ignore[arg-type]


def test_pattern_fills_the_field_of_view_and_no_two_frames_repeat() -> None:
    index = np.arange(200_000)
    azimuth, elevation = (np.degrees(a) for a in angles_rad(index, index * 5000)[:2])
    assert (elevation.min(), elevation.max()) == pytest.approx((-7.0, 52.0), abs=0.05)
    share, _ = np.histogram(azimuth % 360.0, 36, (0.0, 360.0))
    assert share.min() > 0.9 * share.mean()
    square = (azimuth % 360.0).astype(int) * 100 + (elevation + 7.0).astype(int)
    assert len(np.unique(square)) > 1.3 * len(np.unique(square[:20_000]))  # one frame leaves gaps


def test_default_mount_looks_straight_down_with_the_middle_of_its_view() -> None:
    """Derived in Mount: pitch 112.5 deg; checked here with SciPy's rotations."""
    mount = Mount()
    assert (mount.roll_deg, mount.pitch_deg, mount.yaw_deg) == (0.0, 112.5, 0.0)
    flu = Rotation.from_euler("ZYX", [0.0, 112.5, 0.0], degrees=True).as_matrix()
    np.testing.assert_allclose(mount.rotation_frd_from_sensor(), np.diag([1, -1, -1]) @ flu, atol=1e-12)
    for elevation_deg, ahead_deg in ((22.5, 0.0), (-7.0, -29.5), (52.0, 29.5)):
        e = np.radians(elevation_deg)
        frd = mount.rotation_frd_from_sensor() @ [np.cos(e), 0.0, np.sin(e)]
        assert np.degrees(np.arctan2(frd[0], frd[2])) == pytest.approx(ahead_deg, abs=1e-9)
        assert frd[1] == pytest.approx(0.0, abs=1e-12)


def test_boresight_angles_are_yaw_then_pitch_then_roll_about_the_turned_axes() -> None:
    mount = Mount(roll_deg=20.0, pitch_deg=-35.0, yaw_deg=110.0)
    flu = Rotation.from_euler("ZYX", [110.0, -35.0, 20.0], degrees=True).as_matrix()
    np.testing.assert_allclose(mount.rotation_frd_from_sensor(), np.diag([1, -1, -1]) @ flu, atol=1e-12)


def test_flat_ground_below_is_seen_under_the_vehicle_ahead_behind_and_to_both_sides() -> None:
    points, _, _ = decode(lidar().scan(0, 200 * MS, hover(heading_deg=90.0), flat_world()))
    seen = points[np.any(points != 0.0, axis=1)]
    frd = seen @ Mount().rotation_frd_from_sensor().T
    np.testing.assert_allclose(frd[:, 2], 10.0, atol=0.002)  # heading does not change the height
    near_track = np.abs(frd[:, 1]) < 0.5
    reach = 10.0 * np.tan(np.radians(29.5))
    assert frd[near_track, 0].min() == pytest.approx(-reach, abs=0.3)
    assert frd[near_track, 0].max() == pytest.approx(reach, abs=0.3)
    below = np.hypot(frd[:, 0], frd[:, 1]) < 2.0
    assert below.sum() > 300
    assert frd[:, 1].min() < -25.0
    assert frd[:, 1].max() > 25.0


@pytest.mark.parametrize(("heading_deg", "expected"), [(0.0, (0.0, 3.0)), (90.0, (3.0, 0.0)), (200.0, None)])
def test_an_object_ahead_is_measured_ahead_in_the_body(
    heading_deg: float, expected: tuple[float, float] | None
) -> None:
    """A block 3 m ahead of the vehicle appears at +3 m on the body's x axis, whatever the heading."""
    heading = np.radians(heading_deg)
    x, y = 3.0 * np.sin(heading), 3.0 * np.cos(heading)
    if expected:
        assert (x, y) == pytest.approx(expected, abs=1e-9)
    world = World(flat_world().ground, [Box(x, y, 0.0, 1.0, 1.0, 2.0)])
    mount = Mount(lever_frd_m=(0.5, -0.2, 0.3))
    points, _, _ = decode(lidar(mount=mount).scan(0, 200 * MS, hover(heading_deg=heading_deg), world))
    frd = points @ mount.rotation_frd_from_sensor().T + mount.lever_frd_m
    top = frd[np.any(points != 0.0, axis=1) & (frd[:, 2] < 8.002)]
    assert len(top) > 20
    assert (top[:, 0].mean(), top[:, 1].mean()) == pytest.approx((3.0, 0.0), abs=0.12)


def test_points_land_where_they_were_measured_when_placed_with_the_pose_of_their_own_stamp() -> None:
    world, mount = flat_world(), Mount(lever_frd_m=(0.3, 0.1, -0.2))

    def turning(stamps: I64) -> tuple[F64, F64]:
        t = stamps * 1e-9
        position = np.column_stack([6.0 * t, -2.0 * t, 12.0 + 1.5 * t])
        attitude = Rotation.from_euler("ZYX", np.column_stack([1.5 * t, 0.1 * np.sin(9 * t), 0.2 * t]))
        return position, attitude.as_quat(scalar_first=True)

    points, stamps, _ = decode(lidar(mount=mount).scan(0, 300 * MS, turning, world))
    keep = np.any(points != 0.0, axis=1)
    position, quat = turning(stamps[keep] - CLOCK.offset_ns)
    ned_from_frd = Rotation.from_quat(quat, scalar_first=True)
    flu = Rotation.from_euler("ZYX", [0.0, 112.5, 0.0], degrees=True)
    body = flu.apply(points[keep]) * [1, -1, -1] + mount.lever_frd_m
    ned = ned_from_frd.apply(body)
    z = position[:, 2] - ned[:, 2]
    np.testing.assert_allclose(z, 0.0, atol=0.003)  # millimetres on the wire
    frozen = Rotation.from_quat(quat[0], scalar_first=True).apply(body)
    assert np.abs(position[0, 2] - frozen[:, 2]).max() > 0.5  # one pose for the whole scan is wrong


def test_output_does_not_depend_on_how_time_is_cut() -> None:
    world, noisy = flat_world(), Noise(dropout=0.05, ghost=0.02, dust=0.02)
    whole = lidar(noise=noisy).scan(0, 50 * MS, hover(), world)
    pieces: list[bytes] = []
    cut, sensor = [0, 1, 333_333, 7 * MS, 7 * MS + 1, 20 * MS, 50 * MS], lidar(noise=noisy)
    for begin, end in pairwise(cut):
        pieces += sensor.scan(begin, end, hover(), world)
    assert pieces == whole
    assert lidar(seed=2, noise=noisy).scan(0, 50 * MS, hover(), world) != whole


def test_packets_count_up_and_stamps_are_evenly_spaced_on_the_sensor_clock() -> None:
    sensor = lidar(clock=Clock(offset_ns=77, drift_ppb=0))
    packets = sensor.scan(0, 100 * MS, hover(), flat_world())
    assert len(packets) == 20_000 // 96
    assert {len(p) for p in packets} == {36 + 96 * 14}
    assert [struct.unpack_from("<H", p, 7)[0] for p in packets] == list(range(len(packets)))
    assert [struct.unpack_from("<Q", p, 28)[0] for p in packets] == [77 + 480_000 * k for k in range(208)]
    assert {struct.unpack_from("<H", p, 3)[0] for p in packets} == {4750}
    assert {p[9] for p in packets} == {0}


def test_documented_counters_restart_with_every_frame() -> None:
    packets = lidar(frame_restart=True).scan(0, 250 * MS, hover(), flat_world())
    counters = [(p[9], struct.unpack_from("<H", p, 7)[0]) for p in packets]
    assert [c for c in counters if c[1] == 0] == [(0, 0), (1, 0), (2, 0)]


def test_a_fast_clock_gains_what_its_drift_says_and_fires_at_the_right_simulated_time() -> None:
    asked: list[I64] = []

    def watched(stamps: I64) -> tuple[F64, F64]:
        asked.append(stamps)
        return hover()(stamps)

    clock = Clock(offset_ns=0, drift_ppb=100_000)
    sensor = lidar(clock=clock, point_rate_hz=20_000)
    packets: list[bytes] = []
    for k in range(0, 2000, 50):
        packets += sensor.scan(k * MS, (k + 50) * MS, watched, flat_world())
    stamps = np.concatenate(asked)
    assert stamps.min() >= 0
    assert stamps.max() < 2000 * MS
    assert (np.diff(stamps) > 0).all()
    assert len(stamps) == 40_004  # 100 ppm of 40 000 pulses
    last = struct.unpack_from("<Q", packets[-1], 28)[0]
    fired = stamps[96 * (len(packets) - 1)]
    assert last - fired == pytest.approx(fired * 100e-6, abs=2)


def test_a_sensor_switched_off_and_on_starts_with_fresh_packets() -> None:
    sensor, world = lidar(), flat_world()
    sensor.scan(0, 1 * MS, hover(), world)
    packets = sensor.scan(50 * MS, 51 * MS, hover(), world)
    assert struct.unpack_from("<Q", packets[0], 28)[0] - CLOCK.offset_ns == 50 * MS


def test_pulses_without_return_are_zeros() -> None:
    points, _, raw = decode(lidar().scan(0, 20 * MS, hover(z=100.0), flat_world()))
    assert not points.any()
    assert not raw["reflectivity"].any()


@pytest.mark.parametrize(("height_m", "visible"), [(38.0, True), (50.0, False)])
def test_dark_ground_is_lost_beyond_its_range(height_m: float, visible: bool) -> None:
    points, _, _ = decode(lidar().scan(0, 100 * MS, hover(z=height_m), flat_world(Kind.ASPHALT)))
    assert bool(np.count_nonzero(points[:, 2]) > 500) is visible


def test_errors_have_the_size_the_data_sheet_gives() -> None:
    world = flat_world()
    noisy = Noise(range_sigma_m=0.02, angle_sigma_deg=0.0, dropout=0.1, ghost=0.0, dust=0.0)
    exact, _, _ = decode(lidar().scan(0, 100 * MS, hover(), world))
    points, _, _ = decode(lidar(noise=noisy).scan(0, 100 * MS, hover(), world))
    was, now = np.linalg.norm(exact, axis=1), np.linalg.norm(points, axis=1)
    both = (was > 0) & (now > 0)
    assert (now - was)[both].std() == pytest.approx(0.02, rel=0.05)
    assert 1 - both.sum() / (was > 0).sum() == pytest.approx(0.1, abs=0.02)
    tilted = Noise(range_sigma_m=0.0, angle_sigma_deg=0.15, dropout=0.0, ghost=0.0, dust=0.0)
    points, _, _ = decode(lidar(noise=tilted).scan(0, 100 * MS, hover(), world))
    frd = points[both] @ Mount().rotation_frd_from_sensor().T
    down, out = frd[:, 2], np.hypot(frd[:, 0], frd[:, 1])
    ring = np.abs(out - 10.0) < 0.5  # at 45 deg a tilt by a moves a point's height by 20 m * a / 2
    per_axis = np.radians(0.15) / np.sqrt(2)
    assert (down[ring] - 10.0).std() == pytest.approx(10.0 * per_axis, rel=0.1)


def test_ghosts_lie_too_far_dust_too_near_and_most_are_tagged() -> None:
    noisy = Noise(0.0, 0.0, 0.0, ghost=0.05, dust=0.05, tagged=0.7)
    exact, _, _ = decode(lidar().scan(0, 50 * MS, hover(), flat_world()))
    points, _, raw = decode(lidar(noise=noisy).scan(0, 50 * MS, hover(), flat_world()))
    was, now = np.linalg.norm(exact, axis=1), np.linalg.norm(points, axis=1)
    hit = was > 0
    far, near = hit & (now > 1.04 * was), (now > 0) & (now < 0.98 * np.where(hit, was, np.inf))
    assert far.sum() / hit.sum() == pytest.approx(0.05, abs=0.015)
    assert (raw["tag"][far] == 16).mean() == pytest.approx(0.7, abs=0.1)
    assert (raw["tag"][near] == 4).mean() == pytest.approx(0.7, abs=0.1)
    assert (raw["tag"][~far & ~near] == 0).all()


@pytest.mark.parametrize(("rate", "dots"), [(200_000, 96), (20_000, 96), (10_000, 66)])
def test_a_slow_sensor_sends_shorter_packets_rather_than_a_wrong_interval(rate: int, dots: int) -> None:
    packets = lidar(point_rate_hz=rate).scan(0, 50 * MS, hover(), flat_world())
    interval, count = struct.unpack_from("<HH", packets[0], 3)
    assert count == dots
    assert interval * 100 == (dots - 1) * 1_000_000_000 // rate


def test_other_formats_carry_the_same_points() -> None:
    exact, _, _ = decode(lidar().scan(0, 5 * MS, hover(), flat_world()))
    packets = lidar(data_type=DataType.CARTESIAN_16).scan(0, 5 * MS, hover(), flat_world())
    raw = np.concatenate([np.frombuffer(p, "<i2,<i2,<i2,u1,u1", 96, 36) for p in packets])
    np.testing.assert_allclose(raw["f2"] / 100.0, exact[:, 2], atol=0.006)


def test_a_rate_without_a_whole_period_is_refused() -> None:
    with pytest.raises(ValueError, match="does not divide"):
        lidar(point_rate_hz=30_000_001)
