"""Simulated Ouster: packets as in the manual, time and mount."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.optics import Noise
from sitl.sensors.ouster_os1 import COLUMNS, ROWS, Ouster
from sitl.sensors.ouster_packets import packet_type
from sitl.sensors.sensor_clock import Clock
from tests.unit.sitl.still_world import flat_world, hover

MS = 1_000_000
CLOCK = Clock(offset_ns=77, drift_ppb=0)
CENTRED = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=90.0)
LAYOUT = packet_type(ROWS)


def lidar(**options: object) -> Ouster:
    settings: dict[str, object] = {"clock": CLOCK, "noise": Noise.none(), "mount": CENTRED} | options
    return Ouster(np.random.default_rng(1), **settings)  # type: ignore[arg-type]


def test_packets_count_columns_and_frames() -> None:
    packets = lidar().scan(0, 200 * MS, hover(), flat_world())
    assert {len(packet) for packet in packets} == {64 + 16 * (12 + ROWS * 12)} == {LAYOUT.itemsize}
    read = np.array([np.frombuffer(packet, LAYOUT)[0] for packet in packets])
    number = read["frame_id"][:, None].astype(int) * COLUMNS + read["columns"]["measurement_id"]
    np.testing.assert_array_equal(number.ravel(), np.arange(number.size))
    stamps = read["columns"]["timestamp"].ravel().astype(np.int64)
    np.testing.assert_array_equal(stamps, 77 + np.arange(stamps.size) * 100_000_000 // COLUMNS)
    assert set(read["packet_type"]) == {1}
    assert (read["columns"]["status"] == 1).all()


def test_the_ground_below_is_seen_from_side_to_side() -> None:
    sensor = lidar()
    shots = sensor.shots(0, 100 * MS, hover(heading_deg=200.0), flat_world())
    hit = shots.echoes.range_m > 0
    frd = sensor.points_m(shots)[hit] @ CENTRED.rotation_frd_from_sensor().T
    np.testing.assert_allclose(frd[:, 2], 10.0, atol=1e-6)
    below = np.abs(frd[:, 1]) < 0.5
    reach = 10 * np.tan(np.radians(22.5))
    assert (frd[below, 0].min(), frd[below, 0].max()) == pytest.approx((-reach, reach), abs=0.1)


def test_output_does_not_depend_on_how_time_is_cut() -> None:
    world, noisy = flat_world(), Noise(dropout=0.05, ghost=0.02, dust=0.02)
    whole = lidar(noise=noisy).scan(0, 50 * MS, hover(), world)
    sensor, cut = lidar(noise=noisy), [0, 1, 333_333, 7 * MS, 7 * MS + 1, 20 * MS, 50 * MS]
    pieces = [packet for begin, end in pairwise(cut) for packet in sensor.scan(begin, end, hover(), world)]
    assert pieces == whole
    assert len(whole) == 16


def test_the_metadata_tells_what_is_sent() -> None:
    told = json.loads(lidar().metadata)
    layout = told["lidar_data_format"]
    assert (layout["pixels_per_column"], layout["columns_per_frame"]) == (ROWS, COLUMNS)
    assert told["beam_intrinsics"]["beam_altitude_angles"][0] == 22.5
