"""Inertial packets of a Mid-360 and of Ouster's sensors, written byte by byte from the makers' documents.

Livox: "Livox LiDAR Communication Protocol - Mid360" (v1.4.11), IMU data; user manual of the Mid-360 (v1.0),
Output Data. Ouster: firmware manual, IMU Data Packet Format, and the maker's `ouster-sdk`, which is asked as
well.
"""

from __future__ import annotations

import math
from pathlib import Path

import dpkt
import numpy as np
import pytest

from companion.flight.sensors.decoders.livox_decoder import LivoxDecoder
from companion.flight.sensors.decoders.ouster_decoder import OusterDecoder
from tests.unit.companion.flight.sensors.ouster_packets import (
    MISSING,
    NEW_IMU,
    legacy_imu_packet,
    metadata,
    new_imu_packet,
)
from tests.unit.companion.flight.sensors.packets import imu_packet
from tests.unit.companion.flight.sensors.recordings import recording

G = 9.80665
needs_sdk = pytest.mark.skipif(bool(MISSING), reason=MISSING or "present")

# ---- Livox ---------------------------------------------------------------------------------------------


def test_a_mid360_sample_is_in_the_axes_of_its_points() -> None:
    decoder = LivoxDecoder()
    samples = decoder.decode_imu(imu_packet([(0.1, -0.2, 0.3, 0.01, -0.02, 0.99)]))
    assert samples is not None
    assert samples.stamp_ns.tolist() == [5_000_000_000]
    np.testing.assert_allclose(samples.rate_rads, [[0.1, -0.2, 0.3]], rtol=1e-6)
    np.testing.assert_allclose(samples.specific_force_ms2, [[0.01 * G, -0.02 * G, 0.99 * G]], rtol=1e-6)
    np.testing.assert_allclose(samples.lever_m, [0.011, 0.02329, -0.04412])
    assert decoder.counters.imu == 1


def test_several_samples_are_spread_over_their_interval() -> None:
    decoder = LivoxDecoder()
    samples = decoder.decode_imu(imu_packet([(0, 0, k, 0, 0, 1) for k in range(3)], interval_ns=5_000_000))
    assert samples is not None
    assert (samples.stamp_ns - 5_000_000_000).tolist() == [0, 2_500_000, 5_000_000]
    assert samples.rate_rads[:, 2].tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("packet", "counter"),
    [
        (imu_packet(dots=2), "malformed"),
        (imu_packet([]), "malformed"),
        (imu_packet([(math.nan, 0, 0, 0, 0, 1)]), "malformed"),
        (imu_packet([(0, 0, 0, 0, 0, 1e30)]), "malformed"),
        (imu_packet(stamp_ns=2**63), "malformed"),
        (imu_packet(crc=1), "bad_checksum"),
        (imu_packet()[:-1], "malformed"),
    ],
)
def test_a_bad_mid360_packet_is_counted(packet: bytes, counter: str) -> None:
    decoder = LivoxDecoder()
    assert decoder.is_imu(packet)
    assert decoder.decode_imu(packet) is None
    assert getattr(decoder.counters, counter) == 1
    assert decoder.counters.imu == 0


def test_the_documented_bytes_one_by_one() -> None:
    """A packet written apart from the helper that the other tests use; a checksum of 0 is not checked."""
    header = "003c0000000100070000000000000000000000000000000000000000"
    packet = bytes.fromhex(
        header + "00f2052a01000000" + "cdcccc3dcdcc4cbe9a99993e" + "0ad7233c0ad7a3bca4707d3f"
    )
    decoder = LivoxDecoder()
    samples = decoder.decode_imu(packet)
    assert samples is not None
    assert (decoder.counters.unchecked, samples.stamp_ns[0]) == (1, 5_000_000_000)
    np.testing.assert_allclose(samples.rate_rads, [[0.1, -0.2, 0.3]], rtol=1e-6)
    np.testing.assert_allclose(samples.specific_force_ms2, [[0.01 * G, -0.02 * G, 0.99 * G]], rtol=1e-6)


# ---- Ouster --------------------------------------------------------------------------------------------


@needs_sdk
def test_a_legacy_packet_is_in_g_and_degrees_per_second() -> None:
    decoder = OusterDecoder(metadata())
    samples = decoder.decode_imu(legacy_imu_packet((0.1, -0.2, 0.9), (10, -20, 30), stamp_ns=1234))
    assert samples is not None
    assert samples.stamp_ns.tolist() == [1234]
    np.testing.assert_allclose(samples.specific_force_ms2, [[0.1 * G, -0.2 * G, 0.9 * G]], rtol=1e-6)
    np.testing.assert_allclose(samples.rate_rads, np.radians([[10, -20, 30]]), rtol=1e-6)
    np.testing.assert_allclose(samples.lever_m, [0.006253, -0.011775, 0.007645])


@needs_sdk
def test_the_unit_s_axes_are_turned_into_those_of_the_points() -> None:
    """A unit whose x axis points left, and whose y axis points back."""
    turned = (0, -1, 0, 1000, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)
    decoder = OusterDecoder(metadata(imu_to_sensor=turned))
    samples = decoder.decode_imu(legacy_imu_packet((0.5, 0, 1), (10, 0, 0)))
    assert samples is not None
    np.testing.assert_allclose(samples.specific_force_ms2, [[0, 0.5 * G, G]], atol=1e-5)
    np.testing.assert_allclose(samples.rate_rads, [[0, np.radians(10), 0]], atol=1e-6)
    np.testing.assert_allclose(samples.lever_m, [1, 0, 0])


