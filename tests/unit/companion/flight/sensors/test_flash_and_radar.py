"""The flash camera's and the radar's datagrams, from the simulated instruments to points on the ground."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.fusion.second_sensor import open_beside, radar_parameters
from companion.flight.sensors.decoders import flash_decoder, radar_decoder
from companion.flight.sensors.decoders.flash_decoder import FlashDecoder
from companion.flight.sensors.decoders.radar_decoder import RadarDecoder
from companion.flight.sensors.packet_identification import identify_packet
from companion.flight.sensors.returns import RawReturns
from companion.flight.sensors.sensor_registry import decoder_for
from companion.runtime.errors import UsageError
from params import Parameters, load
from sitl.sensors.flash.flash_sensor import FlashSensor
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.radar.radar_sensor import BODY, RadarSensor
from sitl.world.primitives import Box, Cylinder, Ground, Kind
from sitl.world.world import World
from slz import SAFE, UNSAFE, LocalFrame, Pipeline, Scan, Window

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
SECOND = 1_000_000_000
DOWN = Mount((0.1, 0.0, 0.05), 0.0, 90.0, 0.0)
CRATE = Box(36.0, 4.0, -0.3, 3.0, 3.0, 1.1)


def world(*solids: Box) -> World:
    """Return ground that rises to the north, with things on it."""
    axis = np.arange(-150.0, 151.0, 4.0)
    z = np.broadcast_to(0.03 * axis[:, np.newaxis], (len(axis), len(axis))).copy()
    return World(Ground(-150.0, -150.0, 4.0, z, np.full((len(axis) - 1,) * 2, Kind.GRASS, np.uint8)), solids)


def swaying(stamps: I64) -> tuple[F64, F64]:
    """Fly north at 4 m/s, 25 m high, rolling and pitching by some degrees."""
    t = stamps * 1e-9
    angles = np.column_stack([5 * np.ones_like(t), 3 * np.sin(t), 4 * np.cos(1.3 * t)])
    quat = Rotation.from_euler("ZYX", angles, degrees=True).as_quat()[:, [3, 0, 1, 2]]
    return np.column_stack([0 * t, 4 * t - 4, 25 + 0 * t]), quat


def decoded(decoder: Any, packets: list[bytes]) -> RawReturns:
    for packet in packets:
        assert decoder.check(packet) is not None
        decoder.add_packet(packet)
    raw: RawReturns = decoder.drain()
    return raw


def placed(raw: RawReturns, sensor: FlashSensor | RadarSensor, mount: Mount) -> F64:
    """Place points with the true poses of their stamps."""
    stamps = sensor.clock.simulated_ns(raw.stamp_ns - sensor.clock.offset_ns)
    position, quat = swaying(stamps)
    points: F64 = position + mount.lever_enu_m(quat) + mount.to_enu(raw.xyz_m.astype(float), quat)
    return points


def test_flash_points_lie_on_the_ground_whatever_the_attitude() -> None:
    sensor, ground = FlashSensor(np.random.default_rng(1)), world()
    decoder = FlashDecoder()
    points = placed(decoded(decoder, sensor.scan(0, SECOND // 2, swaying, ground)), sensor, DOWN)
    error = points[:, 2] - ground.surface(points[:, 0], points[:, 1])[0]
    assert len(points) > 4 * 128 * 128 * 0.98
    assert abs(np.median(error)) < 0.005
    assert np.median(np.abs(error)) / 0.6745 < 0.03
    assert decoder.counters.frames == 4
    assert decoder.counters.lost_packets == 0


def test_radar_points_lie_on_the_ground_whatever_the_attitude() -> None:
    sensor, ground = RadarSensor(np.random.default_rng(1)), world()
    decoder = RadarDecoder()
    points = placed(decoded(decoder, sensor.scan(0, 2 * SECOND, swaying, ground)), sensor, BODY)
    error = points[:, 2] - ground.surface(points[:, 0], points[:, 1])[0]
    assert len(points) > 2000
    assert points[:, 0].min() > 10  # it looks to the right, and flies north
    assert abs(np.median(error)) < 0.02
    assert np.median(np.abs(error)) / 0.6745 < 0.05
    assert np.mean(np.abs(error) > 0.3) < 0.01


@pytest.mark.parametrize("height_m", [25.0, 60.0])
@pytest.mark.parametrize("pitch_deg", [-20.0, -16.0, -5.0, 0.0, 8.0, 16.0, 20.0])
def test_a_pitched_radar_gives_true_heights_or_none(height_m: float, pitch_deg: float) -> None:
    """Within the plane of its beam the ground is further away than the altitude that it tells."""
    nose_up = Rotation.from_euler("ZYX", [0, pitch_deg, 0], degrees=True).as_quat()[[3, 0, 1, 2]]
    frame, scans = LocalFrame(47.0, 8.0, 400.0), list[Scan]()
    history = PoseHistory(Parameters(), frame)
    for stamp in range(0, 2 * SECOND, SECOND // 50):
        history.add_attitude(stamp, nose_up, (0, 0, 0))
        history.add_position(stamp, 47.0, 8.0, 400.0 + height_m, (0, 0, 0))

    def hovering(stamps: I64) -> tuple[F64, F64]:
        return np.tile([0.0, 0.0, height_m], (len(stamps), 1)), np.tile(nose_up, (len(stamps), 1))

    flat = World(Ground(-150.0, -150.0, 4.0, np.zeros((76, 76)), np.full((75, 75), Kind.GRASS, np.uint8)), ())
    sensor = RadarSensor(np.random.default_rng(1))
    raw = decoded(RadarDecoder(), sensor.scan(0, SECOND, hovering, flat))
    assembler = ScanAssembler(radar_parameters(Parameters()), history, scans.append)
    assembler.add(raw.shifted(-sensor.clock.offset_ns))
    assert bool(scans) == (abs(pitch_deg) < 9)
    assert assembler.statistics()["pitched"] == (0 if scans else len(raw)) <= len(raw)
    assert len(raw) > 100
    for scan in scans:
        assert np.mean(np.abs(scan.points_enu_m[:, 2]) > 0.3) < 0.02


def test_over_a_crate_radar_points_rise_or_are_missing() -> None:
    sensor, ground = RadarSensor(np.random.default_rng(2)), world(CRATE)
    points = placed(decoded(RadarDecoder(), sensor.scan(0, 4 * SECOND, swaying, ground)), sensor, BODY)
    on_it = (np.abs(points[:, 0] - CRATE.x_m) < 1.2) & (np.abs(points[:, 1] - CRATE.y_m) < 1.2)
    low = points[on_it, 2] < 0.03 * points[on_it, 1] + 0.4
    beside = (np.abs(points[:, 0] - CRATE.x_m) < 1.2) & (np.abs(points[:, 1] - CRATE.y_m - 4) < 1.2)
    assert low.sum() < 0.1 * beside.sum()


def test_posts_of_a_fence_seen_by_the_flash_camera_from_30_m_make_their_ground_unsafe() -> None:
    """A pixel is as wide as a post there: the median of nine would take every post away."""
    posts = [Cylinder(5.0, y, -0.5, 0.1, 1.7, Kind.WOOD) for y in (-2.5, 0.0, 2.5)]
    flat = World(
        Ground(-60.0, -60.0, 4.0, np.zeros((31, 31)), np.full((30, 30), Kind.GRASS, np.uint8)), posts
    )

    def hovering(stamps: I64) -> tuple[F64, F64]:
        t = stamps * 1e-9
        return np.column_stack([t, 0.5 * t, 30 + 0 * t]), np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))

    sensor = FlashSensor(np.random.default_rng(1))
    raw = decoded(FlashDecoder(), sensor.scan(0, SECOND * 3 // 4, hovering, flat))
    stamps = sensor.clock.simulated_ns(raw.stamp_ns - sensor.clock.offset_ns)
    position, quat = hovering(stamps)
    points = position + DOWN.lever_enu_m(quat) + DOWN.to_enu(raw.xyz_m.astype(float), quat)
    pipeline = Pipeline(load("quadcopter"), (0.0, 0.0))
    frame = LocalFrame(47.0, 8.0, 400.0)
    pipeline.process(Window(points, stamps, position[-1].copy(), frame, int(stamps[0]), int(stamps[-1])))
    maps = pipeline.maps(which="near")
    assert maps is not None

    def state(east_m: float, north_m: float) -> int:
        row = int((north_m - maps.south_m) / maps.grid.cell_m)
        return int(maps.state[row, int((east_m - maps.west_m) / maps.grid.cell_m)])

    assert [state(5.0, post.y_m) for post in posts] == [UNSAFE] * 3
    assert state(-1.0, 0.0) == SAFE


def test_a_lost_row_leaves_its_pixels_unknown_and_is_counted() -> None:
    sensor = FlashSensor(np.random.default_rng(1))
    packets = sensor.scan(0, SECOND // 4, swaying, world())
    del packets[64]
    decoder = FlashDecoder()
    raw = decoded(decoder, packets)
    assert decoder.counters.lost_packets == 1
    assert 2 * 128 * 128 - 128 - 200 < len(raw) <= 2 * 128 * 128 - 128


def test_a_block_of_noise_gives_nothing_and_breaks_nothing() -> None:
    packets = RadarSensor(np.random.default_rng(1)).scan(0, SECOND, swaying, world())
    rng = np.random.default_rng(3)
    noisy = [p[:64] + rng.integers(0, 256, len(p) - 64, np.uint8).tobytes() for p in packets]
    decoder = RadarDecoder()
    raw = decoded(decoder, noisy)
    assert decoder.counters.blocks == 1
    assert len(raw) < 0.02 * decoder.counters.no_return


@pytest.mark.parametrize("full", [32767, -32767, -32768])
def test_a_saturated_converter_gives_no_point(full: int) -> None:
    """All its samples are alike, and so perfectly coherent."""
    packets = RadarSensor(np.random.default_rng(1)).scan(0, SECOND, swaying, world())
    body = radar_decoder.HEADER.size
    saturated = [p[:body] + np.full((len(p) - body) // 2, full, "<i2").tobytes() for p in packets]
    decoder = RadarDecoder()
    assert len(decoded(decoder, saturated)) == 0
    assert (decoder.counters.blocks, decoder.counters.returns) == (1, 0)
    assert decoder.counters.no_return > 0


def test_bins_in_which_samples_are_clipped_give_no_point() -> None:
    packets = RadarSensor(np.random.default_rng(1)).scan(0, SECOND, swaying, world())
    whole = decoded(RadarDecoder(), packets)
    clipped = []
    for packet in packets:
        looks, bins = radar_decoder.HEADER.unpack_from(packet)[2:4]
        parts = (
            np.frombuffer(packet, "<i2", offset=radar_decoder.HEADER.size).reshape(looks, 2, bins, 2).copy()
        )
        parts[:, :, 100:120] = 32767
        clipped.append(packet[: radar_decoder.HEADER.size] + parts.tobytes())
    first, step = radar_decoder.HEADER.unpack_from(packets[0])[11:13]

    def among(raw: RawReturns) -> int:
        bins = np.rint((np.linalg.norm(raw.xyz_m, axis=1) - first) / step)
        return int(((bins >= 100) & (bins < 120)).sum())

    assert among(whole) > 50
    assert among(decoded(RadarDecoder(), clipped)) == 0


@pytest.mark.parametrize("kind", ["flash", "radar"])
def test_what_is_no_packet_is_counted_and_a_foreign_one_is_named(kind: str) -> None:
    sensor = {"flash": FlashSensor, "radar": RadarSensor}[kind](np.random.default_rng(1))
    packet = sensor.scan(0, SECOND // 5, swaying, world())[0]
    decoder = decoder_for(kind)
    for broken in (b"", packet[:20], packet[:-1], b"SLZX" + packet[4:], packet[:4] + b"\x09" + packet[5:]):
        assert decoder.check(broken) is None
    assert decoder.counters.malformed == 5
    assert decoder.kind == kind
    assert identify_packet(packet) == kind


def changed(packet: bytes, header: struct.Struct, **fields: float) -> bytes:
    """Return a packet with other values in its header, named by their place in it."""
    values = list(header.unpack_from(packet))
    for place, value in fields.items():
        values[int(place[1:])] = value
    return header.pack(*values) + packet[header.size :]


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("flash", {"_6": 128}),  # a row beyond the last
        ("flash", {"_3": 0}),
        ("flash", {"_9": -1.0}),  # a field of view that cannot be
        ("radar", {"_13": 0.2}),  # on the ground
        ("radar", {"_13": 5000.0}),
        ("radar", {"_14": 2.0}),  # on its back
        ("radar", {"_12": 0.0}),
        ("radar", {"_6": -1.0}),  # a wave of no length
    ],
)
def test_a_header_that_cannot_be_is_counted_and_its_packet_gives_nothing(
    kind: str, fields: dict[str, float]
) -> None:
    sensor = {"flash": FlashSensor, "radar": RadarSensor}[kind](np.random.default_rng(1))
    header = {"flash": flash_decoder.HEADER, "radar": radar_decoder.HEADER}[kind]
    packet = changed(sensor.scan(0, SECOND // 5, swaying, world())[0], header, **fields)
    decoder = decoder_for(kind)
    assert decoder.check(packet) is None
    decoder.add_packet(packet)
    assert (len(decoder), decoder.counters.malformed, decoder.counters.packets) == (0, 1, 0)
    assert len(decoder.drain()) == 0


def test_a_flash_frame_in_the_dark_gives_no_point() -> None:
    packets = FlashSensor(np.random.default_rng(1)).scan(0, SECOND // 8, swaying, world())
    body = flash_decoder.HEADER.size
    black = [packet[:body] + bytes(len(packet) - body) for packet in packets]
    decoder = FlashDecoder()
    assert len(decoded(decoder, black)) == 0
    assert (decoder.counters.frames, decoder.counters.returns) == (1, 0)
    assert decoder.counters.no_return == 128 * 128


def test_radar_lines_before_a_pause_make_no_block_with_those_after_it() -> None:
    packets = RadarSensor(np.random.default_rng(1)).scan(0, 2 * SECOND, swaying, world())
    late = [
        changed(
            p, radar_decoder.HEADER, _5=radar_decoder.HEADER.unpack_from(p)[5] + radar_decoder.MOST_BLOCK_NS
        )
        for p in packets
    ]
    decoder = RadarDecoder()
    raw = decoded(decoder, packets[:1] + late[1 : 1 + radar_decoder.BLOCK])
    assert (decoder.counters.blocks, decoder.counters.broken_blocks) == (2, 1)
    assert len(raw) > 0
    assert raw.stamp_ns.min() >= radar_decoder.HEADER.unpack_from(late[1])[5]


def test_only_a_radar_flies_beside_a_lidar() -> None:
    history = PoseHistory(Parameters())
    with pytest.raises(UsageError, match="radar:HOST:PORT"):
        open_beside("livox:0.0.0.0:56301", Parameters(), history, lambda _scan: None)


@pytest.mark.parametrize("kind", ["flash", "radar"])
def test_rays_of_a_flash_lidar_and_of_a_radar_show_nothing_of_what_they_pass(kind: str) -> None:
    sensor = {"flash": FlashSensor, "radar": RadarSensor}[kind](np.random.default_rng(1))
    raw = decoded(decoder_for(kind), sensor.scan(0, 2 * SECOND, swaying, world()))
    assert len(raw) > 0
    assert not raw.has_thin_rays
    assert not raw.shifted(5).has_thin_rays
