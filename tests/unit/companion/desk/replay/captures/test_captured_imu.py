"""Inertial packets of a capture, sent to a port of their own."""

from __future__ import annotations

from pathlib import Path

import dpkt
import numpy as np

from companion.desk.replay.captures.captured_packets import CapturedPackets
from companion.desk.replay.foreign_replay import Rerun
from companion.flight.sensors.imu_samples import ImuSamples
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS
from tests.unit.companion.flight.sensors.packets import imu_packet, points_packet

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
