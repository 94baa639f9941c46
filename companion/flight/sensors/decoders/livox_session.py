"""Control session that keeps a Mid-360 sampling and sending to this computer."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Any

from companion.flight.sensors.decoders.livox_protocol import PORT, LivoxControl
from companion.runtime.clock import now_ns
from companion.runtime.errors import UsageError

log = logging.getLogger(__name__)

TICK_S = 0.2


class LivoxSession(asyncio.DatagramProtocol):
    """Client of the sensor's control port.

    Parameters
    ----------
    sensor
        Its address; ADDRESS:PORT if the port is not 56100.
    port
        Port on which this computer receives points.
    last_point_ns
        Returns the arrival of the newest points.
    imu_port
        Port on which this computer receives inertial samples, None if it wants none.
    """

    def __init__(
        self,
        sensor: str,
        port: int,
        last_point_ns: Callable[[], int | None],
        imu_port: int | None = None,
    ) -> None:
        host, _, own = sensor.partition(":")
        self._sensor = host, int(own or PORT)
        self._port, self._imu_port = port, imu_port
        self._last_point_ns = last_point_ns
        self._control: LivoxControl | None = None
        self._heard = False

    @property
    def address(self) -> str:
        """The sensor's address."""
        return self._sensor[0]

    @property
    def answers(self) -> bool:
        """True if the sensor has answered the newest request, and accepted it."""
        return self._control is not None and self._control.answered and not self._control.refused

    @property
    def refused(self) -> str:
        """Why the sensor refused the newest request, empty if it did not."""
        return "" if self._control is None else self._control.refused

    async def run(self) -> None:
        """Send requests until the sensor samples, and whenever it stops, until cancelled.

        Raises
        ------
        UsageError
            There is no route to that address.
        """
        loop = asyncio.get_running_loop()
        try:
            transport, _ = await loop.create_datagram_endpoint(lambda: self, remote_addr=self._sensor)
        except OSError as error:
            why = error.strerror or error
            raise UsageError(f"LiDAR at {self._sensor[0]}: {why}; is the network card set up?") from None
        own: socket.socket = transport.get_extra_info("socket")
        self._control = LivoxControl(own.getsockname()[0], self._port, self._imu_port)
        try:
            while True:
                request = self._control.due(now_ns(), self._last_point_ns())
                if request is not None:
                    transport.sendto(request)
                await asyncio.sleep(TICK_S)
        finally:
            transport.close()

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Process an answer."""
        if self._control is not None and self._control.on_datagram(data) and not self._heard:
            self._heard = True
            log.info("LiDAR at %s answers", self._sensor[0])

    def error_received(self, exc: Exception) -> None:
        """Ignore that nobody listens there yet: the request is repeated."""
