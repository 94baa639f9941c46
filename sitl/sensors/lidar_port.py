"""Data output of a simulated LiDAR: a UDP socket for packets, a serial line for frames."""

from __future__ import annotations

import os
import socket
import tty
from typing import Protocol

from sitl.sensors.pulse_lidar import PoseAt
from sitl.sensors.sensor_clock import Clock
from sitl.sensors.sf45 import Sf45
from sitl.wire.wire import WireError
from sitl.world.world import World

PTY = "pty"
"""Instead of a device: one end of a new pseudo-terminal; `name` is the name of its other end."""

Address = tuple[str, int] | str
"""Host and port of a UDP socket, or the device of a serial line."""


class Sensor(Protocol):
    """Interface of a sensor on a vehicle that sends datagrams."""

    clock: Clock

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> list[bytes]:
        """Measure in [t0_ns, t1_ns) and return the datagrams to send."""


class LidarPort(Protocol):
    """Interface of a sensor with its output."""

    name: str

    @property
    def sensor(self) -> Sensor | Sf45:
        """The sensor."""

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> None:
        """Fire the pulses due in [t0_ns, t1_ns) and send the results."""

    def close(self) -> None:
        """Close the socket or line."""


class UdpPort:
    """Sender of UDP packets, with or without a receiver.

    Attributes
    ----------
    address
        Host and port of the receiver.
    """

    def __init__(self, sensor: Sensor, address: tuple[str, int]) -> None:
        self.sensor = sensor
        self.name = f"{address[0]}:{address[1]}"
        self.address = address
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> None:
        for packet in self.sensor.scan(t0_ns, t1_ns, pose_at, world):
            try:
                self._socket.sendto(packet, self.address)
            except OSError:
                break  # no receiver

    def close(self) -> None:
        self._socket.close()


class SerialPort:
    """Serial line that answers requests and sends frames; data that the line does not accept is lost.

    Raises
    ------
    WireError
        The device cannot be opened, or is not a serial line.
    """

    def __init__(self, sensor: Sf45, device: str) -> None:
        self.sensor = sensor
        self._other: int | None = None
        if device == PTY:
            self._line, self._other = os.openpty()
            self.name = os.ttyname(self._other)
        else:
            self._line, self.name = _opened(device), device
        tty.setraw(self._line)
        os.set_blocking(self._line, False)

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> None:
        try:
            asked = os.read(self._line, 65536)
        except OSError:
            asked = b""
        self._write(self.sensor.receive(asked) + self.sensor.scan(t0_ns, t1_ns, pose_at, world))

    def _write(self, data: bytes) -> None:
        if data:
            try:
                os.write(self._line, data)
            except OSError:
                return

    def close(self) -> None:
        os.close(self._line)
        if self._other is not None:
            os.close(self._other)


def _opened(device: str) -> int:
    try:
        line = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise WireError(f"{device}: {error.strerror}") from None
    if not os.isatty(line):
        os.close(line)
        raise WireError(f"{device}: not a serial device")
    return line
