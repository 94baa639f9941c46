"""LiDARs without a decoder: named by their packets, in the diagnosis and in the log."""

from __future__ import annotations

import logging
import struct

import pytest

from companion.flight.sensors.undecoded_lidars import undecoded_lidar
from tests.unit.companion.flight.sensors.test_packet_stream import (
    EPOCH_NS,
    MS,
    Rig,
    S,
    livox,
    ouster,
    velodyne,
)


def velodyne_of(model: int, second_block: bytes = b"\xff\xee") -> bytes:
    blocks = b"\xff\xee" + bytes(98) + (second_block + bytes(98)) * 11
    return blocks + struct.pack("<IBB", 0, 0x37, model)


def hesai(lasers: int, blocks: int, size: int = 1080) -> bytes:
    return (b"\xee\xff\x06\x01\x00\x00" + bytes([lasers, blocks]) + bytes(size))[:size]


PACKETS = {
    "Velodyne HDL-32E": velodyne_of(0x21),
    "Velodyne VLS-128": velodyne_of(0xA1, b"\xff\xdd"),
    "Velodyne HDL-64E": velodyne_of(0x9E, b"\xff\xdd"),
    "factory byte 0x00": velodyne_of(0),
    "Hesai LiDAR PandarXT-32": hesai(32, 8),
    "Hesai LiDAR Pandar64": hesai(64, 6, 1194),
    "a Hesai LiDAR": hesai(7, 7),
    "Hesai LiDAR Pandar40P": b"\xff\xee" + bytes(1260),
    "RoboSense": bytes.fromhex("55aa050a5aa550a0") + bytes(1240),
    "a RoboSense": bytes.fromhex("55aa055a") + bytes(1244),
    "a RoboSense LiDAR": bytes.fromhex("55aa5aa5") + bytes(1206),
    "Livox of the first generation": b"\x05" + bytes(8) + b"\x02" + bytes(8 + 14 * 96),
}


@pytest.mark.parametrize(("name", "packet"), PACKETS.items(), ids=PACKETS)
def test_maker_and_model_are_named_by_the_packet(name: str, packet: bytes) -> None:
    assert name in (undecoded_lidar(packet) or "")


def test_a_packet_that_can_be_decoded_or_is_of_nothing_known_is_not_named() -> None:
    decodable = [livox(0, EPOCH_NS), velodyne(0, EPOCH_NS), ouster(0, EPOCH_NS)]
    for packet in [*decodable, *(velodyne_of(model) for model in (0x22, 0x24, 0x28))]:
        assert undecoded_lidar(packet) is None
    for packet in (b"", b"\xee\xff", b"\x05", bytes(1206), b"\xff\xee" + bytes(500)):
        assert undecoded_lidar(packet) is None


@pytest.mark.parametrize(
    ("kind", "name", "cause"),
    [
        ("velodyne", "Velodyne HDL-32E", "not_as_described"),
        ("velodyne", "Hesai LiDAR PandarXT-32", "other_maker"),
        ("livox", "RoboSense", "other_maker"),
    ],
)
def test_the_diagnosis_in_flight_names_it_and_the_way(
    kind: str, name: str, cause: str, caplog: pytest.LogCaptureFixture
) -> None:
    rig = Rig(kind)
    with caplog.at_level(logging.ERROR):
        for k in range(400):
            rig.stream.add_packet(PACKETS[name], "10.0.0.9", 500 * S + k * 10 * MS)
            rig.stream.diagnosis.check(500 * S + k * 10 * MS)
    (line,) = caplog.messages
    assert name in line
    episodes = rig.stream.diagnosis.episodes
    assert [episode.cause for episode in episodes] == [cause]
    assert name in episodes[0].explanation.sentence
    assert "ros2:/TOPIC" in episodes[0].explanation.remedy
