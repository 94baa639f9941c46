"""Sensor of a capture: identified from its packets, or refused with its name and the way."""

from __future__ import annotations

import struct
from pathlib import Path

import dpkt
import numpy as np
import pytest

from companion.desk.replay.captures.captured_packets import CapturedPackets
from companion.desk.replay.foreign_replay import Rerun
from companion.flight.sensors.imu_samples import ImuSamples
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.captures.test_pcap import ETHERNET_HEAD, ip, udp
from tests.unit.companion.desk.replay.flights import BEGIN_NS
from tests.unit.companion.flight.sensors.packets import imu_packet, points_packet
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


# Inertial packets of a capture, sent to a port of their own.


MS = 1_000_000


def frame(data: bytes, source: int, target: int) -> bytes:
    """Return an IPv4 packet of the sensor."""
    datagram = dpkt.udp.UDP(sport=source, dport=target, data=data, ulen=8 + len(data))
    packet = dpkt.ip.IP(src=bytes([10, 0, 0, 1]), dst=bytes([10, 0, 0, 2]), p=17, data=datagram)
    packet.len = 20 + 8 + len(data)
    return bytes(packet)


def test_a_capture_gives_the_samples_on_the_clock_of_its_points(tmp_path: Path) -> None:
    path = tmp_path / "lidar.pcap"
    with path.open("wb") as file:
        writer = dpkt.pcap.Writer(file, linktype=101)
        for k in range(50):
            stamp_ns = 1000 * MS + k * MS
            points = points_packet([(1000, 2, 3, 4, 0)], stamp_ns=stamp_ns, interval_ns=0, count=k)
            writer.writepkt(frame(points, 56300, 56301), (BEGIN_NS + k * MS) * 1e-9)
            if k % 5 == 0:
                sample = imu_packet([(0, 0, k / 100, 0, 0, 1)], stamp_ns=stamp_ns)
                writer.writepkt(frame(sample, 56400, 56401), (BEGIN_NS + k * MS) * 1e-9)
    feed, rerun = CapturedPackets(path, None), Rerun(flights.PARAMETERS)
    found: list[ImuSamples] = []
    rerun.on_imu.subscribe(found.append)
    for _, act in feed.steps(rerun, ()):
        rerun.hand_over(act)
    assert feed.summary()["packets"]["imu"] == 10
    rates = np.concatenate([samples.rate_rads for samples in found])
    np.testing.assert_allclose(rates[:, 2], np.arange(0, 50, 5) / 100, rtol=1e-6)
    stamps = np.concatenate([samples.stamp_ns for samples in found])
    np.testing.assert_array_equal(np.diff(stamps), 5 * MS)
    assert abs(int(stamps[0]) - BEGIN_NS) <= MS
