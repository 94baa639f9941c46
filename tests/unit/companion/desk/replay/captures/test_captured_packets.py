"""Sensor of a capture: identified from its packets, or refused with its name and the way."""

from __future__ import annotations

import struct
from pathlib import Path

import dpkt
import pytest

from companion.desk.replay.captures.captured_packets import CapturedPackets
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay.captures.test_pcap import ETHERNET_HEAD, ip, udp
from tests.unit.companion.desk.replay.flights import BEGIN_NS
from tests.unit.companion.flight.sensors.test_undecoded_lidars import PACKETS, velodyne_of

POSITION = bytes(206) + b"$GPRMC" + bytes(300)


def write(path: Path, *payloads: bytes, kept: int = 1 << 16) -> Path:
    with path.open("wb") as file:
        dpkt.pcap.Writer(file)
        for k, payload in enumerate(payloads):
            frame = ETHERNET_HEAD + ip(udp(payload))
            head = (BEGIN_NS // 10**9, k, min(kept, len(frame)), len(frame))
            file.write(struct.pack("<IIII", *head) + frame[:kept])
    return path


def refusal(path: Path, lidar: str | None = None) -> str:
    with pytest.raises(UsageError) as refused:
        CapturedPackets(path, lidar)
    return str(refused.value)


@pytest.mark.parametrize("name", PACKETS)
@pytest.mark.parametrize("lidar", [None, "velodyne", "livox"])
def test_a_lidar_without_a_decoder_is_refused_by_its_name(
    tmp_path: Path, name: str, lidar: str | None
) -> None:
    said = refusal(write(tmp_path / "a.pcap", PACKETS[name], POSITION, PACKETS[name]), lidar)
    assert name in said
    assert "--lidar cannot help" in said
    assert "ROS 2 driver" in said


def test_a_lidar_with_a_decoder_beside_one_without_is_taken(tmp_path: Path) -> None:
    path = write(tmp_path / "a.pcap", *[PACKETS["RoboSense"]] * 9, velodyne_of(0x22))
    assert CapturedPackets(path, None).summary()["lidar"] == "velodyne"
    assert CapturedPackets(path, "velodyne").summary()["lidar"] == "velodyne"


def test_a_lidar_whose_packets_come_late_in_the_capture_is_found(tmp_path: Path) -> None:
    path = write(tmp_path / "a.pcap", *[b"telemetry"] * 2100, velodyne_of(0x22))
    assert CapturedPackets(path, None).summary()["lidar"] == "velodyne"


def test_a_capture_whose_packets_were_all_cut_says_how_to_capture(tmp_path: Path) -> None:
    said = refusal(write(tmp_path / "a.pcap", velodyne_of(0x22), velodyne_of(0x22), kept=96))
    assert said.endswith("2 packets were cut to 96 bytes when captured: capture whole ones (tcpdump -s 0)")


def test_a_capture_of_nothing_known_is_refused(tmp_path: Path) -> None:
    assert "none of its 2 UDP packets is of a known LiDAR" in refusal(write(tmp_path / "a.pcap", b"a", b"b"))


def test_a_capture_of_another_link_type_says_so_and_asks_for_no_name(tmp_path: Path) -> None:
    path = write(tmp_path / "a.pcap", b"a", b"b")
    path.write_bytes(path.read_bytes()[:20] + struct.pack("<I", 127) + path.read_bytes()[24:])
    said = refusal(path)
    assert "no UDP packet that has a time; 2 packets are of link type 127, which is not read" in said
    assert "--lidar" not in said
