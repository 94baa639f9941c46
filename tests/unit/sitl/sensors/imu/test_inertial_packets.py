"""IMU packets of Livox and Ouster: every byte at the place that the makers' documents state."""

from __future__ import annotations

import socket
import struct
import zlib

import numpy as np
import pytest

from sitl import scenes
from sitl.faults import build
from sitl.sensors.imu.inertial_port import LivoxInertialPackets, OusterInertialPackets
from sitl.sensors.imu.inertial_unit import GRAVITY_MS2, InertialSamples
from sitl.simulation import Simulation
from sitl.wire.wire import MemoryWire

SAMPLES = InertialSamples(
    np.array([7_000_000_005, 7_005_000_005]),
    np.array([[0.5, -0.25, 1.5], [0.0, 0.0, 0.0]]),
    np.array([[1.0, -2.0, 0.5], [0.0, 0.0, 1.0]]) * GRAVITY_MS2,
)


def test_a_livox_packet_has_sixty_bytes_and_a_valid_checksum() -> None:
    first, second = LivoxInertialPackets().encode(SAMPLES)
    assert len(first) == 60
    version, length, interval, dots, count, frame, kind, time_kind = struct.unpack_from("<BHHHHBBB", first)
    assert (version, length, interval, dots, count, frame, kind, time_kind) == (0, 60, 0, 1, 0, 0, 0, 0)
    assert struct.unpack_from("<I", first, 24)[0] == zlib.crc32(first[28:])
    assert struct.unpack_from("<Q", first, 28)[0] == 7_000_000_005
    assert struct.unpack_from("<6f", first, 36) == (0.5, -0.25, 1.5, 1.0, -2.0, 0.5)
    assert struct.unpack_from("<H", second, 7)[0] == 1


def test_an_ouster_packet_has_forty_eight_bytes_in_g_and_degrees() -> None:
    first, second = OusterInertialPackets().encode(SAMPLES)
    assert len(first) == 48
    assert struct.unpack_from("<3Q", first) == (7_000_000_005,) * 3
    assert struct.unpack_from("<3f", first, 24) == (1.0, -2.0, 0.5)
    np.testing.assert_allclose(
        struct.unpack_from("<3f", first, 36), np.degrees(SAMPLES.rate_rad_s[0]), rtol=1e-6
    )
    assert struct.unpack_from("<3f", second, 24) == (0.0, 0.0, 1.0)


def receiver() -> socket.socket:
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.bind(("127.0.0.1", 0))
    end.setblocking(False)
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    return end


def received(end: socket.socket) -> list[bytes]:
    out = []
    while True:
        try:
            out.append(end.recv(65536))
        except BlockingIOError:
            return out


def simulation(lidar: str, imu: socket.socket | None, cloud: socket.socket) -> Simulation:
    return Simulation(
        scenes.build("landing_site", 1),
        [MemoryWire()],
        lidar=lidar,
        lidar_to=cloud.getsockname(),
        imu_to=None if imu is None else imu.getsockname(),
        point_rate_hz=1000,
        tick_ns=10_000_000,
        lidar_ms=50,
    )


@pytest.mark.parametrize(("lidar", "rate", "size"), [("mid360", 200, 60), ("ouster", 100, 48)])
def test_a_simulation_sends_them_beside_an_unchanged_cloud(lidar: str, rate: int, size: int) -> None:
    clouds = []
    for wanted in (True, False):
        with receiver() as imu, receiver() as cloud:
            sim = simulation(lidar, imu if wanted else None, cloud)
            sim.run(2.0)
            sim.close()
            packets = received(imu)
            assert {len(packet) for packet in packets} == ({size} if wanted else set())
            assert len(packets) in ((2 * rate, 2 * rate + 1) if wanted else (0,))
            clouds.append(received(cloud))
    assert clouds[0] == clouds[1] != []


def test_a_stopped_sensor_and_a_changed_clock_and_mount_count_for_its_imu_too() -> None:
    with receiver() as imu, receiver() as cloud:
        sim = simulation("mid360", imu, cloud)
        sim.run(0.5)
        before = received(imu)
        stop, clock, turned = (
            build(n, np.random.default_rng(1)) for n in ("lidar_stop", "lidar_clock", "lidar_misaligned")
        )
        stop.start(sim)
        sim.run(0.5)
        assert received(imu) == []
        stop.stop(sim)
        clock.start(sim)
        turned.start(sim)
        sim.run(0.5)
        after = received(imu)
        sim.close()
    stamps = [struct.unpack_from("<Q", packets[0], 28)[0] for packets in (before, after)]
    assert abs(stamps[1] - stamps[0]) > 3_000_000_000
    force = [
        np.mean([struct.unpack_from("<3f", p, 48) for p in packets], axis=0) for packets in (before, after)
    ]
    assert np.linalg.norm(force[1] - force[0]) > 0.05
    assert np.linalg.norm(force[0]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("lidar", ["vlp16", "opal"])
def test_a_lidar_without_an_imu_is_refused(lidar: str) -> None:
    with receiver() as imu, receiver() as cloud, pytest.raises(ValueError, match="mid360, ouster, os0"):
        simulation(lidar, imu, cloud)
