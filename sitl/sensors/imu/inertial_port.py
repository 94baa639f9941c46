"""UDP output of the inertial unit inside a LiDAR."""

from __future__ import annotations

import socket

import numpy as np

from sitl.sensors.imu.inertial_packets import LivoxInertialPackets, OusterInertialPackets
from sitl.sensors.imu.inertial_unit import IAM_20680, ICM_40609, InertialUnit
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.vehicle.pose_track import Motion

PORTS = {"mid360": 56401, "ouster": 7503, "os0": 7503}
"""LiDARs with an inertial unit, and the host's port that the real one sends to."""


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
