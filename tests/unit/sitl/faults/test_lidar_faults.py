"""Packets of a failing LiDAR, as the companion receives them."""

from __future__ import annotations

import socket
import zlib
from collections.abc import Iterator

import numpy as np
import pytest

from sitl import faults, scenes
from sitl.sensors.livox_packets import CARTESIAN_32, HEADER, HEADER_BYTES
from sitl.simulation import Simulation
from sitl.vehicle.multirotor import Vehicle

RATE_HZ = 12_500


class Listener:
    """A simulation on the ground and the socket that hears its LiDAR."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        port = int(self.socket.getsockname()[1])
        self.sim = Simulation(
            scenes.build("landing_site", 1), [], lidar_to=("127.0.0.1", port), point_rate_hz=RATE_HZ
        )

    def packets(self, seconds: float, fault: faults.Fault | None = None) -> list[bytes]:
        if fault is not None:
            fault.start(self.sim)
        self.sim.run(seconds)
        if fault is not None:
            fault.stop(self.sim)
        got = []
        while True:
            try:
                got.append(self.socket.recv(4096))
            except BlockingIOError:
                return got


@pytest.fixture
def listener() -> Iterator[Listener]:
    listener = Listener()
    east, north, up = listener.sim.vehicle.truth.pos_enu_m
    hung = Vehicle(np.random.default_rng(1), (east, north, up + 10.0))  # it does not fly, so nothing moves
    listener.sim.vehicle = hung
    yield listener
    listener.sim.close()
    listener.socket.close()


def fault(name: str, seed: int = 1) -> faults.Fault:
    return faults.build(name, np.random.default_rng(seed))


def points_m(packet: bytes) -> np.ndarray:
    return np.frombuffer(packet[HEADER_BYTES:], CARTESIAN_32)["xyz"] / 1000.0


def is_sound(packet: bytes) -> bool:
    if len(packet) <= HEADER_BYTES:
        return False
    fields = HEADER.unpack_from(packet)
    return fields[1] == len(packet) and fields[-1] == zlib.crc32(packet[HEADER.size :])


def stamps_ns(packets: list[bytes]) -> list[int]:
    return [int.from_bytes(packet[HEADER.size : HEADER_BYTES], "little") for packet in packets]


def test_a_stopped_sensor_sends_nothing_and_then_goes_on(listener: Listener) -> None:
    assert listener.packets(0.3, fault("lidar_stop")) == []
    assert len(listener.packets(0.3)) > 30


def test_at_half_rate_every_second_packet_is_missing(listener: Listener) -> None:
    whole = len(listener.packets(0.5))
    assert len(listener.packets(0.5, fault("lidar_half"))) == pytest.approx(whole / 2, abs=2)


def test_a_stuck_picture_comes_sound_with_stamps_that_go_on(listener: Listener) -> None:
    got = listener.packets(0.5, fault("lidar_stuck"))
    pictures = [packet[HEADER_BYTES:] for packet in got]
    assert all(map(is_sound, got))
    assert len(set(pictures)) < 30 < 60 < len(got)
    assert stamps_ns(got) == sorted(set(stamps_ns(got)))


def test_garbage_is_partly_sound_and_never_what_is_there(listener: Listener) -> None:
    true_m = np.concatenate([points_m(p) for p in listener.packets(0.5)])
    got = listener.packets(0.5, fault("lidar_garbage"))
    sound = [packet for packet in got if is_sound(packet)]
    assert 0.2 < len(sound) / len(got) < 0.5
    assert np.median(np.linalg.norm(np.concatenate([points_m(p) for p in sound]), axis=1)) > 30
    assert np.median(np.linalg.norm(true_m[true_m.any(axis=1)], axis=1)) < 15


def test_the_sensor_s_clock_steps_by_five_seconds_and_stays(listener: Listener) -> None:
    before = stamps_ns(listener.packets(0.2))[-1]
    during = stamps_ns(listener.packets(0.2, fault("lidar_clock")))[0]
    after = stamps_ns(listener.packets(0.2))[0]
    assert abs(abs(during - before) - 5_000_000_000) < 100_000_000
    assert 0 < after - during < 400_000_000


def test_a_misaligned_sensor_sees_the_same_ground_five_degrees_aside(listener: Listener) -> None:
    sensor = listener.sim.lidar.sensor  # type: ignore[union-attr]
    before = sensor.mount.rotation_frd_from_sensor()  # type: ignore[union-attr]
    turned = fault("lidar_misaligned")
    turned.start(listener.sim)
    off = sensor.mount.rotation_frd_from_sensor() @ before.T  # type: ignore[union-attr]
    assert np.degrees(np.arccos((np.trace(off) - 1) / 2)) == pytest.approx(5.0)
    turned.stop(listener.sim)
    assert (sensor.mount.rotation_frd_from_sensor() == before).all()  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("name", "farthest_m", "share"), [("lidar_dust", 8.4, 0.7), ("lidar_rain", 60.0, 0.9)]
)
def test_in_weather_less_is_seen_and_afterwards_all(
    listener: Listener, name: str, farthest_m: float, share: float
) -> None:
    def returns() -> np.ndarray:
        xyz = np.concatenate([points_m(packet) for packet in listener.packets(0.5)])
        return np.linalg.norm(xyz[xyz.any(axis=1)], axis=1)

    clear = len(returns())
    weather = fault(name)
    weather.start(listener.sim)
    listener.packets(0.1)
    assert returns().max() < farthest_m
    assert len(returns()) < share * clear
    weather.stop(listener.sim)
    listener.packets(0.1)
    assert len(returns()) == pytest.approx(clear, rel=0.05)
