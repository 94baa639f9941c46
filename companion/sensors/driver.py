"""LiDAR drivers by URL."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from companion.clock import now_ns
from companion.errors import UsageError
from companion.sensors.clock import SensorClock
from companion.sensors.livox import LivoxDecoder
from companion.sensors.returns import Returns
from params import Parameters

BATCH_S = 0.01
BATCH_PACKETS = 64
RECEIVE_BUFFER = 8 << 20

OnReturns = Callable[[Returns], None]


def open_lidar(url: str, parameters: Parameters, on_returns: OnReturns) -> LivoxDriver:
    """Return the driver for a URL such as `livox:0.0.0.0:56301`.

    Raises
    ------
    UsageError
        The URL is malformed or names a sensor that is not supported.
    """
    kind, _, address = url.partition(":")
    if kind != "livox":
        raise UsageError(f"LiDAR {url!r} is not supported: write livox:HOST:PORT")
    host, _, port = address.rpartition(":")
    if not port.isdigit() or not 0 < int(port) < 65536:
        raise UsageError(f"LiDAR {url!r} has no port: write livox:HOST:PORT, such as livox:0.0.0.0:56301")
    return LivoxDriver(host.strip("[]") or "0.0.0.0", int(port), parameters, on_returns)


class LivoxDriver(asyncio.DatagramProtocol):
    """Receives point packets on a UDP port and hands on their returns in batches of 10 ms."""

    def __init__(self, host: str, port: int, parameters: Parameters, on_returns: OnReturns) -> None:
        self._address = (host, port)
        self._on_returns = on_returns
        self._decoder = LivoxDecoder()
        self._clock = SensorClock(round(parameters.lidar_delay_ms * 1e6))
        self._packets: list[bytes] = []
        self._timer: asyncio.TimerHandle | None = None
        self._failure: asyncio.Future[None] | None = None
        self.last_arrival_ns: int | None = None

    async def run(self) -> None:
        """Receive until cancelled; raise UsageError if the port cannot be bound."""
        loop = asyncio.get_running_loop()
        self._failure = loop.create_future()
        transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=self._bound())
        try:
            await self._failure
        finally:
            transport.close()
            if self._timer is not None:
                self._timer.cancel()

    def _bound(self) -> socket.socket:
        host, port = self._address
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        sock = socket.socket(family, socket.SOCK_DGRAM)
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        sock.setblocking(False)
        try:
            sock.bind(self._address)
        except OSError as error:
            sock.close()
            why = "the port is in use" if error.errno == errno.EADDRINUSE else str(error.strerror or error)
            raise UsageError(f"LiDAR livox:{host}:{port}: {why}") from None
        return sock

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Keep a packet for the next batch."""
        arrival = now_ns()
        stamp = self._decoder.stamp_of(data)
        if stamp is not None:
            self._clock.observe(stamp, arrival)
            self.last_arrival_ns = arrival
        self._packets.append(data)
        if len(self._packets) >= BATCH_PACKETS:
            self._flush()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(BATCH_S, self._flush)

    def error_received(self, exc: Exception) -> None:
        """Ignore what a peer's closed port answers; nothing is sent from here."""

    def _flush(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        packets, self._packets = self._packets, []
        try:
            raw = self._decoder.decode(packets)
            if len(raw.stamp_ns):
                offset = self._clock.offset_ns(int(raw.stamp_ns[-1]))
                order = np.argsort(raw.stamp_ns, kind="stable")
                self._on_returns(
                    Returns(raw.xyz_m[order], raw.stamp_ns[order] + offset, raw.intensity[order])
                )
        except Exception as error:
            if self._failure is not None and not self._failure.done():
                self._failure.set_exception(error)

    def statistics(self) -> dict[str, int]:
        """Counters of packets, returns and what was dropped."""
        return asdict(self._decoder.counters) | {"clock_resets": self._clock.resets}