@needs_sdk
def test_a_new_packet_holds_several_samples_in_metres_and_radians() -> None:
    decoder = OusterDecoder(metadata(imu_profile=NEW_IMU))
    samples = decoder.decode_imu(new_imu_packet((0.1, 0, 9.8), (0.2, 0, 0), valid=(1, 1, 0, 1, 1, 1, 1, 1)))
    assert samples is not None
    assert len(samples) == 7
    assert (samples.stamp_ns[:3] - 5_000_000_000).tolist() == [0, 1_562_500, 3 * 1_562_500]
    np.testing.assert_allclose(samples.specific_force_ms2, [[0.1, 0, 9.8]] * 7, rtol=1e-6)
    np.testing.assert_allclose(samples.rate_rads, [[0.2, 0, 0]] * 7, rtol=1e-6)


@needs_sdk
@pytest.mark.parametrize(
    "packet",
    [
        new_imu_packet(kind=1),
        new_imu_packet(step_ns=0),
        new_imu_packet(stamp_ns=2**63),
        new_imu_packet((math.nan, 0, 0)),
        new_imu_packet((math.inf, 0, 0)),
    ],
)
def test_a_bad_new_packet_is_counted(packet: bytes) -> None:
    decoder = OusterDecoder(metadata(imu_profile=NEW_IMU))
    assert decoder.is_imu(packet)
    assert decoder.decode_imu(packet) is None
    assert (decoder.counters.malformed, decoder.counters.imu) == (1, 0)


@needs_sdk
@pytest.mark.parametrize(
    "transform",
    [
        (0,) * 16,
        (2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1),
        (-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1),
    ],
)
def test_without_a_rotation_no_sample_is_used_but_the_points_are(transform: tuple[float, ...]) -> None:
    decoder = OusterDecoder(metadata(imu_to_sensor=transform))
    assert decoder.decode_imu(legacy_imu_packet()) is None
    assert (decoder.counters.imu, decoder.counters.malformed) == (1, 0)


def _by_the_maker(info_text: str, packets: list[bytes]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    """Return stamps, accelerometer and gyroscope as ouster-sdk reads them."""
    from ouster.sdk import core

    pf = core.PacketFormat(core.SensorInfo(info_text))
    stamps, force, rate = [], [], []
    for packet in packets:
        data = np.frombuffer(packet, np.uint8)
        if pf.imu_measurements_per_packet == 0:
            stamps.append([pf.imu_gyro_ts(data)])
            force.append([[pf.imu_la_x(data), pf.imu_la_y(data), pf.imu_la_z(data)]])
            rate.append([[pf.imu_av_x(data), pf.imu_av_y(data), pf.imu_av_z(data)]])
            continue
        read = core.ImuPacket(pf)
        read.buf[:] = data
        valid = np.asarray(read.status()) & 1 == 1
        stamps.append(np.asarray(read.timestamp())[valid])
        force.append(np.asarray(read.accel())[valid])
        rate.append(np.asarray(read.gyro())[valid])
    return np.concatenate(stamps), np.concatenate(force), np.concatenate(rate)


@needs_sdk
@pytest.mark.parametrize("profile", ["LEGACY", NEW_IMU])
def test_the_maker_s_package_reads_the_same(profile: str) -> None:
    text = metadata(imu_profile=profile)
    legacy = profile == "LEGACY"
    force, rate = (0.125, -0.25, 1.0), (1.5, 2.5, -3.5)
    packet = legacy_imu_packet(force, rate) if legacy else new_imu_packet(force, rate, valid=(1, 0) * 4)
    samples = OusterDecoder(text).decode_imu(packet)
    assert samples is not None
    if legacy:  # the package tells measurements per packet only of the new profile
        text = text.replace('"imu_measurements_per_packet": 8', '"imu_measurements_per_packet": 0')
    stamps, theirs_force, theirs_rate = _by_the_maker(text, [packet])
    assert samples.stamp_ns.tolist() == stamps.tolist()
    np.testing.assert_allclose(samples.specific_force_ms2, theirs_force * (G if legacy else 1))
    np.testing.assert_allclose(samples.rate_rads, np.radians(theirs_rate) if legacy else theirs_rate)


def _sent(path: Path, size: int) -> list[bytes]:
    with path.open("rb") as file:
        frames = [dpkt.ethernet.Ethernet(data) for _, data in dpkt.pcap.Reader(file)]
    packets = [bytes(frame.data.data.data) for frame in frames]
    return [packet for packet in packets if len(packet) == size]


@needs_sdk
def test_a_real_recording_gives_the_samples_that_the_maker_s_package_reads() -> None:
    name = "ouster_os0/OS-0-128-U1_v2.3.0_1024x10"
    text = recording(f"{name}.json").read_text()
    packets = _sent(recording(f"{name}.pcap"), 48)
    decoder = OusterDecoder(text)
    decoded = [samples for packet in packets if (samples := decoder.decode_imu(packet)) is not None]
    assert len(decoded) == len(packets) == 10
    stamps, force, rate = _by_the_maker(text, packets)
    ours_ns, ours_force, ours_rate = (
        np.concatenate([getattr(samples, name) for samples in decoded])
        for name in ("stamp_ns", "specific_force_ms2", "rate_rads")
    )
    assert ours_ns.tolist() == stamps.tolist()
    np.testing.assert_allclose(ours_force, force * G)
    np.testing.assert_allclose(ours_rate, np.radians(rate.astype(float)))
    assert np.diff(ours_ns) == pytest.approx(10_000_000, abs=1000)
    assert np.linalg.norm(ours_force.mean(axis=0)) == pytest.approx(9.81, rel=0.03)
    assert np.abs(ours_rate).max() < np.radians(2)
