"""Simulated VLP-16: packets as in the manual, time, mount, and dual mode."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.optics import Noise
from sitl.sensors.sensor_clock import Clock
from sitl.sensors.velodyne_packets import PACKET, ReturnMode
from sitl.sensors.vlp16 import ELEVATION_DEG, SIDEWAYS, Vlp16
from tests.unit.sitl.still_world import flat_world, hover

MS = 1_000_000
CLOCK = Clock(offset_ns=1_000_000, drift_ppb=0)
CENTRED = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=90.0)


def lidar(seed: int = 1, **options: object) -> Vlp16:
    settings: dict[str, object] = {"clock": CLOCK, "noise": Noise.none(), "mount": CENTRED} | options
    return Vlp16(np.random.default_rng(seed), **settings)  # type: ignore[arg-type]


def test_a_packet_is_twelve_blocks_of_two_firing_sequences() -> None:
    assert PACKET.itemsize == 1206
    packets = lidar().scan(0, 100 * MS, hover(), flat_world())
    assert {len(packet) for packet in packets} == {1206}
    read = np.array([np.frombuffer(packet, PACKET)[0] for packet in packets])
    assert (read["blocks"]["flag"] == 0xEEFF).all()
    assert (set(read["mode"]), set(read["model"])) == ({0x37}, {0x22})
    assert set(np.diff(read["stamp"].astype(int))) == {1327, 1328}
    turned = np.diff(read["blocks"]["azimuth"].ravel().astype(int)) % 36_000
    assert set(turned) == {39, 40}
    assert len(packets) == 100_000_000 // (24 * 55_296)


def test_the_head_sweeps_the_ground_from_side_to_side() -> None:
    """Pitch 90 turns the axis forward and azimuth 0 down."""
    assert (SIDEWAYS.roll_deg, SIDEWAYS.pitch_deg, SIDEWAYS.yaw_deg) == (0.0, 90.0, 0.0)
    sensor = lidar()
    shots = sensor.shots(0, 100 * MS, hover(heading_deg=70.0), flat_world())
    hit = shots.echoes.range_m > 0
    frd = sensor.points_m(shots)[hit] @ CENTRED.rotation_frd_from_sensor().T
    np.testing.assert_allclose(frd[:, 2], 10.0, atol=1e-6)
    assert (frd[:, 1].min(), frd[:, 1].max()) == pytest.approx((-50, 50), rel=0.2)
    below = np.abs(frd[:, 1]) < 0.5
    reach = 10 * np.tan(np.radians(15))
    assert (frd[below, 0].min(), frd[below, 0].max()) == pytest.approx((-reach, reach), abs=0.05)
    left = np.degrees(np.arctan2(-frd[:, 1], frd[:, 2]))
    azimuth = (sensor.azimuth_deg(shots.index)[hit] + 180) % 360 - 180
    level = np.abs(ELEVATION_DEG[shots.index[hit] % 16]) == 1
    np.testing.assert_allclose(left[level], -azimuth[level], atol=1e-6)  # it turns to the right


@pytest.mark.parametrize("mode", list(ReturnMode))
def test_output_does_not_depend_on_how_time_is_cut(mode: ReturnMode) -> None:
    world, noisy = flat_world(), Noise(dropout=0.05, ghost=0.02, dust=0.02)
    whole = lidar(noise=noisy, mode=mode).scan(0, 50 * MS, hover(), world)
    sensor, cut = lidar(noise=noisy, mode=mode), [0, 1, 333_333, 7 * MS, 7 * MS + 1, 20 * MS, 50 * MS]
    pieces = [packet for begin, end in pairwise(cut) for packet in sensor.scan(begin, end, hover(), world)]
    assert pieces == whole


def test_in_dual_mode_a_packet_spans_half_the_time_and_dust_is_the_second_strongest() -> None:
    noisy = Noise(0.0, 0.0, 0.0, ghost=0.0, dust=0.05)
    packets = lidar(noise=noisy, mode=ReturnMode.DUAL).scan(0, 50 * MS, hover(), flat_world())
    blocks = np.array([np.frombuffer(packet, PACKET)[0] for packet in packets])["blocks"]
    last, strongest = blocks[:, ::2], blocks[:, 1::2]
    np.testing.assert_array_equal(last["azimuth"], strongest["azimuth"])
    assert set(np.diff(last["azimuth"].ravel().astype(int)) % 36_000) == {39, 40}
    far, near = (both["channels"]["distance"].astype(int) for both in (last, strongest))
    dust = near != far
    assert (near[dust] < far[dust]).all()
    assert dust.sum() / (far > 0).sum() == pytest.approx(0.05, abs=0.02)


def test_at_a_lower_rate_packets_stay_away_whole() -> None:
    """A packet with rays that were not traced would tell of rays that came to nothing."""
    full = lidar().scan(0, 100 * MS, hover(), flat_world())
    assert lidar(point_rate_hz=50_000).scan(0, 100 * MS, hover(), flat_world()) == full[::6]


def test_switched_on_again_it_begins_with_a_whole_sequence() -> None:
    sensor, world = lidar(), flat_world()
    sensor.scan(0, 1 * MS, hover(), world)
    packets = sensor.scan(50 * MS, 53 * MS, hover(), world)
    stamp = int(np.frombuffer(packets[0], PACKET)["stamp"][0])
    assert stamp == pytest.approx(51_000, abs=111)  # the clock was at 1 ms
