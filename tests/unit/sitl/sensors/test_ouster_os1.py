"""Simulated Ouster: packets as in the manual, time and mount."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.optics import Noise
from sitl.sensors.ouster_os1 import COLUMNS, OS0, OS1, ROWS, Ouster, OusterModel
from sitl.sensors.ouster_packets import packet_type
from sitl.sensors.sensor_clock import Clock
from sitl.world.primitives import Kind
from sitl.world.surface_layers import Plants, SurfaceLayers
from sitl.world.world import World
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


def test_the_os0_looks_45_degrees_to_both_sides_of_its_equator() -> None:
    sensor = lidar(model=OS0)
    shots = sensor.shots(0, 100 * MS, hover(), flat_world())
    assert len(shots) == 64 * COLUMNS
    hit = shots.echoes.range_m > 0
    frd = sensor.points_m(shots)[hit] @ CENTRED.rotation_frd_from_sensor().T
    np.testing.assert_allclose(frd[:, 2], 10.0, atol=1e-6)
    below = np.abs(frd[:, 1]) < 0.5
    assert (frd[below, 0].min(), frd[below, 0].max()) == pytest.approx((-10.0, 10.0), abs=0.1)
    assert json.loads(sensor.metadata)["sensor_info"]["prod_line"] == "OS-0-64"


def maize() -> World:
    ground = flat_world().ground
    layers = SurfaceLayers(
        np.full(ground.kind.shape, np.nan),
        np.ones(ground.kind.shape, np.uint8),
        (Plants(Kind.MAIZE, 2, 0.8),),
    )
    return World(ground, layers=layers)


@pytest.mark.parametrize("model", [OS1, OS0])
def test_two_returns_are_read_by_the_makers_library(model: OusterModel) -> None:
    core = pytest.importorskip("ouster.sdk.core")
    sensor = lidar(model=model, dual=True)
    packets = sensor.scan(0, 50 * MS, hover(), maize())
    info = core.SensorInfo(sensor.metadata)
    reader = core.PacketFormat(info)
    assert {len(packet) for packet in packets} == {reader.lidar_packet_size}
    first, second, power, power2 = (
        np.stack([reader.packet_field(name, packet) for packet in packets]).astype(int)
        for name in ("RANGE", "RANGE2", "REFLECTIVITY", "REFLECTIVITY2")
    )
    two = second > 0
    assert two.sum() / (first > 0).sum() > 0.2
    assert (np.abs(first - second)[two] >= 999).all()
    assert (power >= power2)[two].all()
    nearer = second < first
    assert nearer[two].any()
    assert (~nearer)[two].any()
    read = np.array([np.frombuffer(packet, packet_type(model.rows, dual=True))[0] for packet in packets])
    np.testing.assert_array_equal((read["columns"]["pixels"]["range2"] & 0x7FFFF).transpose(0, 2, 1), second)


def test_one_return_is_the_strongest_of_two() -> None:
    single, dual = (lidar(dual=dual).scan(0, 50 * MS, hover(), maize()) for dual in (False, True))
    one, two = (
        np.array([np.frombuffer(p, packet_type(ROWS, dual))[0] for p in packets])["columns"]["pixels"]
        for packets, dual in ((single, False), (dual, True))
    )
    np.testing.assert_array_equal(one["range"], two["range"] & 0x7FFFF)
    np.testing.assert_array_equal(one["reflectivity"], two["reflectivity"])
