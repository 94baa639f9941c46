"""UDP output of the inertial unit inside a LiDAR."""

from __future__ import annotations

import socket
import struct

import numpy as np

from sitl.sensors.imu.inertial_unit import GRAVITY_MS2, IAM_20680, ICM_40609, InertialSamples, InertialUnit
from sitl.sensors.livox_packets import encode_imu
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.vehicle.pose_track import Motion

_OUSTER = struct.Struct("<QQQ3f3f")
PORTS = {"mid360": 56401, "ouster": 7503, "os0": 7503}
"""LiDARs with an inertial unit, and the host's port that the real one sends to."""


class LivoxInertialPackets:
    """Encoder of one Livox packet per sample."""

    def __init__(self) -> None:
        self._count = 0

    def encode(self, samples: InertialSamples) -> list[bytes]:
        out = []
        for stamp_ns, rate, force in zip(
            samples.stamp_ns.tolist(), samples.rate_rad_s, samples.force_ms2 / GRAVITY_MS2, strict=True
        ):
            out.append(encode_imu(stamp_ns, self._count, rate, force))
            self._count += 1
        return out


class OusterInertialPackets:
    """Encoder of one Ouster packet per sample."""

    def encode(self, samples: InertialSamples) -> list[bytes]:
        degrees, force = np.degrees(samples.rate_rad_s), samples.force_ms2 / GRAVITY_MS2
        return [
            _OUSTER.pack(stamp, stamp, stamp, *force[row].tolist(), *degrees[row].tolist())
            for row, stamp in enumerate(samples.stamp_ns.tolist())
        ]


def check_unit(lidar: str) -> None:
    """Raise ValueError if a LiDAR has no inertial unit."""
    if lidar not in PORTS:
        raise ValueError(f"IMU: LiDAR {lidar} has none; those that have one are {', '.join(PORTS)}")


class InertialPort:
    """Sender of the IMU packets of a LiDAR, by its clock and in its mount.

    Raises
    ------
    ValueError
        The LiDAR has no inertial unit.
    """

    def __init__(
        self, lidar: str, sensor: PulseLidar, rng: np.random.Generator, address: tuple[str, int]
    ) -> None:
        check_unit(lidar)
        livox = lidar == "mid360"
        self.unit = InertialUnit(rng, ICM_40609 if livox else IAM_20680)
        self.packets = LivoxInertialPackets() if livox else OusterInertialPackets()
        self.name = f"{address[0]}:{address[1]}"
        self._sensor = sensor
        self._address = address
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def scan(self, t0_ns: int, t1_ns: int, motion: Motion) -> None:
        """Send the samples due after t0 up to t1."""
        samples = self.unit.measure(t0_ns, t1_ns, motion, self._sensor.mount, self._sensor.clock)
        for packet in self.packets.encode(samples):
            try:
                self._socket.sendto(packet, self._address)
            except OSError:
                return  # no receiver

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
