"""Where a simulated LiDAR's data leave it: a UDP socket for packets, a serial line for frames."""

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
"""Instead of a device: one end of a new pseudo-terminal, whose other end's name is `name`."""

Address = tuple[str, int] | str
"""Host and port of a UDP socket, or the device of a serial line."""


class Sensor(Protocol):
    """What is carried by a vehicle and sends datagrams."""

    clock: Clock

    def step(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> list[bytes]:
        """Measure in [t0_ns, t1_ns) and return what is to be sent."""


class LidarPort(Protocol):
    """A sensor and its way out."""

    name: str

    @property
    def sensor(self) -> Sensor | Sf45:
        """What measures."""

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> None:
        """Fire what is due in [t0_ns, t1_ns) and send it."""

    def close(self) -> None:
        """Let go of the socket or line."""


class UdpPort:
    """Sends packets, whether anybody listens or not."""

    def __init__(self, sensor: Sensor, address: tuple[str, int]) -> None:
        self.sensor = sensor
        self.name = f"{address[0]}:{address[1]}"
        self._address = address
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> None:
        for packet in self.sensor.step(t0_ns, t1_ns, pose_at, world):
            try:
                self._socket.sendto(packet, self._address)
            except OSError:
                break  # nobody listens

    def close(self) -> None:
        self._socket.close()


class SerialPort:
    """Answers requests on a line and sends frames; what the line does not take at once is lost.

    Raises
    ------
    WireError
        The device cannot be opened, or is none.
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
        self._write(self.sensor.receive(asked) + self.sensor.step(t0_ns, t1_ns, pose_at, world))

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
