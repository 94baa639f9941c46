"""LiDAR faults: silence, repeated or false data, a clock step, a moved mount, weather."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sitl.faults.fault import Fault
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.lidar_port import Sensor, UdpPort
from sitl.sensors.livox_packets import CARTESIAN_32, HEADER, HEADER_BYTES
from sitl.sensors.optics import Noise, Reach
from sitl.sensors.particles import AIR
from sitl.sensors.pulse_lidar import PoseAt, PulseLidar
from sitl.sensors.sensor_clock import Clock
from sitl.world.world import World

if TYPE_CHECKING:
    from sitl.simulation import Simulation

Packets = list[bytes]

DUST = Reach(0.1, 3.0, 1.5, 2.5), Noise(dust=0.3)
"""Cloud around the vehicle: no view beyond three metres, and echoes of the dust itself."""
RAIN = Reach(0.1, 60.0, 20.0, 45.0), Noise(range_sigma_m=0.03, dropout=0.3, dust=0.02)
"""Heavy rain: three of ten pulses are lost, one of fifty ends in a drop a few metres ahead."""
PLUMES = Noise(particles=AIR["dense_dust"])
"""Dust of the rotors in plumes: one pulse of twenty ends in it, weakly, within eight metres."""
SNOW = Noise(particles=AIR["snow"])
"""Heavy snow: one pulse of ten ends in a flake, up to 25 metres away."""
TILT_DEG = 5.0
STEP_NS = 5_000_000_000
STUCK_PACKETS = 24
GARBAGE_M = 40.0
_CRC = struct.Struct("<I")
_CRC_AT, _CHECKED_FROM = HEADER.size - 4, HEADER.size


class Stop(Fault):
    """Silent sensor, as without power."""

    def start(self, simulation: Simulation) -> None:
        simulation.lidar_on = False

    def stop(self, simulation: Simulation) -> None:
        simulation.lidar_on = True


class _FaultySensor:
    """Sensor whose packets are modified before they are sent."""

    def __init__(self, sensor: Sensor, treat: Callable[[Packets], Packets]) -> None:
        self.sensor = sensor
        self.clock = sensor.clock
        self._treat = treat

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> Packets:
        return self._treat(self.sensor.scan(t0_ns, t1_ns, pose_at, world))


class PacketFault(Fault):
    """Modification of the packets of a LiDAR on UDP.

    Raises
    ------
    ValueError
        On `start`, if the simulation has no such LiDAR.
    """

    def __init__(self, treat: Callable[[Packets], Packets]) -> None:
        self._treat = treat

    def start(self, simulation: Simulation) -> None:
        port = _port(simulation)
        port.sensor = _FaultySensor(port.sensor, self._treat)

    def stop(self, simulation: Simulation) -> None:
        port = _port(simulation)
        if isinstance(port.sensor, _FaultySensor):
            port.sensor = port.sensor.sensor


class Halved:
    """Loss of every second packet."""

    def __init__(self) -> None:
        self._count = 0

    def __call__(self, packets: Packets) -> Packets:
        kept = [packet for k, packet in enumerate(packets, self._count) if k % 2]
        self._count += len(packets)
        return kept


class Stuck:
    """Frozen picture: repeated points with advancing stamps, counters and valid checksums."""

    def __init__(self) -> None:
        self._picture: Packets = []
        self._turn = 0

    def __call__(self, packets: Packets) -> Packets:
        return [self._again(packet) for packet in packets]

    def _again(self, packet: bytes) -> bytes:
        if len(self._picture) < STUCK_PACKETS:
            self._picture.append(packet[HEADER_BYTES:])
            return packet
        self._turn = (self._turn + 1) % STUCK_PACKETS
        points = self._picture[self._turn]
        return packet if len(points) != len(packet) - HEADER_BYTES else _sealed(packet, points)


class Garbage:
    """Invalid data, by thirds: random bytes, truncated packets, and valid packets of random points."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def __call__(self, packets: Packets) -> Packets:
        return [self._spoilt(packet) for packet in packets]

    def _spoilt(self, packet: bytes) -> bytes:
        kind = int(self._rng.integers(3))
        if kind == 0:
            return self._rng.bytes(int(self._rng.integers(1, 1500)))
        if kind == 1:
            return packet[: int(self._rng.integers(len(packet)))]
        points = np.frombuffer(packet[HEADER_BYTES:], CARTESIAN_32).copy()
        points["xyz"] = np.rint(self._rng.uniform(-GARBAGE_M, GARBAGE_M, (len(points), 3)) * 1000)
        points["reflectivity"], points["tag"] = 100, 0
        return _sealed(packet, points.tobytes())


class ClockStep(Fault):
    """Permanent step of the sensor's own clock, forward or back by five seconds."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._step_ns = STEP_NS if rng.random() < 0.5 else -STEP_NS

    def start(self, simulation: Simulation) -> None:
        sensor = _pulsed(simulation)
        clock = sensor.clock
        sensor.clock = Clock(clock.offset_ns + self._step_ns, clock.drift_ppb)


class Misalignment(Fault):
    """Rotation of the sensor in its mount by 5 degrees, about one of its axes."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._axis = ("roll_deg", "pitch_deg", "yaw_deg")[int(rng.integers(3))]
        self._turn_deg = TILT_DEG if rng.random() < 0.5 else -TILT_DEG
        self._before: Mount | None = None

    def start(self, simulation: Simulation) -> None:
        sensor = _pulsed(simulation)
        self._before = sensor.mount
        turned = getattr(sensor.mount, self._axis) + self._turn_deg
        sensor.mount = replace(sensor.mount, **{self._axis: turned})

    def stop(self, simulation: Simulation) -> None:
        if self._before is not None:
            _pulsed(simulation).mount = self._before


class Weather(Fault):
    """Weather that adds noise and limits the sensor's range, None for not."""

    def __init__(self, reach: Reach | None, noise: Noise) -> None:
        self._weather = reach, noise
        self._before: tuple[Reach, Noise] | None = None

    def start(self, simulation: Simulation) -> None:
        sensor = _pulsed(simulation)
        self._before = sensor.reach, sensor.noise
        reach, sensor.noise = self._weather
        sensor.reach = reach or sensor.reach

    def stop(self, simulation: Simulation) -> None:
        sensor = _pulsed(simulation)
        if self._before is not None:
            sensor.reach, sensor.noise = self._before


def _port(simulation: Simulation) -> UdpPort:
    port = simulation.lidar
    if not isinstance(port, UdpPort):
        raise ValueError("LiDAR fault: this simulation has no LiDAR that sends packets; give it lidar_to")
    return port


def _pulsed(simulation: Simulation) -> PulseLidar:
    sensor = _port(simulation).sensor
    if not isinstance(sensor, PulseLidar):
        raise ValueError("LiDAR fault: only a LiDAR that fires pulses can fail so")
    return sensor


def _sealed(packet: bytes, points: bytes) -> bytes:
    """Return a packet with other points and the matching checksum."""
    sealed = bytearray(packet[:HEADER_BYTES] + points)
    _CRC.pack_into(sealed, _CRC_AT, zlib.crc32(memoryview(sealed)[_CHECKED_FROM:]))
    return bytes(sealed)
